"""Page updates: a page that blocks, raises or ends its thread holds up nobody else; pages that have gone leave nothing."""

import threading
import weakref
from collections.abc import Iterator
from dataclasses import replace

import pytest

from app.debugger.commands import Extent, Forward, JumpTo
from app.debugger.controller import Controller
from app.debugger.run_state import Activity, RunState
from app.page.page import Page
from app.page.page_updates import PageUpdates
from app.page.server import App, start
from app.page_state.selection import Selection
from fairing.run.session import Session
from tests.commands import do
from tests.raw_client import RawClient
from tests.small_scene import FACES, corner_scene, small_options
from tests.waiting import wait_for

# A page is still being built when its client has gone.
pytestmark = pytest.mark.filterwarnings("ignore:Queued a .* on a closed connection")


@pytest.fixture
def state() -> Iterator[RunState]:
    controller = Controller(Session(corner_scene(), small_options()))
    yield controller.state
    controller.close()


@pytest.fixture
def app() -> Iterator[App]:
    app = start(Session(corner_scene(), small_options()), port=0)
    yield app
    app.stop()


def test_only_the_newest_state_waits(state: RunState):
    release, entered, shown = threading.Event(), threading.Event(), []

    def show(state: RunState) -> None:
        shown.append(state.serial)
        entered.set()
        release.wait(60)

    updates = PageUpdates(show)
    updates.put(state)
    assert entered.wait(60)
    for serial in range(100, 1100):
        updates.put(replace(state, serial=serial))
    release.set()
    wait_for(lambda: len(shown) == 2, 60)
    assert shown == [state.serial, 1099]
    updates.close()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
@pytest.mark.parametrize("error", [ValueError("a panel is broken"), SystemExit("the thread ends")])
def test_a_page_that_raises_shows_the_next_state(state: RunState, error: BaseException):
    shown: list[int] = []

    def show(state: RunState) -> None:
        shown.append(state.serial)
        if state.serial == 1:
            raise error

    updates = PageUpdates(show)
    updates.put(replace(state, serial=1))
    wait_for(lambda: shown == [1], 60)
    wait_for(lambda: updates._worker.is_dead or updates._worker.busy_seconds == 0, 60)
    updates.put(replace(state, serial=2))
    wait_for(lambda: shown == [1, 2], 60)
    updates.close()


def test_a_page_that_is_stuck_gets_another_thread(state: RunState):
    release, shown = threading.Event(), []

    def show(state: RunState) -> None:
        shown.append(state.serial)
        if state.serial == 1:
            release.wait(60)

    updates = PageUpdates(show, stuck_seconds=0.05)
    updates.put(replace(state, serial=1))
    wait_for(lambda: updates._worker.busy_seconds > 0.05, 60)
    updates.put(replace(state, serial=2))
    wait_for(lambda: shown == [1, 2], 60)
    release.set()
    updates.close()


def test_a_blocked_page_holds_neither_the_engine_nor_other_pages(app: App, monkeypatch: pytest.MonkeyPatch):
    release, blocked, shown = threading.Event(), [], {}
    fill = Page.fill

    def fill_or_block(page: Page, state: RunState) -> None:
        fill(page, state)
        shown.setdefault(id(page), []).append(state.moment)
        if blocked and page is blocked[0]:
            release.wait(120)

    monkeypatch.setattr(Page, "fill", fill_or_block)
    with RawClient(app.port) as first, RawClient(app.port) as second:
        first.announce()
        wait_for(lambda: len(app.pages) == 1)
        second.announce()
        wait_for(lambda: len(app.pages) == 2)
        stuck, free = app.pages.values()
        blocked.append(stuck)
        try:
            for _ in range(5):
                moment = do(app.controller, Forward(Extent.ITERATION)).moment
                wait_for(lambda moment=moment: shown[id(free)][-1] == moment, 60)
            assert app.controller.state.incident is None
        finally:
            release.set()
        wait_for(lambda: shown[id(stuck)][-1] == moment, 60)


def test_pages_that_have_gone_are_freed_with_their_threads(app: App):
    def visit() -> list[weakref.ref[Page]]:
        with RawClient(app.port) as client:
            client.announce()
            wait_for(lambda: len(app.pages) == 1)
            found = [weakref.ref(page) for page in app.pages.values()]
            do(app.controller, JumpTo(0))
        wait_for(lambda: not app.pages)
        return found

    visit()
    wait_for(lambda: "page" not in names_of_threads())
    before = len(app.controller._publisher._listeners)
    *pages, _ = [ref for _ in range(5) for ref in visit()]  # the server holds the last connection until the next one
    wait_for(lambda: not any(ref() for ref in pages), 60)
    wait_for(lambda: not {"page", "prediction"} & names_of_threads(), 60)
    assert len(app.controller._publisher._listeners) == before


@pytest.mark.parametrize("activity", [Activity.RUNNING, Activity.PLAYING])
def test_the_face_of_a_vertex_just_selected_is_chosen_when_the_vertices_rest(app: App, activity: Activity):
    with RawClient(app.port) as client:
        client.announce()
        wait_for(lambda: len(app.pages) == 1)
        (page,) = app.pages.values()
        # Nothing but this test shows states to the page from here on.
        wait_for(lambda: page._updates is not None)
        updates = page._updates
        assert updates is not None
        updates.close()
        wait_for(lambda: updates._worker.busy_seconds == 0)
        state = do(app.controller, Forward(Extent.ITERATION))
        known = app.resources.residuals

        def is_measured() -> bool:
            known.follow(state)
            return known.of(state).up_to(state.moment) is not None

        wait_for(is_measured)
        page.page_state.selection, page.page_state.picks_face = Selection((0,)), True
        page.fill(replace(state, activity=activity))
        assert page.page_state.face is None, "its cells are not computed while vertices move"
        assert page.page_state.picks_face
        page.fill(state)
        found = known.of(state).up_to(state.moment)
        assert found is not None
        losses = known.of(state).by_moment[found[0]].loss_by_face()
        ring = [face for face in range(len(FACES)) if 0 in FACES[face]]
        assert page.page_state.face == max(ring, key=lambda face: losses[face])
        assert not page.page_state.picks_face


def names_of_threads() -> set[str]:
    return {thread.name for thread in threading.enumerate()}
