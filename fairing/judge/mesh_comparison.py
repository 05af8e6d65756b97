"""Comparison of meshes of any origin by the photos, points and reference surface of one capture."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fairing.errors import InputError
from fairing.geometry.closest_point import SurfaceTree
from fairing.judge.comparable_residual import ComparableResidual
from fairing.judge.left_out import LeftOut, Prediction, judged_views, leave_one_out
from fairing.judge.metrics import Distances, held_out_distances_of, surface_distance
from fairing.mesh import Mesh
from fairing.run.session import Session
from fairing.scene import Scene


@dataclass(frozen=True, eq=False)
class MeshFigures:
    """What the capture says about one of several meshes.

    Attributes:
        scene: the mesh as this program uses it, with the photos of the capture.
        residual: how well the photos agree at the finest level, over all faces that at least three photos see, grey levels;
            NaN if there are none. See `fairing.judge.comparable_residual`.
        held_out: distances of the held-out sparse points, the same ones for all meshes; None without such points.
        left_out: predictions of photos from the others, evaluated on the pixels that all meshes show.
        to_reference: distances of samples of the mesh to the reference surface; None without one.
        from_reference: distances of samples of the reference surface to the mesh: how complete it is.
    """

    scene: Scene
    residual: float
    held_out: Distances | None
    left_out: LeftOut
    to_reference: Distances | None
    from_reference: Distances | None

    @property
    def psnr(self) -> float:
        """Mean over the evaluated photos, dB; NaN without any."""
        return _mean(self.left_out.psnr)

    @property
    def ssim(self) -> float:
        """Mean over the evaluated photos; NaN without any."""
        return _mean(self.left_out.ssim)

    def summary(self) -> dict[str, Any]:
        """Plain numbers for a report; distances in percent of the diagonal of all meshes together."""
        figures: dict[str, Any] = {
            "vertices": len(self.scene.mesh.vertices),
            "faces": len(self.scene.mesh.faces),
            "residual": self.residual,
            "psnr": self.psnr if np.isfinite(self.psnr) else None,
            "ssim": self.ssim if np.isfinite(self.ssim) else None,
            "photos_judged": int(np.isfinite(self.left_out.psnr).sum()),
        }
        distances = {
            "held_out_points": self.held_out,
            "to_reference": self.to_reference,
            "from_reference": self.from_reference,
        }
        return figures | {
            name: found.summary() for name, found in distances.items() if found is not None and len(found.values)
        }


def compare_meshes(
    scene: Scene,
    meshes: Sequence[Mesh],
    reference: Mesh | None = None,
    on_progress: Callable[[float, str], None] = lambda fraction, line: None,
    on_view: Callable[[Prediction], None] = lambda prediction: None,
) -> list[MeshFigures]:
    """Compare meshes on equal footing: with the same photos, points and pixels.

    Args:
        scene: its photos, cameras and sparse points are used, its mesh is not.
        meshes: at least two, of any connectivity, in the frame of the scene, world units.
        reference: a true or better surface; default: none.
        on_progress: called with the finished part, 0 to 1, and a line.
        on_view: called with every photo that was predicted, with a picture for each mesh.

    Raises:
        InputError: fewer than two meshes, one of them or a photo cannot be used.
    """
    if len(meshes) < 2:
        raise InputError(f"meshes: expected at least two, found {len(meshes)}")
    scenes = [_scene_with(scene, mesh) for mesh in meshes]
    together = _scene_with(scene, _union(meshes))
    surfaces, diagonal = [each.mesh for each in scenes], together.mesh.diagonal
    residuals = []
    for number, each in enumerate(scenes):
        on_progress(0.4 * number / len(scenes), f"residual of mesh {number + 1} of {len(scenes)}")
        residuals.append(ComparableResidual(Session(each)).measure(each.mesh.vertices).mean)
    on_progress(0.4, "distances")
    held_out = held_out_distances_of(together, surfaces)
    to_reference: list[Distances | None] = [None] * len(scenes)
    from_reference: list[Distances | None] = [None] * len(scenes)
    if reference is not None:
        tree = SurfaceTree(reference)
        to_reference = [surface_distance(mesh, tree, diagonal) for mesh in surfaces]
        from_reference = [surface_distance(reference, mesh, diagonal) for mesh in surfaces]
    views, done = judged_views(scene), 0

    def show(prediction: Prediction) -> None:
        nonlocal done
        done += 1
        on_progress(0.5 + 0.5 * done / len(views), f"photo {done} of {len(views)} predicted from the others")
        on_view(prediction)

    left_out = leave_one_out(scene, *surfaces, views=views, on_view=show)
    return [
        MeshFigures(
            each,
            residuals[n],
            None if held_out is None else held_out[n],
            left_out[n],
            to_reference[n],
            from_reference[n],
        )
        for n, each in enumerate(scenes)
    ]


def _mean(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else np.nan


def _scene_with(scene: Scene, mesh: Mesh) -> Scene:
    return Scene.build(
        scene.name, mesh.vertices, mesh.faces, scene.views, sparse_points=scene.sparse_points, points_choice="given"
    )


def _union(meshes: Sequence[Mesh]) -> Mesh:
    """All meshes as one."""
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + begin for mesh, begin in zip(meshes, first[:-1].tolist(), strict=True)]
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))
