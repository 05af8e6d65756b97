"""Flow layer: on every face an arrow, of the image flow of a photo, or of what the flows of all photos have in common."""

import numpy as np
import viser

from app.debugger.run_state import RunState
from app.page_state.page_state import NOW_SHAPE, PageState
from app.page_state.residual_source import ResidualSource, flow_scale
from app.palette import FLOW
from app.stage import SIZE, Stage
from app.viser_bridge.line_node import LineNode
from fairing.judge.face_residuals import FaceResiduals
from fairing.scene import Scene

HEAD = 0.3  # length of the head, in lengths of the arrow
RAISED = 0.002 * SIZE  # page units towards the cameras: arrows lie in front of their faces
# Of the slopes of the lines of sight: with photos nearer to each other the displacement becomes uncertain, and shrinks.
LEAST_SPREAD = 0.2
MAX_ARROWS = 6000  # the browser draws about 10,000 lines at 3 frames/s without a graphics card


def flow_arrows(found: FaceResiduals, view: int, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """Arrows along the flow of one photo: shafts and heads (a, 3, 2, 3) float, world units, and their pairs (a,) int.

    Args:
        view: the photo.
        scale: length of the arrows, in lengths of the flow.
    """
    pairs = np.flatnonzero(found.chosen(view) & ~np.isnan(found.flow_px) & (found.flow_px > 0))
    along = scale * found.flow[pairs]
    return _arrows(found.places[pairs], along, np.cross(found.normals[pairs], along)), pairs


def displacement_arrows(found: FaceResiduals, centers: np.ndarray, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """Arrows along the normal, one a face: the displacement of the face that explains the flows of all its photos best.

    A face that is moved by d along its normal n shows every photo's texture shifted by d s, where s is the part of the line
    of sight w within the face, per unit of its part along n: s = w / (n . w) - n. So d is the slope of a regression of the
    flows on s over the photos. The mean of the flows does not show it: where the photos surround the normal, their shifts
    cancel.

    Args:
        centers: (V, 3) float, world units: camera centres of all photos.
        scale: length of the arrows, in lengths of the displacement.

    Returns:
        Shafts and heads (a, 3, 2, 3) float, world units, and for each arrow a pair (a,) int of its face.
    """
    pairs = np.flatnonzero(~np.isnan(found.flow_px))
    faces, first, owner = np.unique(found.faces[pairs], return_index=True, return_inverse=True)
    sight, normals = centers[found.views[pairs]] - found.places[pairs], found.normals[pairs]
    slope = sight / np.einsum("qc,qc->q", sight, normals)[:, None] - normals

    def total(values: np.ndarray) -> np.ndarray:
        return np.stack([np.bincount(owner, weights=column, minlength=len(faces)) for column in values.T], axis=1)

    count = total(np.ones((len(pairs), 1)))
    slope -= (total(slope) / count)[owner]
    along_slope = total((slope * found.flow[pairs]).sum(axis=1, keepdims=True))
    displacement = along_slope / (total((slope**2).sum(axis=1, keepdims=True)) + LEAST_SPREAD**2 * count)
    kept = np.flatnonzero(displacement[:, 0])
    pairs = pairs[first[kept]]
    along = scale * displacement[kept] * found.normals[pairs]
    across = np.cross(along, np.eye(3)[np.argmin(np.abs(along), axis=1)])
    across *= (np.linalg.norm(along, axis=1) / np.linalg.norm(across, axis=1))[:, None]
    return _arrows(found.places[pairs], along, across), pairs


def _arrows(tail: np.ndarray, along: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Shafts and heads (a, 3, 2, 3) of arrows from their tails, vectors, and vectors of the same length across (a, 3)."""
    tip = tail + along
    wings = [tip - HEAD * along + side * 0.5 * HEAD * across for side in (1, -1)]
    return np.stack([np.stack([tail, tip], 1), np.stack([tip, wings[0]], 1), np.stack([tip, wings[1]], 1)], 1)


class FlowArrowsLayer:
    """All arrows in one node, shown while the surface is coloured by the flow of its faces at their present vertices."""

    def __init__(self, client: viser.ClientHandle, stage: Stage, scene: Scene, source: ResidualSource) -> None:
        self._stage, self._source, self._mesh = stage, source, scene.mesh
        self._centers = np.array([view.camera.center for view in scene.views])
        self._lines = LineNode(client, "/flow_arrows", FLOW, 2.0)

    def show(self, state: RunState, page_state: PageState) -> None:
        is_by_face = page_state.surface == "flow" and not page_state.shows_texels
        is_shown = is_by_face and page_state.entered is None and page_state.shape == NOW_SHAPE
        found = self._source.at(state, page_state) if is_shown and not state.is_moving else None
        if found is None:
            self._lines.hide()
            return
        view, scale = page_state.residual_view, flow_scale(found, page_state, self._mesh, state.vertices)
        if view is None:
            arrows, pairs = displacement_arrows(found, self._centers, scale)
        else:
            arrows, pairs = flow_arrows(found, view, scale)
        arrows, pairs = arrows[:MAX_ARROWS], pairs[:MAX_ARROWS]
        points = self._stage.page_from_world(arrows).astype(np.float64)
        centers = self._stage.camera_centers[found.views[pairs]]
        sight = centers - points[:, 0, 0]
        sight /= np.maximum(np.linalg.norm(sight, axis=1, keepdims=True), 1e-12)
        self._lines.show((points + RAISED * sight[:, None, None]).reshape(-1, 2, 3).astype(np.float32))
