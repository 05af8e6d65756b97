"""Triangulation: from calibrated photos with sparse points, or with a mesh, to a mesh whose edges agree with the photos."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fairing.errors import Cancelled, InputError
from fairing.scene import Scene, SparsePoints, View
from fairing.solve.energy import Evaluator
from fairing.triangulation.face_splits import split_faces
from fairing.triangulation.flips import EdgeFlipper, FlipSummary
from fairing.triangulation.initial_mesh import StartMesh, start_mesh
from fairing.triangulation.options import TriangulationOptions
from fairing.triangulation.record import FlipTrace
from fairing.triangulation.split_record import SplitRound

SPLIT_SHARE = 0.5  # of the time, where faces are split


@dataclass(frozen=True, eq=False)
class Triangulation:
    """Result of `triangulate`.

    Attributes:
        scene: the photos with the mesh before any flip, after face splits.
        faces: (m, 3) int: the final faces, as vertex ids of `scene.mesh`.
        start: the initial mesh from sparse points; None if a mesh was given.
        trace: the rounds of face splits, as far as they were done, and the flips.
        summary: of the search.
    """

    scene: Scene
    faces: np.ndarray
    start: StartMesh | None
    trace: FlipTrace
    summary: FlipSummary

    def mesh(self) -> tuple[np.ndarray, np.ndarray]:
        """Vertices (n, 3) float, world units, and faces (m, 3) int, in the order of the given mesh unless faces were split."""
        scene = self.scene
        _, input_vertex = np.unique(scene.original_from_welded, return_index=True)
        flipped = (self.faces != scene.mesh.faces).any(axis=1)
        faces = scene.original_faces.copy()
        faces[scene.input_faces[flipped]] = input_vertex[self.faces[flipped]]
        return scene.unweld(scene.mesh.vertices), faces

    def result(self) -> Scene:
        """A scene of the photos and the final mesh."""
        vertices, faces = self.mesh()
        built = Scene.build(self.scene.name, vertices, faces, self.scene.views, sparse_points=self.scene.sparse_points)
        if self.start is None:
            return built
        used = self.start.n_points
        note = (
            f"no mesh was given: one of {len(vertices)} vertices was made from {used} of "
            f"{used + sum(self.start.left_out.values())} sparse points, {len(self.trace)} edges flipped; "
            "for details run `eigenfairing triangulate`"
        )
        return replace(built, triangulated=True, warnings=(note,))

    @property
    def vertices_of_splits(self) -> list[int]:
        """Number of vertices before face splits and after each round that split faces; empty without a round."""
        rounds = self.trace.splits
        return [len(done.vertices) for done in rounds[:1]] + [len(r.after) for r in rounds if r.is_split.any()]

    def report(self) -> dict[str, Any]:
        """Counts, energies and reasons for points left out, as plain values for JSON."""
        summary, start = self.summary, self.start
        return {
            "scene": self.scene.name,
            "options": self.trace.header.get("options"),
            "vertices": len(self.scene.mesh.vertices),
            "faces": len(self.faces),
            "points": None if start is None else start.n_points,
            "points_left_out": None if start is None else start.left_out,
            "vertices_of_splits": self.vertices_of_splits,
            "flips": len(self.trace),
            "rounds": summary.rounds,
            "stop_reason": summary.stop_reason,
            "energy": {"before": summary.energy_before, "after": summary.energy_after},
            "inconsistent_edges": {"before": summary.inconsistent_before, "after": summary.inconsistent_after},
            "edges_searched": {
                name: {verdict.name.lower(): count for verdict, count in verdicts.items()}
                for name, verdicts in zip(("first", "last"), summary.verdicts, strict=True)
            },
        }


def triangulate(
    name: str,
    views: tuple[View, ...],
    points: SparsePoints | None,
    options: TriangulationOptions | None = None,
    mesh: tuple[np.ndarray, np.ndarray] | None = None,
    record_to: Path | None = None,
    header: dict[str, Any] | None = None,
    should_stop: Callable[[], bool] = lambda: False,
    on_progress: Callable[[float, str], None] = lambda part, line: None,
) -> Triangulation:
    """Triangulate sparse points, or take a mesh, and flip edges until no flip makes the photos agree better.

    Before it faces are split, if `TriangulationOptions.splits` asks for it.

    Args:
        name: of the scene.
        mesh: vertices (n, 3) float, world units, and faces (m, 3) int, instead of a triangulation of the points.
        record_to: file for the record of flips, written as they are made.
        header: facts to store in the record.
        should_stop: polled; rounds of face splits and flips made before a stop remain.
        on_progress: called with the finished part, 0 to 1, and a line; while faces are split from several threads.

    Raises:
        InputError: there are no or too few points to triangulate, or no face is seen by three photos.
    """
    options = options or TriangulationOptions()
    start = None
    if mesh is None:
        if points is None or len(points.positions) == 0:
            raise InputError(f"{name}: expected sparse points to triangulate, found none; give a mesh with --mesh")
        start = start_mesh(views, points, options)
        mesh = start.vertices, start.faces
    scene = Scene.build(name, *mesh, views, sparse_points=points)
    evaluator, begun = Evaluator(options.threads), SPLIT_SHARE if options.splits else 0.0
    rounds = _split(scene, options, evaluator, should_stop, lambda part, line: on_progress(begun * part, line))
    splits = tuple(rounds)
    if splits and splits[0].is_split.any():
        scene = Scene.build(name, *splits[-1].result(), views, sparse_points=points)
    flipper = EdgeFlipper(scene, options, evaluator)
    flipper.trace.carving, flipper.trace.splits = None if start is None else start.carving, splits
    flipper.trace.header |= (header or {}) | {"options": asdict(options)}
    if record_to is not None:
        flipper.trace.attach(record_to)

    def show(flips: int, open_edges: int, energy: float) -> None:
        line = f"{flips} flips, {open_edges} edges to flip, energy {energy:.5g}"
        on_progress(begun + (1 - begun) * _flip_progress(flips, open_edges), line)

    try:
        summary = flipper.run(should_stop, show)
    finally:
        flipper.trace.detach()
    return Triangulation(scene, flipper.trace.faces_at(len(flipper.trace)), start, flipper.trace, summary)


def _split(
    scene: Scene,
    options: TriangulationOptions,
    evaluator: Evaluator,
    should_stop: Callable[[], bool],
    on_progress: Callable[[float, str], None],
) -> Iterator[SplitRound]:
    """The rounds of face splits, up to a stop."""

    def check() -> None:
        if should_stop():
            raise Cancelled

    mesh = scene.mesh
    with suppress(Cancelled):
        yield from split_faces(
            scene.views, mesh.vertices, mesh.faces, options.splits, options.spacing, evaluator.pool, check, on_progress
        )


def _flip_progress(flips: int, open_edges: int) -> float:
    """Estimated progress of a search, 0 to 1; every flip may make further edges inconsistent."""
    return 0.98 * flips / (flips + 1.5 * open_edges) if open_edges else 0.99
