"""Painting on a thread of its own."""

import threading

import numpy as np
import pytest

from app.pictures.texturer import Painter, TexturedMesh, Texturer
from app.stage import Stage
from demo_scenes import load_demo
from tests.waiting import wait_for


def test_what_cannot_be_painted_is_not_tried_again_until_the_shape_changes():
    calls: list[np.ndarray] = []
    ready = threading.Event()

    def paint(vertices: np.ndarray) -> TexturedMesh:
        calls.append(vertices)
        if len(calls) == 1:
            raise ValueError("too many faces")
        return TexturedMesh(vertices, b"")

    painter: Painter[TexturedMesh] = Painter(paint, 2, ready.set)
    bad, good = np.zeros((3, 3)), np.ones((3, 3))
    assert painter.painted(bad, bad) is None
    while painter._failed is not bad:
        threading.Event().wait(0.005)
    assert painter.painted(bad, bad) is None
    assert painter.painted(bad, good) is None
    assert ready.wait(20)
    found = painter.painted(bad, good)
    assert found is not None
    assert found.vertices is good
    assert [call is bad for call in calls] == [True, False]
    painter.close()


@pytest.mark.slow
def test_a_draft_has_the_same_mesh_a_smaller_texture_and_a_lower_cost():
    scene = load_demo("facade")
    ready = threading.Event()
    texturer = Texturer(scene, Stage.of(scene), ready.set, lambda: None)
    found: list[TexturedMesh] = []
    for _ in range(2):  # the first time, painting may have to be compiled
        vertices = scene.mesh.vertices.copy()
        found = [wait_until_painted(painter, vertices) for painter in (texturer.draft, texturer.static)]
    texturer.close()
    draft, whole = found
    assert len(draft.glb) < 0.3 * len(whole.glb)
    assert 0 < draft.cost < 0.6 * whole.cost


def wait_until_painted(painter: Painter[TexturedMesh], vertices: np.ndarray) -> TexturedMesh:
    wait_for(lambda: painter.painted(painter, vertices) is not None)
    found = painter.painted(painter, vertices)
    assert found is not None
    return found
