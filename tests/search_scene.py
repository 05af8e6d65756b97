"""The corner with every vertex off its true position, and options with a local search at each level."""

from dataclasses import replace

import numpy as np

from fairing.options import FairingOptions
from fairing.scene import Scene
from tests.small_scene import corner_scene, small_options

SHARP_AT_LAST = {"cells": {"point_spread": ["as_seen", "common"], "interpolation": ["bilinear", "cubic"]}}


def searching(start_error: float, **changes) -> FairingOptions:
    """Two fine levels, each searched first."""
    schedule = {"blur": [1.2, 0.6], "search": [1.0, 0.5], "start_error": start_error, "first_level": "first"}
    return small_options(schedule=schedule | changes.pop("schedule", {}), **changes)


def rough_scene() -> Scene:
    """Every vertex about 4 px off its place, corner A 10 px."""
    scene = corner_scene((0.11, -0.09, 0.09))
    noise = 0.05 * np.random.default_rng(2).standard_normal((7, 3)) * (np.arange(7) > 0)[:, None]
    return replace(scene, mesh=scene.mesh.moved(scene.mesh.vertices + noise))
