"""Painting on a thread of its own."""

import threading

import numpy as np

from app.pictures.texturer import Painter, TexturedMesh


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
