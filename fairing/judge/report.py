"""Run report: the contents of `report.json`, and energies sweep by sweep."""

import platform
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from types import MappingProxyType
from typing import Any

import numpy as np

from fairing.cells.context import CellContext
from fairing.cells.visibility import Visibility
from fairing.norms.built_in import OWN
from fairing.options import options_to_dict
from fairing.run.own_plan import OWN_PLAN
from fairing.run.recorded_stages import recorded_stages
from fairing.run.session import Session
from fairing.run.trace_header import REFINEMENT
from fairing.stage_kind import StageKind
from fairing.trace import StepReason, StepRecord, Trace
from fairing.trace_check import TERM_FACTS

PACKAGES = ("eigenfairing", "numpy", "scipy", "numba", "opencv-python-headless", "trimesh")


@dataclass
class SweepEnergy:
    """Energy of the faces that a sweep touched, with the visibility and robust scale of that sweep.

    Energies of different sweeps are not comparable, because visibility and scale differ; before and after of one sweep are.

    Attributes:
        level, sweep: position in the schedule.
        before, after: sums over faces.
        steps, accepted: iterations, and vertex moves accepted in them.
        longest_step_px: longest accepted move of a vertex in any photo, px.
    """

    level: int
    sweep: int
    before: float = 0.0
    after: float = 0.0
    steps: int = 0
    accepted: int = 0
    longest_step_px: float = 0.0


class EnergyTally:
    """Accumulates the energies of a run, step by step."""

    def __init__(self, n_faces: int) -> None:
        self.sweeps: list[SweepEnergy] = []
        self._before = np.zeros(n_faces)
        self._after = np.zeros(n_faces)
        self._touched = np.zeros(n_faces, dtype=bool)

    def add(self, record: StepRecord) -> SweepEnergy | None:
        """Add one step; returns the current energies of its sweep, or None for a step that belongs to no sweep of the photos:
        fits use no photos, and what judges them uses other cells."""
        level, sweep = record.position[:2]
        is_new = not self.sweeps or (self.sweeps[-1].level, self.sweeps[-1].sweep) != (level, sweep)
        if record.stage.is_fit or record.stage is StageKind.FIT or (is_new and record.stage is StageKind.JUDGE):
            return None
        if is_new:
            self.sweeps.append(SweepEnergy(level, sweep))
            self._touched[:] = False
            self._before[:] = 0
            self._after[:] = 0
        new = ~self._touched[record.faces]
        self._before[record.faces[new]] = record.face_energy_before[new]
        self._touched[record.faces] = True
        self._after[record.faces] = record.face_energy_after
        current = self.sweeps[-1]
        moved = (record.before != record.after).any(axis=1)
        current.before, current.after = float(self._before.sum()), float(self._after.sum())
        current.steps += 1
        current.accepted += int(moved.sum())
        current.longest_step_px = max(current.longest_step_px, float(record.step_px[moved].max(initial=0)))
        return current


def sweep_energies(trace: Trace) -> list[SweepEnergy]:
    """Energy before and after every sweep of a run."""
    tally = EnergyTally(len(trace.faces))
    for record in trace.steps:
        tally.add(record)
    return tally.sweeps


def run_report(
    session: Session,
    preset: str,
    seconds: dict[str, float],
    quality: dict[str, Any],
    residuals: Mapping[int, float] = MappingProxyType({}),
) -> dict[str, Any]:
    """The report of a run, ready for JSON.

    Args:
        preset: name of the preset that the options started from.
        seconds: time spent outside the session, by stage (loading, for example).
        quality: from `fairing.judge.metrics.quality_report`.
        residuals: comparable residuals by moment, grey levels, see `fairing.judge.comparable_residual`; those of the ends of
            stages are reported.
    """
    own = dict(session.seconds)
    # For a run stopped between two sweeps, preparing the next one only for this report could take minutes.
    sweep = session.sweep_state() if session.finished else session.latest_sweep
    context = sweep.context if sweep else None
    computing = max(own["steps"] - own["photos"] - own["visibility"], 1e-9)
    stages = seconds | {"photos": own["photos"], "visibility": own["visibility"], "steps": computing}
    return {
        "format": "eigenfairing report 1",
        "preset": preset,
        "options": options_to_dict(session.options),
        "own": _own(session),
        "versions": versions(),
        "scene": _scene_facts(session),
        "cameras": _cameras(session.trace),
        "residual": {when: residuals.get(moment) for when, moment in (("before", 0), ("after", session.moment))},
        "stages": _stages(session.trace, residuals),
        "stop_reason": session.stop_reason,
        "finished": session.finished,
        "seconds": {"total": sum(stages.values())} | stages,
        "samples": session.samples,
        "samples_per_second": session.samples / computing,
        "sweeps": [
            vars(sweep) | {"blur_px": session.options.levels[sweep.level].blur}
            for sweep in sweep_energies(session.trace)
        ],
        "skipped": _skipped(session, context),
        "warnings": list(session.warnings),
        "quality": quality,
        "vertices": _vertices(session, context),
    }


def _own(session: Session) -> dict[str, Any]:
    """What the run has beside the options: terms, norm and plan of its user's own."""
    norm = session.norm if session.options.robust.norm == OWN else None
    return {
        "terms": [{fact: getattr(term, fact) for fact in TERM_FACTS} for term in session.terms],
        "norm": None if norm is None else {fact: getattr(norm, fact) for fact in TERM_FACTS},
        "plan": session.trace.header.get(OWN_PLAN, []),
    }


def versions() -> dict[str, str | None]:
    """Versions of Python, of this package and of the packages that results depend on; None if not installed as a package."""
    return {"python": platform.python_version()} | {name: _version(name) for name in PACKAGES}


