"""Residuals and image flow of all faces at a recorded moment, by photo: what the surface can be painted with."""

from dataclasses import dataclass

import numpy as np

from fairing.errors import Cancelled, InputError
from fairing.judge.flow import face_flow
from fairing.judge.inspect import FaceCells, cells_in_context
from fairing.run.session import Session

FLOW_SIZE = 48  # cell pixels: larger cells are reduced to about this size for the flow
LEAST_CONFIDENCE = 0.5  # of a flow; below this the texture of the face does not determine it


@dataclass(frozen=True, eq=False)
class FaceResiduals:
    """Residual and flow of every pair of a face and a photo that takes part in it, q pairs.

    Attributes:
        n_faces: number of faces of the mesh, m.
        faces, views: (q,) int: the pairs.
        residual_sum: (q,) float: sum of |e| over the samples of the cell, grey levels.
        samples: (q,) int: number of samples that the photo really shows.
        places: (q, 3) float, world units: centroid of the face.
        normals: (q, 3) float: unit normal of the face.
        flow: (q, 3) float, world units: motion on the surface of the photo's texture towards its reconstruction; NaN
            where the texture does not determine it.
        flow_px: (q,) float: length of the flow in the photo, px; NaN where undetermined.
    """

    n_faces: int
    faces: np.ndarray
    views: np.ndarray
    residual_sum: np.ndarray
    samples: np.ndarray
    places: np.ndarray
    normals: np.ndarray
    flow: np.ndarray
    flow_px: np.ndarray

    def mean_residual(self, view: int | None = None) -> np.ndarray:
        """(m,) float: mean absolute residual |I - U c| of each face in one photo, or over the samples of all photos; grey
        levels. NaN where the photo does not take part in the face."""
        chosen = self.chosen(view)
        return self._mean(self.residual_sum[chosen], self.samples[chosen], self.faces[chosen])

    def mean_flow_px(self, view: int | None = None) -> np.ndarray:
        """(m,) float: length of the flow of each face in one photo, or its mean over all photos; px. NaN where unknown."""
        known = self.chosen(view) & ~np.isnan(self.flow_px)
        return self._mean(self.flow_px[known], np.ones(int(known.sum())), self.faces[known])

    def chosen(self, view: int | None) -> np.ndarray:
        """(q,) bool: the pairs of one photo, or all."""
        return np.full(len(self.views), True) if view is None else self.views == view

    def _mean(self, sums: np.ndarray, counts: np.ndarray, faces: np.ndarray) -> np.ndarray:
        total = np.bincount(faces, weights=sums, minlength=self.n_faces)
        count = np.bincount(faces, weights=counts, minlength=self.n_faces)
        return np.divide(total, count, out=np.full(self.n_faces, np.nan), where=count > 0)


def face_residuals(session: Session, moment: int | None = None) -> FaceResiduals:
    """Residuals and flows of all faces that take part, with the cells of `fairing.judge.inspect.face_cells`.

    Args:
        moment: default: the session's present moment.

    Raises:
        Cancelled: the session's cancellation was requested.
    """
    moment = session.moment if moment is None else moment
    vertices, sweep = session.trace.vertices_at(moment), session.sweep_state(moment)
    mesh, found = session.scene.mesh, []
    for face in np.flatnonzero(sweep.context.takes_part):
        if session.cancel_requested():
            raise Cancelled
        sigma, scale = float(sweep.sigma[face]), float(sweep.scale[face])
        try:
            cells = cells_in_context(session, sweep.context, vertices, int(face), moment, sigma, scale)
        except InputError:  # a corner lies behind a camera
            continue
        found.append(_of_face(session, cells, vertices[mesh.faces[face]]))
    n_faces = len(mesh.faces)
    if not found:
        ids, values, vectors = np.zeros(0, dtype=int), np.zeros(0), np.zeros((0, 3))
        return FaceResiduals(n_faces, ids, ids, values, ids, vectors, vectors, vectors, values)
    return FaceResiduals(n_faces, *(np.concatenate(part) for part in zip(*found, strict=True)))


def _of_face(session: Session, cells: FaceCells, corners: np.ndarray) -> tuple[np.ndarray, ...]:
    """The fields of `FaceResiduals` for the cells of one face with corners (3, 3), world units."""
    flow, confidence = face_flow(cells, reduction=max(1, cells.size // FLOW_SIZE))
    flow = np.where((confidence >= LEAST_CONFIDENCE)[:, None], flow, np.nan)
    # Columns of the cell run from corner 2 to corner 0, rows from corner 2 to corner 1.
    on_surface = flow / cells.size @ (corners[:2] - corners[2])
    middle = corners.mean(axis=0)
    cameras = [session.scene.views[view].camera for view in cells.views]
    in_photo = np.array(
        [camera.J_image_wrt_point(middle) @ motion for camera, motion in zip(cameras, on_surface, strict=True)]
    )
    normal = np.cross(*(corners[:2] - corners[2]))
    n = len(cells.views)
    return (
        np.full(n, cells.face),
        cells.views,
        np.abs(cells.residual).sum(axis=1, where=cells.counts, dtype=float),
        cells.counts.sum(axis=1),
        np.tile(middle, (n, 1)),
        np.tile(normal / max(float(np.linalg.norm(normal)), 1e-300), (n, 1)),
        on_surface,
        np.linalg.norm(in_photo.reshape(n, 2), axis=1),
    )
