"""The page fits its window, and is accessible: widths, cut texts, names, contrast, dialog of keys, palette, tab title."""

import itertools
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from playwright.sync_api import Locator, expect

from app.debugger.commands import Restart, Run
from app.debugger.history import StageProgress
from app.debugger.run_state import Activity, RunState
from app.debugger.work_report import WorkReport
from app.page_state.cells_state import CROP, PAIR_KINDS, CellsView
from app.page_state.page_state import PlotView
from app.panels.status import Status, begin_note
from app.viser_bridge.floating import MARGIN
from fairing.options import PRESETS, FairingOptions, ScheduleOptions
from fairing.run.recorded_stages import RecordedStage
from fairing.run_plan import RunPlan
from fairing.trace import SchedulePosition
from tests.browser.driver import IN_BROWSER, WINDOW, Visitor, page_of
from tests.browser.page_fit import (
    OPTIONS,
    SIZES,
    TABS,
    cut_texts,
    enlarge_a_cell,
    serious_findings,
    show,
    switch_theme,
    too_wide,
    wait_until_calm,
)
from tests.waiting import PATIENCE, wait_for

pytestmark = [*IN_BROWSER, pytest.mark.slow]

ORDERS = ("sequential", "worst_first", "independent", "joint")
FINISHED = [
    *((preset, options.schedule.order) for preset, options in PRESETS.items()),
    *zip(itertools.cycle(PRESETS), sorted(set(ORDERS) - {options.schedule.order for options in PRESETS.values()})),
]
"""Each preset in its own order at the first of the sizes, and each other order once, at the second. Colours change no width."""
ENLARGED = ("residual", "model", CROP, PAIR_KINDS[0])
COVERED_BUTTONS = """panel => [...panel.querySelectorAll('button')].filter(button => {
    const box = button.getBoundingClientRect();
    return !button.contains(document.elementFromPoint(box.left + box.width / 2, box.top + box.height / 2));
}).map(button => button.title || button.textContent)"""


@pytest.fixture(scope="module", autouse=True)
def two_steps_and_a_vertex(module_visitor: Visitor):
    module_visitor.press("Step one iteration")
    page_of(module_visitor.app).interaction.select(0)
    module_visitor.page.get_by_alt_text("cells in cube_00.png").or_(
        module_visitor.page.get_by_text("cube_", exact=False)
    ).first.wait_for()


