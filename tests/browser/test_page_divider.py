"""The divider between the start and now in the 3D view, in a real browser."""

import io

import cv2
import numpy as np
import pytest
from PIL import Image

from app.page.server import start
from app.page_state.page_state import NOW_SHAPE, START_SHAPE
from demo_scenes import load_demo
from fairing.run.session import Session
from tests.browser.driver import IN_BROWSER, Visitor, page_of
from tests.two_levels import two_levels
from tests.waiting import wait_for

pytestmark = IN_BROWSER

COLORFUL = 80  # grey levels between the channels of a pixel: the texture of the cube is, its plain surface is not
BLUR, DIFFERENT = 9, 25  # px, grey levels
STRIP = 40  # px beside the divider that belong to it and to its label


@pytest.fixture(scope="module")
def app():
    session = Session(load_demo("cube"), two_levels("joint", sweeps=2, iterations=4))
    session.run()
    app = start(session, port=0)
    yield app
    app.stop()


def view(visitor: Visitor) -> np.ndarray:
    """(h, w, 3) float: the part of the 3D view above the timeline, once it has come to rest."""
    taken: list[np.ndarray] = []

    def rests() -> bool:
        box = visitor.page.locator("canvas").first.bounding_box()
        assert box is not None
        clip = {"x": box["x"], "y": 160, "width": box["width"], "height": 340}
        picture = visitor.page.screenshot(clip=clip)  # pyright: ignore[reportArgumentType]
        taken.append(np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"), dtype=float))
        return len(taken) > 1 and np.array_equal(taken[-1], taken[-2])

    wait_for(rests)
    return taken[-1]


def is_like(seen: np.ndarray, one: np.ndarray, other: np.ndarray) -> bool:
    """Whether a view is one picture and not the other, where these differ. All are blurred: a busy browser draws fewer pixels."""
    seen, one, other = (cv2.blur(picture, (BLUR, BLUR)) for picture in (seen, one, other))
    differs = np.abs(one - other).max(axis=2) > DIFFERENT
    assert differs.sum() > 20
    return np.abs(seen - one)[differs].mean() < 0.5 * np.abs(seen - other)[differs].mean()


def shows(visitor: Visitor, shape: float) -> np.ndarray:
    """The view of the textured surface of a shape."""
    page = page_of(visitor.app)
    page.panels.surface_controls.choose_shape(shape)
    textured = page.layers.surface._textured
    wait_for(lambda: [each for each, turns in textured.items() if any(h.visible for h in turns._handles)] == [shape])
    visitor.page.wait_for_timeout(1000)  # the picture before that may be at rest, too
    wait_for(lambda: np.ptp(view(visitor), axis=2).max() > COLORFUL)
    return view(visitor)


def test_the_start_is_left_of_the_divider_and_now_right_of_it_wherever_it_is_dragged(visitor: Visitor):
    page, state = visitor.page, page_of(visitor.app).page_state
    state.surface, state.shown = "textured", dict.fromkeys(state.shown, False)
    before, now = shows(visitor, START_SHAPE), shows(visitor, NOW_SHAPE)
    page.get_by_role("tab", name="Layers").click()
    visitor.button("Before and now").first.click()
    divider = page.get_by_role("slider", name="before | now")
    divider.wait_for()

    def parts() -> tuple[np.ndarray, int]:
        """The view, and the column of the divider."""
        seen, left = view(visitor), visitor.box_of(page.locator("canvas").first)["x"]
        box = visitor.box_of(divider)
        return seen, round(box["x"] + box["width"] / 2 - left)

    def is_divided() -> bool:
        seen, at = parts()
        left, right = np.s_[:, : at - STRIP], np.s_[:, at + STRIP :]
        return is_like(seen[left], before[left], now[left]) and is_like(seen[right], now[right], before[right])

    wait_for(is_divided)
    order = "() => ['overlay', 'divider'].map(name => getComputedStyle(document.getElementById(`eigenfairing-${name}`)).zIndex)"
    assert page.evaluate(order) == ["1", "auto"], "the divider passes behind the legend"
    _, first = parts()
    box = visitor.box_of(divider)
    page.mouse.move(box["x"] + box["width"] / 2, 300)
    page.mouse.down()
    page.mouse.move(box["x"] - 40, 300, steps=3)
    page.mouse.up()
    wait_for(lambda: parts()[1] < first - 30)
    assert is_divided()
    divider.press("ArrowRight")
    wait_for(is_divided)
    page_of(visitor.app).panels.surface_controls.choose_shape(START_SHAPE)
    divider.wait_for(state="detached")
    wait_for(lambda: is_like(view(visitor), before, now))
