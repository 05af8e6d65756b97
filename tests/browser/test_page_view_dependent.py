"""The texture that follows the eye, in a real browser."""

import numpy as np
import pytest

from tests.browser.driver import IN_BROWSER, Visitor, page_of
from tests.two_levels import two_levels
from tests.waiting import wait_for

pytestmark = IN_BROWSER

OPTIONS = two_levels("joint", sweeps=1, iterations=3)


@pytest.fixture(autouse=True)
def layers(visitor: Visitor):
    visitor.page.get_by_role("tab", name="Layers").click()


def texture_in_sight(visitor: Visitor) -> tuple[str, np.ndarray] | None:
    """The name of the visible painted mesh and its texture, made small (32, 32, 3)."""
    found = visitor.page.evaluate(
        """() => {
            for (const name of ['view_dependent', 'textured_now']) for (const side of ['a', 'b']) {
                const node = window.__viserMutable.nodeRefFromName[`/mesh/${name}_${side}`];
                let image = null, seen = Boolean(node);
                node?.traverse?.(part => { image = image ?? part.material?.map?.image ?? null; });
                for (let at = node; at; at = at.parent) seen = seen && at.visible;
                if (!seen || !image) continue;
                const canvas = document.createElement('canvas');
                canvas.width = canvas.height = 32;
                const context = canvas.getContext('2d');
                context.drawImage(image, 0, 0, 32, 32);
                return {name, pixels: Array.from(context.getImageData(0, 0, 32, 32).data)};
            }
            return null;
        }"""
    )
    if found is None:
        return None
    return found["name"], np.array(found["pixels"], dtype=float).reshape(32, 32, 4)[..., :3]


def sees(visitor: Visitor, name: str) -> np.ndarray:
    """Wait for a painted mesh of that name; its texture."""
    found: list[tuple[str, np.ndarray] | None] = []

    def is_there() -> bool:
        found.append(texture_in_sight(visitor))
        return found[-1] is not None and found[-1][0] == name

    wait_for(is_there)
    assert found[-1] is not None
    return found[-1][1]


def look_from(visitor: Visitor, view_id: int) -> None:
    page = page_of(visitor.app)
    page._client.camera.position = visitor.app.resources.stage.camera_centers[view_id]


def test_the_texture_follows_the_eye_until_it_is_switched_off(visitor: Visitor):
    static = sees(visitor, "textured_now")
    visitor.button("Texture: View-dependent").click()
    first = sees(visitor, "view_dependent")
    look_from(visitor, 0)
    wait_for(lambda: np.abs(sees(visitor, "view_dependent") - first).max() > 2)
    visitor.page.keyboard.press("-")
    assert np.array_equal(sees(visitor, "textured_now"), static)
    look_from(visitor, 3)
    visitor.page.keyboard.press("-")
    sees(visitor, "view_dependent")
    visitor.button("Texture: Static").click()
    assert np.array_equal(sees(visitor, "textured_now"), static)
    assert visitor.troubles == []


def test_a_step_shows_the_static_texture_until_the_new_shape_is_painted(visitor: Visitor):
    visitor.button("Texture: View-dependent").click()
    sees(visitor, "view_dependent")
    before = visitor.app.controller.state.vertices
    assert visitor.press("Step one iteration").vertices is not before
    sees(visitor, "view_dependent")
    view_dependent = page_of(visitor.app).layers.surface._view_dependent
    now = visitor.app.controller.state.vertices
    wait_for(lambda: getattr(view_dependent.turns.shown, "vertices", None) is now)
    visitor.button("Texture: Static").click()
    sees(visitor, "textured_now")
    assert visitor.troubles == []
