"""Flow fields for display (the paper's figure 4): the warp by a displaced vertex, and optical flow to the reconstruction.

Two fields over the same cells, with opposite signs by construction:

- `model_flow`: a displacement eta of the vertex moves the positions at which the photo is read by upsilon(u, eta), so that
  the new cell is I(u + upsilon). Arrows show upsilon.
- `optical_flow`: the motion of the texture from the cell to its reconstruction, [U c](u + f) = I(u) (constant brightness).
  Arrows show f.

Eq. 4 requires I(u + upsilon) = [U c](u), so f = -upsilon for the correct eta: the two counter-balance, as the paper says. The
effect is clearest with few eigenspace dimensions; further ones absorb part of the misalignment. The engine uses neither field.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter

from fairing.camera import Camera
from fairing.judge.inspect import FaceCells
from fairing.scene import Scene

LEAST_WINDOW = 2.0  # cell pixels: sigma of the Gaussian window in large faces, whose samples lie some px apart
# Least eigenvalue of a window's structure tensor, (grey levels / cell pixel)^2, at which the confidence of a flow is 0.5.
HALF_CONFIDENCE = 4.0


@dataclass(frozen=True, eq=False)
class ModelFlow:
    """Effect of a displacement of one vertex on the cells of a face: n views, p positions.

    Attributes:
        places: (p, 2) float: column and row in the cell, cell pixels.
        vectors: (n, p, 2) float: upsilon, cell pixels (column, row).
        photo_places: (n, p, 2) float: the same positions in the photos, px.
        photo_vectors: (n, p, 2) float: their displacement, px.
        vertex_vectors: (n, 2) float: delta u_iv, displacement of the vertex itself in each photo, px.
    """

    places: np.ndarray
    vectors: np.ndarray
    photo_places: np.ndarray
    photo_vectors: np.ndarray
    vertex_vectors: np.ndarray


def model_flow(
    scene: Scene,
    vertices: np.ndarray,
    cells: FaceCells,
    vertex: int,
    displacement: np.ndarray,
    affine: bool = False,
    spacing: int = 1,
) -> ModelFlow:
    """Cell-pixel displacements induced by a small displacement eta of a vertex.

    delta u = hat J eta (Eq. 10 and the linear variation of section 4.3), upsilon = H_2x2 delta u (Eq. 11 without the
    neglected delta H), where H_2x2 is the linear part of cell_from_image at the position: constant over the cell with the
    affine warp, else that of the homography.

    Args:
        vertices: (n, 3) float, world units: positions the cells belong to.
        cells: the cells of a face.
        vertex: id of one of the face's corners.
        displacement: (3,) float, eta, world units.
        affine: whether the run's warp is affine.
        spacing: distance of the vectors, cell pixels.

    Raises:
        ValueError: the vertex is not a corner of the face.
    """
    face = scene.mesh.faces[cells.face]
    if vertex not in face:
        raise ValueError(f"vertex {vertex}: expected a corner of face {cells.face}, one of {face.tolist()}")
    rows, columns = cells.rows_and_columns
    chosen = (rows % spacing == 0) & (columns % spacing == 0)
    rows, columns = rows[chosen], columns[chosen]
    bary = cells.barycentric(rows, columns)
    hat = bary[:, int(np.flatnonzero(face == vertex)[0])]
    corners = vertices[face]
    cameras = [scene.views[v].camera for v in cells.views]
    found = [_in_photo(camera, corners, vertices[vertex], bary, hat, displacement, affine) for camera in cameras]
    photo_places, photo_vectors, image_from_ramp, of_vertex = (np.array(part) for part in zip(*found, strict=True))
    vectors = np.linalg.solve(image_from_ramp, photo_vectors[..., None])[..., 0] / cells.spacing
    places = np.stack([columns, rows], axis=1).astype(float)
    return ModelFlow(places, vectors, photo_places, photo_vectors, of_vertex)


def step_flow(
    scene: Scene, before: np.ndarray, after: np.ndarray, cells: FaceCells, affine: bool = False, spacing: int = 1
) -> ModelFlow | None:
    """Cell-pixel displacements of a step: the sum over the face's corners that it moved, or None if it moved none.

    Args:
        before, after: (n, 3) float, world units: positions of all vertices; the cells belong to those before.
        affine, spacing: as in `model_flow`.
    """
    moved = [int(v) for v in scene.mesh.faces[cells.face] if (before[v] != after[v]).any()]
    flows = [model_flow(scene, before, cells, v, after[v] - before[v], affine, spacing) for v in moved]
    if not flows:
        return None
    return replace(
        flows[0],
        vectors=np.sum([flow.vectors for flow in flows], axis=0),
        photo_vectors=np.sum([flow.photo_vectors for flow in flows], axis=0),
    )


def _in_photo(
    camera: Camera,
    corners: np.ndarray,
    vertex: np.ndarray,
    bary: np.ndarray,
    hat: np.ndarray,
    displacement: np.ndarray,
    affine: bool,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """In one photo, px: positions (p, 2), their displacements (p, 2), the derivative of a position by the weights of corners
    0 and 1 (p, 2, 2), and the vertex's displacement (2,)."""
    of_vertex = camera.J_image_wrt_point(vertex) @ displacement
    derivative = image_from_ramp(camera, corners, bary, affine)
    if affine:
        return bary @ camera.project(corners)[0], hat[:, None] * of_vertex, derivative, of_vertex
    points = bary @ corners
    J = camera.J_image_wrt_point(points)
    return camera.project(points)[0], hat[:, None] * (J @ displacement), derivative, of_vertex


