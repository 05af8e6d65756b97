"""Triangulation: from calibrated photos with sparse points, or with a mesh, to a mesh whose edges agree with the photos."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fairing.errors import Cancelled, InputError
from fairing.scene import Scene, SparsePoints, View
from fairing.triangulation.face_splits import Meshes, split_faces
from fairing.triangulation.flips import EdgeFlipper, FlipSummary
from fairing.triangulation.initial_mesh import StartMesh, start_mesh
from fairing.triangulation.options import TriangulationOptions
from fairing.triangulation.record import FlipTrace


@dataclass(frozen=True, eq=False)
class Triangulation:
    """Result of `triangulate`.

    Attributes:
        scene: the photos with the mesh before any flip.
        faces: (m, 3) int: the final faces, as vertex ids of `scene.mesh`.
        start: the initial mesh from sparse points; None if a mesh was given.
        split: vertices and faces before and after each round of face splits; empty if none was asked for, or it was stopped.
        trace: the flips.
        summary: of the search.
    """

    scene: Scene
    faces: np.ndarray
    start: StartMesh | None
    split: Meshes
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
            "vertices_of_splits": [len(vertices) for vertices, _ in self.split],
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
    on_progress: Callable[[int, int, float], None] = lambda flips, open_edges, energy: None,
) -> Triangulation:
    """Triangulate sparse points, or take a mesh, and flip edges until no flip makes the photos agree better.

    Before it faces are split, if `TriangulationOptions.splits` asks for it.

    Args:
        name: of the scene.
        mesh: vertices (n, 3) float, world units, and faces (m, 3) int, instead of a triangulation of the points.
        record_to: file for the record of flips, written as they are made.
        header: facts to store in the record.
        should_stop, on_progress: see `EdgeFlipper.run`.

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
    split = _split(scene, options, should_stop) if options.splits else ()
    if len(split) > 1:
        scene = Scene.build(name, *split[-1], views, sparse_points=points)
    flipper = EdgeFlipper(scene, options)
    flipper.trace.carving = None if start is None else start.carving
    flipper.trace.header |= (header or {}) | {"options": asdict(options)}
    if record_to is not None:
        flipper.trace.attach(record_to)
    try:
        summary = flipper.run(should_stop, on_progress)
    finally:
        flipper.trace.detach()
    return Triangulation(scene, flipper.trace.faces_at(len(flipper.trace)), start, split, flipper.trace, summary)


def _split(scene: Scene, options: TriangulationOptions, should_stop: Callable[[], bool]) -> Meshes:
    """See `Triangulation.split`."""

    def check() -> None:
        if should_stop():
            raise Cancelled

    with ThreadPoolExecutor(options.threads or os.cpu_count()) as executor, suppress(Cancelled):
        return split_faces(
            scene.views, scene.mesh.vertices, scene.mesh.faces, options.splits, options.spacing, executor, check
        )
    return ()


def flip_progress(flips: int, open_edges: int) -> float:
    """Estimated progress of a search, 0 to 1; every flip may make further edges inconsistent."""
    return 0.98 * flips / (flips + 1.5 * open_edges) if open_edges else 0.99
