"""Layers and panels of other packages, in a real browser."""

import io
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.page.server import App, start
from demo_scenes import load_demo
from fairing.run.session import Session
from fairing.util.plugins import offered
from tests.browser.driver import IN_BROWSER, Visitor
from tests.installed_plugin import install_plugin
from tests.two_levels import two_levels
from tests.waiting import wait_for

pytestmark = IN_BROWSER
NORMALS = (235, 180, 48)
"""RGB of the normals as they are drawn, after tone mapping."""


@pytest.fixture(scope="module")
def app(tmp_path_factory):
    folder: Path = tmp_path_factory.mktemp("installed")
    install_plugin(folder)
    sys.path.insert(0, str(folder))
    offered.cache_clear()
    app = start(Session(load_demo("cube"), two_levels("joint", sweeps=1, iterations=2)), port=0)
    yield app
    app.stop()
    sys.path.remove(str(folder))
    offered.cache_clear()


def area(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def test_a_layer_draws_a_thin_line_for_each_face(visitor: Visitor):
    def drawn() -> int:
        picture = np.asarray(Image.open(io.BytesIO(visitor.page.screenshot())).convert("RGB"), dtype=int)
        return int((np.abs(picture - NORMALS).max(axis=-1) < 24).sum())

    wait_for(lambda: 60 < drawn() < 2_000, seconds=60)  # px: six lines, 20 px long and 2 px wide


def test_a_panel_and_a_layer_follow_the_run_and_what_they_raise_is_a_message(visitor: Visitor, app: App):
    page, faces = visitor.page, app.controller.scene.mesh.faces
    page.get_by_role("tab", name="Area").click()
    state = app.controller.state
    page.get_by_text(f"{area(state.vertices, faces):.6g}", exact=True).wait_for()
    state = visitor.press("Step one iteration")
    page.get_by_text(f"{area(state.vertices, faces):.6g}", exact=True).wait_for()
    import eigenfairing_example.area as module  # pyright: ignore[reportMissingImports]

    show, module.Area.show = module.Area.show, lambda *_: 1 / 0
    visitor.press("Step back one iteration")
    page.get_by_text("ZeroDivisionError").first.wait_for()
    module.Area.show = show
    state = visitor.press("Step one iteration")
    page.get_by_text(f"{area(state.vertices, faces):.6g}", exact=True).wait_for()