def image_from_ramp(camera: Camera, corners: np.ndarray, bary: np.ndarray, affine: bool) -> np.ndarray:
    """(p, 2, 2) float, px: derivative of the position in a photo by the barycentric weights of corners 0 and 1.

    Args:
        corners: (3, 3) float, world units: of a face.
        bary: (p, 3) float: barycentric weights of the positions.
        affine: whether the warp between face and photo is affine.
    """
    if affine:
        uv, _ = camera.project(corners)
        return np.broadcast_to((uv[:2] - uv[2]).T, (len(bary), 2, 2))
    return camera.J_image_wrt_point(bary @ corners) @ (corners[:2] - corners[2]).T


@dataclass(frozen=True, eq=False)
class OpticalFlow:
    """Motion of the texture from each cell to its reconstruction.

    Attributes:
        places: (q, 2) float: column and row in the cell, cell pixels.
        vectors: (n, q, 2) float: f, cell pixels (column, row); 0 where undefined.
        confidence: (n, q) float, 0 to 1: how well the texture in the window determines both components (from the
            smaller eigenvalue of its structure tensor; 0 on a straight edge).
    """

    places: np.ndarray
    vectors: np.ndarray
    confidence: np.ndarray


def optical_flow(cells: FaceCells, window: float = 4.0, spacing: int = 1, reduction: int = 1) -> OpticalFlow:
    """Optical flow from each cell to its reconstruction.

    Args:
        window: sigma of the Gaussian window, cell pixels.
        spacing: distance of the vectors, cell pixels.
        reduction: edge of the blocks that are averaged first, cell pixels: faster by its square; finer detail is lost.
    """
    one, other, valid = _grey_images(cells, reduction)
    rows, columns = cells.rows_and_columns
    last = one.shape[1] * reduction  # the remainder at the ends of a reduced cell has no flow
    chosen = (rows % spacing == 0) & (columns % spacing == 0) & (rows < last) & (columns < last)
    rows, columns = rows[chosen], columns[chosen]
    at = rows // reduction, columns // reduction
    flows = [lucas_kanade(a, b, v == 1, window / reduction) for a, b, v in zip(one, other, valid, strict=True)]
    shape = (len(flows), len(rows))
    vectors = reduction * np.array([flow[at] for flow, _ in flows]).reshape(*shape, 2)
    confidence = np.array([belief[at] for _, belief in flows]).reshape(shape)
    return OpticalFlow(np.stack([columns, rows], axis=1).astype(float), vectors, confidence)


