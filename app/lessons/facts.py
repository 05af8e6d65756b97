"""Lesson facts: the quantities available in a lesson's numbers and claims, in addition to those of conditions."""

from collections.abc import Callable, Mapping
from functools import cache
from typing import SupportsFloat

import numpy as np

from app.debugger import quantities
from app.debugger.condition import Condition, Quantities
from app.debugger.quantities import StepContext, quantities_of
from fairing.errors import InputError
from fairing.judge.certainty import Certainty, certainties
from fairing.judge.inspect import FaceCells, energies_by_dimension, face_cells
from fairing.run.session import Session

NAN = float("nan")
OF_MOMENT: dict[str, str] = {
    "photos": "photos of the scene",
    "faces": "faces of the mesh",
    "steps": "steps of the engine from the start",
    "ended": "1 if the run has finished its schedule",
    "rises": "number of accepted steps that raised their own objective",
    "cells": "number of cells of the face shown",
    "k": "dimensions of its eigenspace",
    "rms": "root mean square of its residuals, grey levels",
    "outlier_from": "outlier threshold e_T, grey levels",
    "outlying": "share of its samples beyond the outlier threshold, percent",
    "lightest": "smallest robust weight of its samples, percent of the largest",
}
OF_ONE: dict[str, str] = {
    "off": "distance of a vertex from its true position, hundredths of a world unit (cube: % of its edge)",
    "off_px": "the largest such distance in any photo, pixels",
    "off_x": "signed error of a vertex along x, hundredths of a world unit",
    "off_y": "the same along y",
    "off_z": "the same along z",
    "long": "longest over shortest axis of the certainty ellipsoid of a vertex",
    "share": "share of the squares of the shown face's cells in its first k dimensions, percent",
    "left_by": "energy of the shown face with k dimensions",
}
VALUES = quantities.VALUES | OF_MOMENT
FUNCTIONS = quantities.FUNCTIONS | OF_ONE


def facts_of(session: Session, face: int | None, kept: Mapping[str, float]) -> Quantities:
    """Quantities at the session's current moment, computed on access.

    Args:
        face: the face whose cells are shown; without it, quantities of a face are NaN.
        kept: numbers kept by earlier steps of the lesson.
    """
    moment, scene = session.moment, session.scene
    steps = session.trace.steps[:moment]
    engines = [step for step in steps if not step.is_manual]
    if moment:
        recorded = quantities_of(steps[-1], moment, StepContext(session, session.trace.start))
        values, functions = dict(recorded.values), dict(recorded.functions)
    else:
        values: dict[str, Callable[[], float]] = dict.fromkeys(quantities.VALUES, lambda: NAN)
        functions: dict[str, Callable[[float], float]] = dict.fromkeys(quantities.FUNCTIONS, lambda _: NAN)
        functions["abs"] = abs

    @cache
    def cells() -> FaceCells | None:
        return None if face is None else face_cells(session, face)

    @cache
    def certainty(vertex: int) -> Certainty:
        return certainties(session, np.array([vertex]))[0]

    def of_cells(measure: Callable[[FaceCells], SupportsFloat]) -> Callable[[], float]:
        return lambda: NAN if (found := cells()) is None or not found.takes_part else float(measure(found))

    def of_vertex(measure: Callable[[int], SupportsFloat]) -> Callable[[float], float]:
        return lambda vertex: float(measure(int(vertex))) if vertex in range(len(scene.mesh.vertices)) else NAN

    def error(vertex: int) -> np.ndarray:
        known = None if scene.truth is None else scene.truth.vertices
        return np.full(3, NAN) if known is None else 100 * (session.vertices[vertex] - known[vertex])

    values |= {
        "photos": lambda: len(scene.views),
        "faces": lambda: len(scene.mesh.faces),
        "steps": lambda: len(engines),
        "ended": lambda: float(session.finished),
        "rises": lambda: sum(step.accepted and step.objective_after > step.objective_before for step in engines),
        "cells": of_cells(lambda found: len(found.views)),
        "k": of_cells(lambda found: len(found.basis)),
        "rms": of_cells(lambda found: np.sqrt(np.mean(found.residual[found.counts].astype(float) ** 2))),
        "outlier_from": of_cells(lambda found: found.outlier_threshold),
        "outlying": of_cells(
            lambda found: 100 * np.mean(np.abs(found.residual[found.counts]) > found.outlier_threshold)
        ),
        "lightest": of_cells(lambda found: 100 * found.weights[found.counts].min() / found.weights.max()),
    }
    functions |= {
        "off": of_vertex(lambda vertex: np.linalg.norm(error(vertex))),
        "off_px": of_vertex(lambda vertex: _pixels_off(session, vertex)),
        "off_x": of_vertex(lambda vertex: error(vertex)[0]),
        "off_y": of_vertex(lambda vertex: error(vertex)[1]),
        "off_z": of_vertex(lambda vertex: error(vertex)[2]),
        "long": of_vertex(lambda vertex: certainty(vertex).lengths[2]),
        "share": lambda k: of_cells(lambda found: 100 * _share(found, k))(),
        "left_by": lambda k: of_cells(lambda found: _energy_with(session, found.face, k))(),
    }
    kept_values = {name: (lambda value=value: value) for name, value in kept.items()}
    return Quantities(values | kept_values, functions)


def values_used(condition: Condition, facts: Quantities) -> dict[str, float]:
    """The quantities that occur in a condition, such as `off(0)`, with their values."""
    used: dict[str, float] = {}

    def noted(name: str, value: float) -> float:
        used[name] = value
        return value

    values = {name: (lambda n=name, f=compute: noted(n, f())) for name, compute in facts.values.items()}
    functions = {
        name: compute
        if name == "abs"
        else (lambda *x, n=name, f=compute: noted(f"{n}({', '.join(map(_written, x))})", f(*x)))
        for name, compute in facts.functions.items()
    }
    condition.evaluate(Quantities(values, functions))
    return used


def _written(argument: str | float) -> str:
    return argument if isinstance(argument, str) else f"{argument:g}"


def _share(found: FaceCells, k: float) -> float:
    power = found.singular_values**2
    return float(power[: int(k)].sum() / power.sum()) if 1 <= k <= len(power) else NAN


def _energy_with(session: Session, face: int, k: float) -> float:
    try:
        energies = energies_by_dimension(session, face)
    except InputError:
        return NAN
    return float(energies[int(k) - 1]) if 1 <= k <= len(energies) else NAN


def _pixels_off(session: Session, vertex: int) -> float:
    scene = session.scene
    if scene.truth is None or scene.truth.vertices is None:
        return NAN
    pair = np.stack([session.vertices[vertex], scene.truth.vertices[vertex]])
    found = [view.camera.project(pair) for view in scene.views]
    return max((float(np.linalg.norm(uv[1] - uv[0])) for uv, depth in found if (depth > 0).all()), default=NAN)
