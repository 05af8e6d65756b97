"""Residuals and image flow of all faces at a recorded moment, by photo: what the surface can be painted with."""

from dataclasses import dataclass

import numpy as np

from fairing.judge.flow import face_flow
from fairing.judge.inspect import FaceCells, cells_of_all_faces
from fairing.run.session import Session

FLOW_SIZE = 32  # cell pixels: larger cells are reduced to about this size for the flow
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


def face_residuals(session: Session, moment: int | None = None, *, with_flow: bool = True) -> FaceResiduals:
    """Residuals and flows of all faces that take part, with the cells of `fairing.judge.inspect.face_cells`.

    `fairing.judge.texel_residuals` has the residuals at every sample of a face.

    Args:
        moment: default: the session's present moment.
        with_flow: whether the flow is computed, which takes longer than the residuals; else it is NaN.

    Raises:
        Cancelled: the session's cancellation was requested.
    """
    moment = session.moment if moment is None else moment
    faces, views, sums, samples, flows = [], [], [], [], []
    purpose = "measuring flow" if with_flow else "measuring residuals"
    for cells in cells_of_all_faces(session, moment, purpose):
        faces.append(np.full(len(cells.views), cells.face))
        views.append(cells.views)
        sums.append(np.abs(cells.residual).sum(axis=1, where=cells.counts, dtype=float))
        samples.append(cells.counts.sum(axis=1))
        flows.append(_flow_in_cell(cells) if with_flow else np.full((len(cells.views), 2), np.nan))
    face_of, view_of = (np.concatenate([np.zeros(0, dtype=int), *ids]) for ids in (faces, views))
    corners = session.trace.vertices_at(moment)[session.scene.mesh.faces[face_of]]
    # Columns of the cell run from corner 2 to corner 0, rows from corner 2 to corner 1.
    edges = corners[:, :2] - corners[:, 2:]
    in_cell = np.concatenate([np.zeros((0, 2)), *flows])
    on_surface = np.einsum("qk,qkc->qc", in_cell, edges)
    normals = np.cross(edges[:, 0], edges[:, 1])
    places = corners.mean(axis=1)
    return FaceResiduals(
        len(session.scene.mesh.faces),
        face_of,
        view_of,
        np.concatenate([np.zeros(0), *sums]),
        np.concatenate([np.zeros(0, dtype=int), *samples]),
        places,
        normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300),
        on_surface,
        _length_in_photo(session, view_of, places, on_surface),
    )


def _flow_in_cell(cells: FaceCells) -> np.ndarray:
    """(n, 2) float: flow of each cell in lengths of the face's edges (column, row); NaN where undetermined."""
    flow, confidence = face_flow(cells, reduction=max(1, cells.size // FLOW_SIZE))
    return np.where((confidence >= LEAST_CONFIDENCE)[:, None], flow, np.nan) * cells.spacing


def _length_in_photo(session: Session, views: np.ndarray, places: np.ndarray, motions: np.ndarray) -> np.ndarray:
    """(q,) float, px: lengths in the photos of small motions (q, 3) at places (q, 3), world units."""
    length = np.full(len(views), np.nan)
    for view in np.unique(views):
        own = views == view
        J = session.scene.views[view].camera.J_image_wrt_point(places[own])
        length[own] = np.linalg.norm(np.einsum("qrc,qc->qr", J, motions[own]), axis=1)
    return length
