"""Stages: the parts of a run, each with its terms, its sweeps and iterations.

A sweep begins with new associations: which photos see a face, which face a point belongs to, which edges follow an axis. Its
iterations solve with these. Every iteration is one recorded step.
"""

from dataclasses import dataclass, replace
from typing import Literal

from fairing.stage_kind import StageKind
from fairing.terms.points import GATES, NEAR_GATES

PASSES = 5  # of the normal filter
AXES_ITERATIONS = 3  # more hardly move anything (ledger: iterations of the axes)
ROUNDS = 4  # of broad relations, each within half the error of the one before, and of closest points (ledger: choice of the fit)


@dataclass(frozen=True)
class Stage:
    """A stage.

    Attributes:
        kind: recorded with its steps.
        max_sweeps: largest number of sweeps.
        max_iterations: largest number of iterations of a block within a sweep.
        first_sweep: number of its first sweep within its level; no two stages of a level share one.
    """

    kind: StageKind
    max_sweeps: int = 1
    max_iterations: int = 1
    first_sweep: int = 0

    def has(self, sweep: int) -> bool:
        """Whether a sweep of the level belongs to it."""
        return self.first_sweep <= sweep < self.first_sweep + self.max_sweeps


@dataclass(frozen=True)
class Photos(Stage):
    """Gauss-Newton sweeps of the photos and the terms beside them.

    Attributes:
        tolerance: the stage ends after a sweep that moves no vertex by as much as this, px.
    """

    kind: StageKind = StageKind.PHOTOS
    tolerance: float = 0.0


@dataclass(frozen=True)
class Smoothing(Stage):
    """Passes of the normal filter over a noisy start."""

    kind: StageKind = StageKind.SMOOTHNESS
    max_iterations: int = PASSES


@dataclass(frozen=True)
class PointGates(Stage):
    """Sparse points at narrowing gates.

    Attributes:
        gates: of its sweeps, percent of the diagonal.
        surface: number of the search for points near the mesh with which it begins, from 0; None: sparse points alone.
        is_wanted: whether the search takes place whatever the start is like.
    """

    gates: tuple[float, ...] = ()
    surface: int | None = None
    is_wanted: bool = False


@dataclass(frozen=True)
class Axes(Stage):
    """Relations to the axes of a building.

    Attributes:
        is_broad: whether they are sought as far as vertices that points do not determine may be off.
    """

    kind: StageKind = StageKind.AXES
    max_iterations: int = AXES_ITERATIONS
    is_broad: bool = False


@dataclass(frozen=True)
class ClosestPoints(Stage):
    """Every point at its closest face.

    Attributes:
        follows_axes: whether it is there because the axes moved vertices; other meshes leave it out.
    """

    kind: StageKind = StageKind.CLOSEST_POINTS
    follows_axes: bool = False


@dataclass(frozen=True)
class Judge(Stage):
    """One step that keeps what stages did, or goes back.

    Attributes:
        by: "points": held-out points, after the gates of the sparse points; "photos": after smoothing or a fit; "end": energy and
            held-out points, after the last sweeps. All or nothing.
    """

    kind: StageKind = StageKind.JUDGE
    by: Literal["points", "photos", "end"] = "photos"


def fit_stages(has_photos_of_points: bool) -> tuple[Stage, ...]:
    """The fit to sparse points.

    The gates reach farther than closest points and leave out clutter; closest points go on from there (ledger: choice of the
    fit). Broad relations bring points to faces they could not belong to before (ledger: broad relations).

    Args:
        has_photos_of_points: whether it is known which photos show the points.
    """
    axes, broad = Axes(), Axes(max_sweeps=ROUNDS, is_broad=True)
    stages: list[Stage] = []
    if has_photos_of_points:
        stages += [PointGates(StageKind.POINTS, len(GATES), gates=GATES), Judge(by="points"), axes]
        for number in range(2):  # each allows for half the error of the one before (ledger: surface sweep)
            stages += [PointGates(StageKind.SURFACE_POINTS, len(NEAR_GATES), gates=NEAR_GATES, surface=number), axes]
    rounds = ROUNDS if has_photos_of_points else 3 * ROUNDS
    stages += [ClosestPoints(max_sweeps=rounds), broad, ClosestPoints(follows_axes=True), broad]
    return (*stages, Judge())


def numbered(stages: tuple[Stage, ...], first_sweep: int) -> tuple[Stage, ...]:
    """The stages with the numbers of their sweeps, one after the other."""
    result = []
    for stage in stages:
        result.append(replace(stage, first_sweep=first_sweep))
        first_sweep += stage.max_sweeps
    return tuple(result)
