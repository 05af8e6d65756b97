"""The page with content in every panel fits its window, and is accessible."""

import pytest

from app.debugger.commands import Restart
from app.debugger.compare import Reference
from app.debugger.watch import parse_watch
from app.page_state.cells_state import PAGES
from app.page_state.selection import Selection
from tests.browser.driver import IN_BROWSER, Visitor, page_of
from tests.browser.page_fit import (
    OPTIONS,
    SIZES,
    TABS,
    enlarge_a_cell,
    serious_findings,
    show,
    switch_theme,
    too_wide,
    wait_for_names,
    wait_until_calm,
)
from tests.waiting import wait_for

pytestmark = [*IN_BROWSER, pytest.mark.slow]

GROUPS = ".mantine-Paper-root > .mantine-Paper-root:has(> svg[class*=chevron])"  # titles of viser's folders
CELLS = {
    "In the photos": ".ef :text('its last step, ×')",
    "Pair": ".ef :text(' warped into ')",
    "Cells": ".ef img[alt^='cells in ']",
}
"""Pages of the cells, and what each alone contains."""
# axe leaves the tabs out, since viser draws a line over them.
TAB_CONTRASTS = """() => {
    const numbers = color => color.match(/[\\d.]+/g).map(Number);
    const light = color => numbers(color).slice(0, 3).map(value => value / 255)
        .map(value => value <= 0.03928 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4)
        .reduce((sum, value, k) => sum + value * [0.2126, 0.7152, 0.0722][k], 0);
    const behind = element => {
        const color = getComputedStyle(element).backgroundColor;
        return numbers(color)[3] === 0 ? behind(element.parentElement) : color;
    };
    return [...document.querySelectorAll('[role=tab]')].map(tab => {
        const [dark, bright] = [light(getComputedStyle(tab).color), light(behind(tab))].sort((a, b) => a - b);
        return (bright + 0.05) / (dark + 0.05);
    });
}"""


@pytest.fixture(scope="module", autouse=True)
def filled(module_visitor: Visitor) -> None:
    """Fill every panel: long conditions and notes, runs, A, a photo, a coloured surface."""
    visitor = module_visitor
    controller, page = visitor.app.controller, page_of(visitor.app)
    visitor.press("Step one iteration")
    controller.post(Restart(OPTIONS))
    controller.wait_until_idle()
    visitor.press("Step one iteration")
    page.interaction.set_selection(Selection((0,)))
    condition = "outliers(view) > 0.25 and travelled(0) > 1.5 or weakest < 0.001 and displaced(vertex) > 12.5"
    controller.edit_breakpoints(lambda items: items.added(condition))
    controller.edit_bookmarks(lambda items: items.added(1, 0, "1:1:1:1", "a long note on what happens here " * 4))
    state = page.page_state
    watch = "energy / 1000 + 12.5 * step_px - 3 * damping + accepted / 7 - rejected + moved(vertex)"
    state.reference, state.watches = Reference(1, 0), (parse_watch(watch, controller.scene),)
    state.surface, state.residual_view = "flow", 0
    controller.republish()
    visitor.page.keyboard.press("3")
    visitor.button("Leave the camera").wait_for()
    show(visitor, "Breakpoints")
    field = visitor.input_of("Stop when")
    field.fill("energy >> a_name_that_is_not_known_at_all")
    field.press("Enter")
    visitor.page.get_by_role("alert").filter(has_text="expected a number or a name").wait_for()
    show(visitor, "Options")
    for group in visitor.page.locator(GROUPS).all():
        group.click()


def test_filled_panels_do_not_overflow(visitor: Visitor):
    for size in SIZES:
        visitor.resize(size)
        for tab in TABS:
            show(visitor, tab)
            assert too_wide(visitor) == [], f"{size}, {tab}"
    enlarge_a_cell(visitor)
    for size in reversed(SIZES):
        visitor.resize(size)
        assert too_wide(visitor) == [], f"{size}, lens"
    visitor.button("Close the lens").click()


@pytest.mark.parametrize(
    "tabs",
    [
        ("Lessons", "Layers", "Runs"),
        ("Cells", "Options", "Timeline"),
        ("Experiments", "Breakpoints", "Bookmarks"),
        ("Cells", "Vertex", "Runs"),
    ],
)
def test_axe_has_no_serious_findings_in_either_theme(visitor: Visitor, tabs: tuple[str, ...]):
    for tab in tabs:
        show(visitor, tab)
    for theme in ("light", "dark"):
        switch_theme(visitor, theme)
        assert min(visitor.page.evaluate(TAB_CONTRASTS)) >= 4.5, theme
        assert serious_findings(visitor) == [], theme


def test_axe_has_no_serious_findings_in_the_pages_of_the_cells_and_in_the_dialogs(visitor: Visitor):
    page, state = visitor.page, page_of(visitor.app).page_state
    enlarge_a_cell(visitor)
    for theme in ("light", "dark"):
        switch_theme(visitor, theme)
        for cells, content in CELLS.items():
            visitor.button(f"Page: {cells}").click()
            wait_for(lambda cells=cells: PAGES[state.cells.page] == cells)
            page.locator(content).first.wait_for()
            wait_until_calm(visitor)
            assert serious_findings(visitor) == [], f"{cells}, {theme}"
        for keys, content in (("Shift+?", ".ef .dialog"), ("Control+k", ".mantine-Spotlight-action")):
            page.keyboard.press(keys)
            page.locator(content).first.wait_for()
            wait_until_calm(visitor)
            assert serious_findings(visitor, "[role=dialog]") == [], f"{keys}, {theme}"
            page.keyboard.press("Escape")
            page.locator(content).first.wait_for(state="detached")
    visitor.button("Close the lens").click()


def test_every_widget_of_viser_has_the_name_beside_it(visitor: Visitor):
    for tab in TABS:
        show(visitor, tab)
        wait_for_names(visitor)
        wrong = visitor.page.evaluate(
            """() => [...document.querySelectorAll('[role=slider], .mantine-Flex-root input')].filter(widget => {
                const labels = [...(widget.labels ?? [])].map(label => label.textContent.trim());
                const name = widget.getAttribute('aria-label') ?? labels.find(Boolean);
                const beside = [];
                for (let row = widget.parentElement; row && !row.matches('.mantine-Paper-root'); row = row.parentElement)
                    if (row.matches('.mantine-Flex-root')) beside.push(row.textContent.trim());
                return widget.offsetParent && (!name || !beside.some(words => words.startsWith(name)));
            }).map(widget => widget.outerHTML.slice(0, 200))"""
        )
        assert wrong == [], tab
