"""Sessions on the corner whose cells an oracle can compute: one level, no masks, known sample points."""

import numpy as np

from fairing.judge.inspect import face_cells
from fairing.options import FairingOptions
from fairing.run.session import Session, SweepState
from tests.small_scene import corner_scene, small_options

FACE_IDS = np.arange(6)
ALL_CORNERS = np.full(6, -1)


def prepared(options: FairingOptions, masks: bool = False, **scene) -> tuple[Session, SweepState]:
    """A session at its start; without masks every sample of every cell counts."""
    session = Session(corner_scene(**scene), options)
    sweep = session.sweep_state()
    if not masks:
        sweep.context.kernel.pair_mask[:] = -1
        object.__setattr__(sweep, "system", None)  # it was computed with the masks
    return session, sweep


def sharp_options(**changes) -> FairingOptions:
    """One level without sub-pixel blur, all cells weighing the same: what the oracles below compute."""
    stages = {
        "schedule": {"blur": [1.0]},
        "cells": {"weighting": "cell", "inset": [0.5], "size": [32]},
        "robust": {"norm": "least_squares"},
    }
    for name, value in changes.items():
        stages[name] = stages.get(name, {}) | value
    return small_options(**stages)


def sample_points(session: Session, sweep: SweepState, face: int) -> np.ndarray:
    """(p, 3) float: barycentric weights of the samples of a cell, computed anew from the cell's definition."""
    size = face_cells(session, face).size
    inset = sweep.context.kernel.face_inset[face]
    rows, columns = np.nonzero(np.add.outer(np.arange(size), np.arange(size)) < size)
    a = inset + (1 - 3 * inset) * (columns + 1 / 3) / size
    b = inset + (1 - 3 * inset) * (rows + 1 / 3) / size
    return np.stack([a, b, 1 - a - b], axis=1)