@pytest.mark.parametrize(("preset", "order"), FINISHED)
def test_nothing_is_cut_or_scrolls_sideways_at_the_end_of_a_run(visitor: Visitor, preset: str, order: str):
    controller, interaction = visitor.app.controller, page_of(visitor.app).interaction
    options = PRESETS[preset].with_levels(max_sweeps=1, max_iterations=1)
    schedule = replace(options.schedule, order=order)  # pyright: ignore[reportArgumentType]
    controller.post(Restart(replace(options, schedule=schedule)))
    controller.post(Run())
    assert controller.wait_until_idle(PATIENCE).finished
    visitor.button("Result").wait_for()
    visitor.page.locator(".ef .pinned", has_text="grey levels").wait_for()
    size = SIZES[FINISHED.index((preset, order)) // len(PRESETS)]
    visitor.resize(size)
    for tab in TABS:
        show(visitor, tab)
        assert too_wide(visitor) == [], f"{preset}, {order}, {size}, {tab}"
        assert cut_texts(visitor) == [], f"{preset}, {order}, {size}, {tab}"
    visitor.button("Result").click()
    visitor.page.get_by_text("Where the photos agree least").wait_for()
    assert too_wide(visitor) == [], f"{preset}, {order}, {size}, result"
    assert cut_texts(visitor) == [], f"{preset}, {order}, {size}, result"
    interaction.select(0)
    visitor.resize(WINDOW)


def floating_panel(visitor: Visitor, tab: str) -> Locator:
    """The floating panel that has this tab."""
    return visitor.page.locator("[data-floating-window]", has=visitor.page.get_by_role("tab", name=tab, exact=True))


def placed(visitor: Visitor, tab: str) -> tuple[float, float, float, float]:
    """Left, top, right and bottom of a floating panel, px."""
    box = visitor.box_of(floating_panel(visitor, tab))
    return box["x"], box["y"], box["x"] + box["width"], box["y"] + box["height"]


@pytest.mark.parametrize("kind", ENLARGED)
def test_the_lens_and_the_camera_box_leave_each_other_room(visitor: Visitor, kind: str):
    state, controller = page_of(visitor.app).page_state, visitor.app.controller
    visitor.close_notifications()
    try:
        state.cells = CellsView(enlarged=(0, kind))
        controller.republish()
        visitor.button("Close the lens").wait_for()
        visitor.page.keyboard.press("3")
        visitor.button("Leave the camera").wait_for()
        for size in SIZES:
            visitor.resize(size)
            lens, camera, timeline = (placed(visitor, tab) for tab in ("Lens", "Camera", "Timeline"))
            view = visitor.canvas_box()
            assert view["x"] <= lens[0], size
            assert lens[2] < camera[0], f"the lens ends at {lens[2]}, the camera box begins at {camera[0]}, {size}"
            assert camera[2] <= view["x"] + view["width"], size
            assert max(lens[3], camera[3]) < timeline[1], size
            for tab in ("Lens", "Camera"):
                covered = floating_panel(visitor, tab).evaluate(COVERED_BUTTONS)
                assert covered == [], f"{size}, {tab}"
            assert too_wide(visitor) == [], size
    finally:
        state.cells = CellsView()
        visitor.page.keyboard.press("0")
        visitor.button("Leave the camera").wait_for(state="detached")
        visitor.resize(WINDOW)


def test_the_lens_does_not_change_its_height_when_values_are_read_in_it(visitor: Visitor):
    enlarge_a_cell(visitor)
    page = visitor.page
    page.keyboard.press("3")
    visitor.button("Leave the camera").wait_for()
    try:
        visitor.wait_until_at_rest(floating_panel(visitor, "Lens"))
        picture, read = visitor.box_of(page.get_by_alt_text("enlarged cell")), set()
        floating_panel(visitor, "Lens").evaluate(
            """panel => {
                window.heights = [];
                new ResizeObserver(() => heights.push(panel.getBoundingClientRect().height)).observe(panel);
            }"""
        )
        for at in np.linspace(0.02, 0.48, 24) * picture["width"]:
            page.mouse.move(picture["x"] + at, picture["y"] + at)
            read.add(page.locator(".read-out").inner_text())
        visitor.wait_until_at_rest(floating_panel(visitor, "Lens"))
        assert len(set(page.evaluate("heights"))) == 1
        assert len(read) > 2, "values were read"
    finally:
        visitor.button("Close the lens").click()
        page.keyboard.press("0")
        visitor.button("Leave the camera").wait_for(state="detached")


@pytest.mark.parametrize("of_vertex", [False, True])
def test_the_note_of_every_plot_is_whole_and_not_there_before_the_first_step(visitor: Visitor, of_vertex: bool):
    visitor.app.controller.post(Restart(OPTIONS))
    visitor.app.controller.wait_until_idle()
    note, kinds = visitor.page.locator(".quantities.kind .one"), visitor.page.locator(".quantities:not(.kind) button")
    visitor.page.get_by_text("No steps yet.").wait_for()
    assert note.inner_text() == ""
    visitor.press("Step one iteration")
    page = page_of(visitor.app)
    page.page_state.plot = PlotView(of_vertex=of_vertex)
    try:
        for size in SIZES:
            visitor.resize(size)
            for title in kinds.all_inner_texts():
                kinds.get_by_text(title, exact=True).click()
                visitor.page.get_by_role("img", name=f"{title.capitalize()} plot").wait_for()
                text, room = note.evaluate(
                    """note => {
                        const text = document.createRange();
                        text.selectNodeContents(note);
                        return [text.getBoundingClientRect().width, note.getBoundingClientRect().width];
                    }"""
                )
                assert 0 < text <= room, f"{title}, {size}"
    finally:
        page.page_state.plot = PlotView()
        visitor.resize(WINDOW)


@pytest.mark.parametrize("size", [(1280, 800), (1280, 640), (1440, 640), (1280, 720)])
def test_the_timeline_lies_along_the_bottom_of_the_window(visitor: Visitor, size: tuple[int, int]):
    show(visitor, "Timeline")
    visitor.page.set_viewport_size({"width": size[0], "height": size[1]})
    visitor.page.wait_for_timeout(700)  # a placement that comes too late would be a wrong one
    tab = visitor.page.get_by_role("tab", name="Timeline")
    timeline = visitor.box_of(visitor.page.locator("[data-floating-window]", has=tab))
    bottom, width = timeline["y"] + timeline["height"], visitor.canvas_size()[0]
    assert bottom == pytest.approx(size[1] - MARGIN, abs=1)
    assert timeline["width"] == pytest.approx(width - 2 * MARGIN, abs=1)


@pytest.mark.parametrize("order", ORDERS)
def test_position_and_energy_fit_in_one_line_each_with_large_numbers(visitor: Visitor, order: str):
    visitor.app.controller.post(Restart(OPTIONS))
    visitor.app.controller.wait_until_idle()
    page, state = page_of(visitor.app), visitor.press("Step one iteration")
    assert state.record is not None
    assert len(state.record.faces)
    status = next(panel for panel in page.panels._panels if isinstance(panel, Status))
    blur = (10.0, 8.5, 6.0, 4.5, 3.0, 1.25, 0.65)
    options = FairingOptions(schedule=ScheduleOptions(order=order))  # pyright: ignore[reportArgumentType]
    options = options.with_levels(blur=blur, max_sweeps=12, max_iterations=10)
    large = replace(state, options=options, position=SchedulePosition(6, 11, 2477, 9), moment=1, length=2)
    show, energies = status.show, status._energies
    status._energies = SimpleNamespace(  # of the same step, with large numbers
        before=[9_999_999.0],
        after=[8_888_888.0],
        stage_progress=lambda step, length: StageProgress(RecordedStage(state.record.stage, 6, 0, 1), 12, None),
    )  # pyright: ignore[reportAttributeAccessIssue]
    status.show = lambda state, page_state: show(large, page_state)
    try:
        visitor.app.controller.republish()
        crumbs = visitor.page.locator(".crumbs", has_text="iteration 10")
        crumbs.wait_for()
        words = {
            "sequential": "2478th vertex",
            "worst_first": "2478th vertex",
            "independent": "2478th set",
            "joint": "",
        }
        assert " ".join(crumbs.inner_text().split()).startswith(f"level 7/7 › sweep 12 › {words[order]}")
        for size in SIZES:
            visitor.resize(size)
            visitor.page.wait_for_function(
                """() => {
                    const [crumbs, energy] = document.querySelectorAll('.ef .crumbs, .ef .crumbs + .row');
                    return [crumbs, energy].every(row => row.getBoundingClientRect().height < 26 && [...row.children].every(
                        part => part.getBoundingClientRect().right <= row.getBoundingClientRect().right + 0.5));
                }"""  # px; two lines take 36
            )
    finally:
        status.show, status._energies = show, energies
        visitor.app.controller.republish()
        visitor.resize(WINDOW)


NOTES = (
    RunPlan(2, False, False),
    RunPlan(3, False, True, start_sigma=19.0),
    RunPlan(4, False, True, start_sigma=6.0, represents_surface=True),
)
"""Plans of runs that begin near the truth, where the faces ask for it, where the start error does, after a fit, and near sparse
points."""


def test_the_line_below_the_last_step_is_whole_and_keeps_the_count_of_a_long_work(visitor: Visitor):
    visitor.app.controller.post(Restart(FairingOptions()))
    visitor.app.controller.wait_until_idle()
    page, state = page_of(visitor.app), visitor.press("Step one iteration")
    status = next(panel for panel in page.panels._panels if isinstance(panel, Status))
    show, line = status.show, visitor.page.locator(".ef .work-line")

    def shown(changed: RunState) -> None:
        status.show = lambda _, page_state: show(changed, page_state)
        visitor.app.controller.republish()

    try:
        for size in SIZES:
            visitor.resize(size)
            for plan in NOTES:
                trace = SimpleNamespace(plan=plan)
                note = begin_note(SimpleNamespace(trace=trace, options=FairingOptions()))  # pyright: ignore[reportArgumentType]
                assert note.startswith("Begins at level ")
                shown(replace(state, reason=note))
                line.get_by_text(note, exact=True).wait_for()
                words = line.locator("span").first
                assert words.evaluate("words => words.scrollWidth <= words.clientWidth"), f"{note} is cut, {size}"
            work = WorkReport("trying a start fitted to the sparse points of all photos, 10 of 12", 0.8, 125.0)
            shown(replace(state, activity=Activity.STEPPING, work=work))
            count = line.get_by_text(", 10 of 12", exact=True)
            count.wait_for()
            # In one evaluation: the panel may still be moving after the change of the window's size.
            beyond = count.evaluate("""count => count.getBoundingClientRect().right
                - count.closest('.work-line').getBoundingClientRect().right""")
            assert beyond <= 0.5, size
            assert line.locator("span").first.evaluate("words => words.scrollWidth > words.clientWidth")
    finally:
        status.show = show
        visitor.app.controller.republish()
        visitor.resize(WINDOW)


def test_the_viewer_settings_have_no_serious_findings_of_axe_and_their_tree_obeys_the_keyboard(visitor: Visitor):
    page = visitor.page
    visitor.button("Viewer settings").click()
    try:
        # Not check(): React sets the state some time after the click.
        page.get_by_label("Dev Settings").click()
        expect(page.get_by_label("Dev Settings")).to_be_checked()
        page.get_by_role("button", name="Expand /mesh", exact=True).press("Enter")
        page.get_by_role("button", name="Collapse /mesh", exact=True).wait_for()
        for theme in ("light", "dark"):
            switch_theme(visitor, theme)
            assert serious_findings(visitor) == [], theme
            for node in ("/mesh/now", "/paths"):
                page.get_by_role("button", name=f"Edit props for {node}", exact=True).press("Enter")
                props = page.locator(f"[data-props-popover-for='{node}']")
                props.wait_for()
                wait_until_calm(visitor)
                assert serious_findings(visitor, f"[data-props-popover-for='{node}']") == [], f"{node}, {theme}"
                page.get_by_role("button", name=f"Edit props for {node}", exact=True).press("Enter")
                props.wait_for(state="detached")
            page.evaluate("document.activeElement.blur()")
        for name in ("Hide /paths", "Show /paths", "Hide /paths"):
            page.get_by_role("button", name=name, exact=True).press("Enter")
        page.get_by_role("button", name="Clear visibility of /paths", exact=True).press("Enter")
        page.get_by_role("button", name="Hide /paths", exact=True).wait_for()
        expect(page.get_by_role("button", name="Clear visibility of /paths", exact=True)).to_have_count(0)
        page.get_by_role("button", name="Collapse /mesh", exact=True).press("Enter")
        page.get_by_label("Dev Settings").click()
        expect(page.get_by_label("Dev Settings")).not_to_be_checked()
    finally:
        visitor.button("arrow back").click()
        visitor.button("Step one iteration").wait_for()


def test_every_control_has_its_visible_name_and_switches_have_a_state(visitor: Visitor):
    visitor.app.controller.post(Restart(OPTIONS))
    visitor.press("Step one iteration")  # without a step the timeline's slider is disabled and has no thumb
    for tab in TABS:
        show(visitor, tab)
        wrong = visitor.page.evaluate(
            """() => [...document.querySelectorAll('.ef button')].filter(button => {
                const visible = [...button.childNodes].filter(node => !node.matches?.('svg, kbd, [aria-hidden]'))
                    .map(node => node.textContent).join('').trim();
                const name = button.getAttribute('aria-label');
                return visible ? name !== null && name !== visible : !name;
            }).map(button => button.outerHTML.slice(0, 200))"""
        )
        assert wrong == [], tab
    show(visitor, "Layers")
    switch = visitor.button("Vertex paths")
    assert switch.get_attribute("aria-pressed") == "true"
    switch.click()
    visitor.page.locator("button[aria-pressed=false]", has_text="Vertex paths").wait_for()
    visitor.button("Vertex paths").click()
    visitor.page.get_by_role("slider", name="Moment", exact=True).wait_for()


def test_the_keys_are_listed_in_two_columns_closed_by_escape_or_the_cross_and_stop_keys_behind_them(visitor: Visitor):
    dialog, before = visitor.page.locator(".ef .dialog"), visitor.app.controller.state
    visitor.page.keyboard.press("Shift+?")
    dialog.wait_for()
    left, right = (visitor.box_of(column) for column in dialog.locator("table").all())
    assert right["x"] > left["x"] + left["width"]
    assert right["y"] == left["y"]
    visitor.page.keyboard.press("F11")
    visitor.page.keyboard.press("n")
    visitor.page.keyboard.press("Escape")
    dialog.wait_for(state="detached")
    assert visitor.app.controller.wait_until_idle().moment == before.moment
    visitor.page.keyboard.press("Shift+?")
    visitor.button("Close").click()
    dialog.wait_for(state="detached")


def test_the_palette_lists_a_command_once_with_all_its_keys_and_all_of_them_work(visitor: Visitor):
    visitor.app.controller.post(Restart(OPTIONS))
    visitor.app.controller.wait_until_idle()
    visitor.page.keyboard.press("Control+k")
    visitor.page.keyboard.type("Step one iteration")
    entries = visitor.page.locator(".mantine-Spotlight-action", has_text="Step one iteration")
    entries.first.wait_for()
    assert [entry.inner_text().split("\n")[-1] for entry in entries.all()][:1] == ["F11, I (.)"]
    expect(entries.filter(has_not_text="back")).to_have_count(1)
    visitor.page.keyboard.press("Escape")
    visitor.page.locator(".mantine-Spotlight-action").first.wait_for(state="detached")
    moments = [visitor.key(key).moment for key in ("F11", "i", ".")]
    assert np.diff(moments).tolist() == [1, 1]


def test_the_palette_and_the_list_of_keys_call_a_command_by_one_name(visitor: Visitor):
    page = visitor.page
    page.keyboard.press("Control+k")
    entries = page.locator(".mantine-Spotlight-action")
    entries.first.wait_for()
    in_palette = {entry.split("\n")[0] for entry in entries.all_inner_texts()}
    page.keyboard.press("Escape")
    entries.first.wait_for(state="detached")
    page.keyboard.press("Shift+?")
    page.locator(".ef .dialog").wait_for()
    in_list = set(page.locator(".ef .dialog td").all_inner_texts())
    page.keyboard.press("Escape")
    page.locator(".ef .dialog").wait_for(state="detached")
    # One row of the list stands for nine entries, and the palette does not contain itself.
    assert in_list - in_palette == {"Look through a camera", "All commands"}


def test_the_row_of_the_current_run_is_whole_among_more_runs_than_fit(visitor: Visitor):
    controller = visitor.app.controller
    for _ in range(5):
        controller.post(Restart(OPTIONS))
        controller.wait_until_idle()
        visitor.press("Step one iteration")
    show(visitor, "Runs")
    box, row = visitor.page.locator(".ef .scroll", has=visitor.page.locator(".runs .current")), ".runs .current button"
    assert box.evaluate("box => box.scrollHeight > box.clientHeight")
    outer = visitor.box_of(box)
    for down in (0, 1000):
        box.evaluate(f"box => box.scrollTop = {down}")
        current = visitor.box_of(visitor.page.locator(row).first)
        assert current["y"] >= outer["y"]
        assert current["y"] + current["height"] <= outer["y"] + outer["height"]


def test_the_tab_has_the_scenes_name(visitor: Visitor):
    assert visitor.page.title() == "EigenFairing - cube"


def test_names_are_completed_and_a_mistake_is_shown_below_the_field(visitor: Visitor):
    show(visitor, "Breakpoints")
    field = visitor.input_of("Stop when")
    field.click()
    visitor.page.keyboard.type("travel")
    visitor.page.get_by_role("option").filter(has_text="travelled(0)").wait_for()
    visitor.page.keyboard.press("Tab")
    assert field.input_value() == "travelled(0)"
    visitor.page.keyboard.press("Enter")
    visitor.page.get_by_role("alert").filter(has_text="expected a comparison such as travelled(0) > 0").wait_for()
    field.fill("outliers(view) > 0.2")
    field.press("Enter")
    controller = visitor.app.controller
    wait_for(lambda: [item.condition.text for item in controller.state.breakpoints] == ["outliers(view) > 0.2"])
    controller.edit_breakpoints(lambda items: items.removed(items.items[0].number))
    show(visitor, "Vertex")
    watch = visitor.input_of("Watch")
    watch.fill("energy >> 1")
    watch.press("Enter")
    visitor.page.locator("pre", has_text="energy >> 1").filter(has_text="^").wait_for()
    watch.fill("energy / 1000")
    watch.press("Enter")
    visitor.page.locator("code", has_text="energy / 1000").wait_for()
