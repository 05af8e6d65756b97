"""Image flow at every sample of the cells in one photo: where in a face, how far and in which direction its texture is off."""

from dataclasses import dataclass

import numpy as np

from fairing.judge.face_residuals import LEAST_CONFIDENCE
from fairing.judge.flow import flow_in_photo, image_from_ramp
from fairing.judge.inspect import FaceCells
from fairing.judge.texels import Texels, chosen_moment, measure_texels
from fairing.run.session import Session

WINDOW = 4.0  # px of the photo: sigma of the Gaussian window where the photos are not blurred (ledger: flow per pixel)


@dataclass(frozen=True, eq=False)
class TexelFlow(Texels):
    """Motion in one photo of its texture towards its reconstruction, at the samples of all faces.

    The values are (t, 2), px of the photo (right, down); NaN where the photo does not show the sample, or where the texture in
    its window does not determine both components.
    """


def texel_flow(session: Session, moment: int | None, view: int) -> TexelFlow:
    """Image flow at every sample of all faces in which a photo takes part, see `fairing.judge.texels.measure_texels`.

    The flow is that of `fairing.judge.flow.lucas_kanade` with gradients and window in px of the photo. A window does not reach
    beyond its face.

    Args:
        moment: None: the session's present moment.
        view: id of the photo.

    Raises:
        IndexError: no such moment or photo.
        InputError: no photo sees any face well enough.
        Cancelled: the session's cancellation was requested.
    """
    moment = chosen_moment(session, moment, view)
    vertices, faces = session.trace.vertices_at(moment), session.scene.mesh.faces
    context = session.sweep_state(moment).context
    blur = session.options.levels[context.level].blur
    camera, is_affine = session.scene.views[view].camera, session.options.cells.warp == "affine"

    def by_sample(cells: FaceCells) -> np.ndarray:
        rows, columns = cells.rows_and_columns
        weights = cells.barycentric(rows, columns)
        image_from_cell = cells.spacing * image_from_ramp(camera, vertices[faces[cells.face]], weights, is_affine)
        slot = cells.views.tolist().index(view)
        flow, confidence = flow_in_photo(cells, slot, image_from_cell, float(np.hypot(WINDOW, blur)))
        return np.where((confidence >= LEAST_CONFIDENCE)[:, None], flow, np.nan).astype(np.float32)

    return measure_texels(TexelFlow, session, moment, view, "measuring flow", by_sample, channels=(2,))
