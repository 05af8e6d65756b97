"""The corner with every vertex off its true position, and options whose plan reads all photos."""

from dataclasses import replace

import numpy as np

from fairing.options import FairingOptions
from fairing.scene import Scene
from tests.small_scene import corner_scene, small_options

SHARP_AT_LAST = {"cells": {"point_spread": ["as_seen", "common"], "interpolation": ["bilinear", "cubic"]}}


def rough_options(**changes) -> FairingOptions:
    """Two fine levels, after smoothing if the photos accept it."""
    schedule = {"blur": [1.2, 0.6], "first_level": "first"}
    return small_options(
        schedule=schedule | changes.pop("schedule", {}),
        step={"smoothing": [0.1] * 2} | changes.pop("step", {}),
        **changes,
    )


def rough_scene() -> Scene:
    """Every vertex about 4 px off its place, corner A 10 px."""
    scene = corner_scene((0.11, -0.09, 0.09))
    noise = 0.05 * np.random.default_rng(2).standard_normal((7, 3)) * (np.arange(7) > 0)[:, None]
    return replace(scene, mesh=scene.mesh.moved(scene.mesh.vertices + noise))