def face_flow(cells: FaceCells, reduction: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Optical flow from each cell to its reconstruction, as one vector per cell: `lucas_kanade` with the cell as window.

    Args:
        reduction: as in `optical_flow`.

    Returns:
        (n, 2) float, cell pixels (column, row), and its confidence (n,) float, 0 to 1.
    """
    one, other, valid = _grey_images(cells, reduction)
    gx, gy, difference, weight = _linearised(one, other, valid == 1)
    total = np.maximum(weight.sum(axis=(1, 2)), 1e-9)

    def average(values: np.ndarray) -> np.ndarray:
        return (weight * values).sum(axis=(1, 2)) / total

    flow, confidence = _least_squares_flow(gx, gy, difference, average)
    return reduction * flow, confidence


def flow_in_photo(
    cells: FaceCells, slot: int, image_from_cell: np.ndarray, window: float
) -> tuple[np.ndarray, np.ndarray]:
    """Optical flow from one cell to its reconstruction at every sample, in px of its photo.

    Args:
        slot: of the cell, an index into `cells.views`.
        image_from_cell: (p, 2, 2) float, px / cell pixel: derivative of the samples' positions in the photo by column and row.
        window: sigma of the Gaussian window, px of the photo; the window is round in the cell, and this its mean size. At
            least `LEAST_WINDOW` is used.

    Returns:
        (p, 2) float, px (right, down), and its confidence (p,) float, 0 to 1, as of `lucas_kanade` with gradients per half a
        window: the same texture counts as well in larger and blurred photos. So it is in `face_flow`, after the reduction.
    """
    one, other, valid = (images[slot] for images in _grey_images(cells, 1))
    rows, columns = cells.rows_and_columns
    derivative = np.broadcast_to(np.eye(2), (*one.shape, 2, 2)).copy()  # anything regular outside the triangle
    derivative[rows, columns] = image_from_cell
    spacing = float(np.sqrt(np.abs(np.linalg.det(image_from_cell)).mean()))  # of the samples, px
    sigma = max(LEAST_WINDOW, window / spacing)
    unit = 0.5 * sigma * spacing
    flow, confidence = lucas_kanade(one, other, valid == 1, sigma, derivative / unit)
    return unit * flow[rows, columns], confidence[rows, columns]


def _grey_images(cells: FaceCells, reduction: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cells, reconstructions and the fraction of valid samples, (n, N // r, N // r) float each, grey levels; NaN outside."""
    one, other = cells.as_images(cells.observed), cells.as_images(cells.reconstruction)
    valid = cells.as_images(cells.counts.astype(float))
    if cells.channels > 1:
        one, other, valid = one.mean(axis=-1), other.mean(axis=-1), valid[..., 0]
    if reduction > 1:
        one, other, valid = (_reduced(images, reduction) for images in (one, other, valid))
    return one, other, valid


def _reduced(images: np.ndarray, reduction: int) -> np.ndarray:
    """(n, N // r, N // r): means of blocks; NaN where a block reaches out of the triangle."""
    size = images.shape[1] // reduction
    blocks = images[:, : size * reduction, : size * reduction].reshape(-1, size, reduction, size, reduction)
    return blocks.mean(axis=(2, 4))


def lucas_kanade(
    image: np.ndarray, target: np.ndarray, valid: np.ndarray, window: float, derivative: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Flow f with target(u + f) = image(u) by least squares in a Gaussian window, and its confidence.

    Brightness constancy, linearised with the mean of both gradients g (the error is then of third order in f):
    g . f + (target - image) = 0. The window's normal equations (sum g g^T) f = -sum g (target - image), Lucas and
    Kanade 1981, are damped so that f falls to 0 where there is no texture.

    Args:
        image, target: (h, w) float, grey levels; NaN is allowed where not valid.
        valid: (h, w) bool: pixels that count.
        window: sigma, pixels.
        derivative: (h, w, 2, 2) float: of coordinates in which flow and gradients are measured, by column and row; None:
            those are pixels.

    Returns:
        (h, w, 2) float, pixels (column, row) or the coordinates of `derivative`, and (h, w) float, 0 to 1.
    """
    gx, gy, difference, weight = _linearised(image, target, valid)
    if derivative is not None:
        gradient = np.stack([gx, gy], axis=-1)[..., None]
        gx, gy = np.moveaxis(np.linalg.solve(np.swapaxes(derivative, -1, -2), gradient)[..., 0], -1, 0)
    total = np.maximum(gaussian_filter(weight, window), 1e-9)
    flow, smaller_share = _least_squares_flow(
        gx, gy, difference, lambda values: gaussian_filter(weight * values, window) / total
    )
    known = valid & (total > 1e-3)
    return np.where(known[..., None], flow, 0), np.where(known, smaller_share, 0)


def _linearised(
    image: np.ndarray, target: np.ndarray, valid: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Gradients of the mean image along columns and rows, target - image, and weight 1 where all are known: (..., h, w)."""
    mean = np.where(valid, 0.5 * (image + target), 0)
    difference = np.where(valid, target - image, 0)
    gx, usable_x = _slope(mean, valid, axis=-1)
    gy, usable_y = _slope(mean, valid, axis=-2)
    return gx, gy, difference, (valid & usable_x & usable_y).astype(float)


def _least_squares_flow(
    gx: np.ndarray, gy: np.ndarray, difference: np.ndarray, average: Callable[[np.ndarray], np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """The flow (..., 2), pixels, that solves the normal equations averaged over a window, and its confidence (...)."""
    xx, xy, yy = average(gx * gx), average(gx * gy), average(gy * gy)
    bx, by = -average(gx * difference), -average(gy * difference)
    root = np.sqrt((0.5 * (xx - yy)) ** 2 + xy**2)
    smaller = np.maximum(0.5 * (xx + yy) - root, 0)
    ridge = 1e-3 * (xx + yy) + 1e-9
    determinant = (xx + ridge) * (yy + ridge) - xy**2
    flow = np.stack([(yy + ridge) * bx - xy * by, (xx + ridge) * by - xy * bx], axis=-1) / determinant[..., None]
    return flow, smaller / (smaller + HALF_CONFIDENCE)


def _slope(image: np.ndarray, valid: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Central difference along an axis, and where both neighbours count."""
    slope, usable = np.zeros(image.shape), np.zeros(image.shape, dtype=bool)
    values, inner = np.moveaxis(image, axis, 0), np.moveaxis(slope, axis, 0)
    known, inner_known = np.moveaxis(valid, axis, 0), np.moveaxis(usable, axis, 0)
    inner_known[1:-1] = known[2:] & known[:-2]
    inner[1:-1] = np.where(inner_known[1:-1], 0.5 * (values[2:] - values[:-2]), 0)
    return slope, usable