def _version(package: str) -> str | None:
    """None for a package that runs from its source folder."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _stages(trace: Trace, residuals: Mapping[int, float]) -> list[dict[str, Any]]:
    """Kind, level and steps of every stage, the residual after it if it is known, and of a fit its objective, which stands for
    the associations of its sweep: `objective_left` is the product of what each step left of it."""
    stages = []
    for stage in recorded_stages(trace):
        steps = trace.steps[stage.begin : stage.end]
        entry: dict[str, Any] = {"kind": stage.kind.name.lower(), "level": stage.level, "steps": len(steps)}
        if stage.end in residuals:
            entry["residual"] = residuals[stage.end]
        if stage.kind.is_fit:
            left = [step.objective_after / step.objective_before for step in steps if step.objective_before > 0]
            entry |= {
                "objective_before": steps[0].objective_before,
                "objective_after": steps[-1].objective_after,
                "objective_left": float(np.prod(left)),
            }
        stages.append(entry)
    return stages


def _cameras(trace: Trace) -> dict[str, Any] | None:
    """What refinement of the cameras found; None without refinement."""
    refinement = trace.header.get(REFINEMENT)
    return refinement and {name: value for name, value in refinement.items() if name != "iterations"}


def _scene_facts(session: Session) -> dict[str, Any]:
    scene = session.scene
    return {
        "name": scene.name,
        "input_vertices": len(scene.original_from_welded),
        "vertices": len(scene.mesh.vertices),
        "faces": len(scene.mesh.faces),
        "diagonal": scene.mesh.diagonal,
        "photos": [
            {"name": view.name, "width": view.camera.width, "height": view.camera.height} for view in scene.views
        ],
        "sparse_points": None if scene.sparse_points is None else len(scene.sparse_points.positions),
        "truth_known": scene.truth is not None,
    }


def _skipped(session: Session, context: CellContext | None) -> dict[str, Any]:
    """Faces and vertices that took no part at the last level, with reasons; empty for `context` None (no sweep has begun).

    Faces are counted as in the input.
    """
    if context is None:
        return {"faces": [], "faces_with_fewer_dimensions": [], "vertices": []}
    scene = session.scene
    number, n_views = scene.input_faces, len(scene.views)
    without_area = np.setdiff1d(np.arange(len(scene.original_faces)), number)
    requested = session.options.levels[context.level].dimensions
    takes_part = context.takes_part
    out = np.flatnonzero(~takes_part)
    lowered = np.flatnonzero(takes_part & (context.kernel.face_dimensions < requested))
    return {
        "faces": [
            {"face": int(number[face]), "views": int(context.n_views[face]), "reasons": _reasons(context.reasons[face])}
            for face in out
        ]
        + [
            {"face": int(face), "views": 0, "reasons": {Visibility.DEGENERATE.name.lower(): n_views}}
            for face in without_area
        ],
        "faces_with_fewer_dimensions": [
            {
                "face": int(number[face]),
                "views": int(context.n_views[face]),
                "k": int(context.kernel.face_dimensions[face]),
            }
            for face in lowered
        ],
        "vertices": [
            {"vertex": vertex, "reason": _reason_not_moved(session, takes_part, vertex)}
            for vertex in np.flatnonzero(~_was_tried(session.trace)).tolist()
        ],
    }


def _reasons(codes: np.ndarray) -> dict[str, int]:
    values, counts = np.unique(codes, return_counts=True)
    return {Visibility(value).name.lower(): int(count) for value, count in zip(values, counts, strict=True)}


def _was_tried(trace: Trace) -> np.ndarray:
    tried = np.zeros(len(trace.start), dtype=bool)
    for record in trace.steps:
        tried[record.vertices] = True
    return tried


def _reason_not_moved(session: Session, takes_part: np.ndarray, vertex: int) -> str:
    """Why a vertex did not move; takes_part: (m,) bool, faces at the last level."""
    if session.locked[vertex]:
        return StepReason.LOCKED.text
    faces = session.scene.mesh.one_rings[vertex]
    if not takes_part[faces].any():
        return StepReason.UNSEEN.text
    return "not reached" if not session.finished else StepReason.UNSEEN.text


def _vertices(session: Session, context: CellContext | None) -> list[dict[str, Any]]:
    """Every welded vertex, with the indices of its copies in the input."""
    n = len(session.scene.mesh.vertices)
    takes_part = context.takes_part if context else np.ones(len(session.scene.mesh.faces), dtype=bool)
    views = context.vertex_views.sum(axis=1) if context else np.zeros(n, dtype=int)
    last_reason = np.full(n, -1)
    eigenvalues = np.full((n, 3), np.nan)
    for record in session.trace.steps:
        returned = record.reasons == StepReason.RETURNED
        eigenvalues[record.vertices[~returned]] = record.eigenvalues[~returned]
        last_reason[record.vertices] = record.reasons
    order = np.argsort(session.scene.original_from_welded, kind="stable")
    copies = np.split(order, np.cumsum(np.bincount(session.scene.original_from_welded, minlength=n))[:-1])
    start, end = session.trace.start, session.vertices
    moved = np.linalg.norm(end - start, axis=1)
    return [
        {
            "input_vertices": copies[v].tolist(),
            "start": start[v].tolist(),
            "end": end[v].tolist(),
            "moved": float(moved[v]),
            "views": int(views[v]),
            "eigenvalues": None if np.isnan(eigenvalues[v]).any() else eigenvalues[v].tolist(),
            "stop_reason": StepReason(last_reason[v]).text
            if last_reason[v] >= 0
            else _reason_not_moved(session, takes_part, v),
        }
        for v in range(n)
    ]
