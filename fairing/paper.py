"""The algorithm of the paper in NumPy, in the order of its equations: the method without the engine.

P. Mishra, O. Amidi, T. Kanade: EigenFairing: 3D Model Fairing using Image Coherence. BMVC 2004. Equation numbers are the
paper's. `fair_by_the_paper` runs it; the engine's preset `paper` takes the same steps in compiled code. Comments say what was
decided where the paper is silent.
"""

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np

from fairing.camera import Camera
from fairing.cells.visibility import Visibility, footprints, mesh_orientation
from fairing.geometry.normals import folded_faces
from fairing.options import PRESETS
from fairing.scene import Scene

DIMENSIONS = 5  # k: "the first five components of eigenspace"
CELL_SIZE = 128  # "the cell size is 128 x 128 pixels"
SMOOTHING = (6.0, 4.8, 3.6, 2.4, 1.2)  # sigma_smooth, px: "a five-level pyramid", "varied linearly from 6.0 to 1.2"
# Limits, which the paper does not give: passes over the vertices, steps of a vertex in a pass, longest step in sigma_smooth.
SWEEPS, ITERATIONS, LONGEST_STEP = 10, 20, 2.0
SETTLED, CONVERGED = (
    0.02,
    0.001,
)  # A level ends after a pass that moved less, in sigma_smooth; a vertex after a step that did, px.
LEAST_SIGMA = 1.0  # grey levels
LUMA = np.array([0.299, 0.587, 0.114])
# ---------------------------------------------------------------------------------- section 3: image coherence


def cell_pixels() -> np.ndarray:
    """(p, 3) float: barycentric coordinates of the pixels u of a cell, the right triangle below the diagonal of a square."""
    row, column = np.nonzero(np.add.outer(np.arange(CELL_SIZE), np.arange(CELL_SIZE)) < CELL_SIZE)
    u, v = (column + 1 / 3) / CELL_SIZE, (row + 1 / 3) / CELL_SIZE
    return np.stack([u, v, 1 - u - v], axis=1)


class Cell(NamedTuple):
    """The cell image of a face in one photo."""

    image: np.ndarray  # I_if (p,) float, grey levels
    gradient: np.ndarray  # grad I_if (p, 2) float, by cell coordinates
    cell_from_image: np.ndarray  # H_if (2, 3) float, the affine map with u = H [x y 1]^T


def warp_to_cell(photo: np.ndarray, camera: Camera, triangle: np.ndarray) -> Cell:
    """Affine warp of the image area of a face with corners (3, 3), world units, in a photo (height, width), grey levels."""
    corners, _ = camera.project(triangle)
    image_from_cell = np.column_stack([corners[0] - corners[2], corners[1] - corners[2]])
    values, slopes = interpolate(photo, cell_pixels() @ corners)
    linear = np.linalg.inv(image_from_cell)
    # By the chain rule, because image coordinates are affine in cell coordinates.
    return Cell(values, slopes @ image_from_cell, np.column_stack([linear, -linear @ corners[2]]))


def residual(images: np.ndarray) -> np.ndarray:
    """e_c (n, p) float of Eq. 6 at eta = 0: I - U c, the cells (n, p) less their reconstructions, grey levels.

    The basis images U are the first k singular vectors of the cells (no mean is removed), the coefficients c dot products of cells
    and basis images. More than n - 2 dimensions would leave next to no residual wherever the vertex lies.
    """
    U = np.linalg.svd(images, full_matrices=False)[2][: min(DIMENSIONS, len(images) - 2)].T
    c = images @ U
    return images - c @ U.T


# ---------------------------------------------------------------------------------- section 4: model fairing


def rho(e: np.ndarray, sigma: float) -> np.ndarray:
    """Geman-McClure norm e^2 / (sigma^2 + e^2).

    Its turning point is sigma / sqrt(3), as in the caption of figure 3. The formula in the text, with sigma instead of sigma^2,
    contradicts the caption.
    """
    return e**2 / (sigma**2 + e**2)


def rho_dot(e: np.ndarray, sigma: float) -> np.ndarray:
    """Influence function: the derivative of rho, 2 sigma^2 e / (sigma^2 + e^2)^2."""
    return 2 * sigma**2 * e / (sigma**2 + e**2) ** 2


def secant(e: np.ndarray, sigma: float) -> np.ndarray:
    """rho_dot(e) / e: positive, unlike the second derivative of rho, which it replaces in Eq. 9."""
    return 2 * sigma**2 / (sigma**2 + e**2) ** 2


def face_energy(images: np.ndarray, sigma: float) -> float:
    """E(c) = sum_i sum_u rho(I_if(u) - [U_f c_i](u)), Eq. 1; Eq. 2 and 3 with the cells of the moved face."""
    return float(rho(residual(images), sigma).sum())


def gauss_newton(e: np.ndarray, de: np.ndarray, sigma: float) -> tuple[np.ndarray, np.ndarray]:
    """Normal matrix (3, 3) and gradient (3,) of a face, from e_c (n, p) of Eq. 6 and its derivatives (n, p, 3) by eta.

    g_k = sum rho_dot(e) de/deta_k, Eq. 7. H_kl = sum rho_ddot(e) de/deta_k de/deta_l, Eq. 8; with the secant in place of
    rho_ddot it is the left-hand side of Eq. 9.
    """
    H = np.einsum("np,npk,npl->kl", secant(e, sigma), de, de)
    return H, np.einsum("np,npk->k", rho_dot(e, sigma), de)


def solve(H: np.ndarray, g: np.ndarray, damping: float = 0.0) -> np.ndarray:
    """delta eta (3,) of H delta eta = -g, Eq. 9; zero along eigenvectors without information; damping after a rejection."""
    values, vectors = np.linalg.eigh(H)
    informed = values > 1e-9 * values[-1]
    inverse = np.where(informed, 1 / np.where(informed, values + damping * values[-1], 1), 0)
    return -vectors @ (inverse * (vectors.T @ g))


def pixel_displacement(camera: Camera, vertex: np.ndarray) -> np.ndarray:
    """(2, 3) float: the displacement in the image by a vertex displacement, delta u = J eta, Eq. 10.

    Its row a = 1, 2 is [(r_3 x + t_3) r_a - (r_a x + t_a) r_3] / (r_3 x + t_3)^2, with the rows [r | t] of the projection matrix.
    """
    r, t = camera.image_from_world[:, :3], camera.image_from_world[:, 3]
    depth = r[2] @ vertex + t[2]
    return np.stack([(depth * r[a] - (r[a] @ vertex + t[a]) * r[2]) / depth**2 for a in (0, 1)])


def cell_displacement(H: np.ndarray, camera: Camera, vertex: np.ndarray, corner: int) -> np.ndarray:
    """(p, 2, 3) float: the derivative of upsilon(u, eta), the displacement of the cell's pixels, by eta, Eq. 11.

    At the moving vertex it is H [delta u 0]^T ("delta H is usually negligible"). Over the cell it falls linearly to zero at the
    opposite edge, as the barycentric coordinate of the moving corner does.
    """
    return cell_pixels()[:, corner, None, None] * (H[:, :2] @ pixel_displacement(camera, vertex))


def residual_derivative(cell: Cell, camera: Camera, vertex: np.ndarray, corner: int) -> np.ndarray:
    """(p, 3) float: de_c/deta = grad I . dupsilon/deta, with U and c held fixed.

    Eq. 4 asks for I(u + upsilon) = [U c](u); its expansion to first order, Eq. 5, gives e_c = grad I . upsilon + I - U c, Eq. 6.
    """
    return np.einsum("pa,pak->pk", cell.gradient, cell_displacement(cell.cell_from_image, camera, vertex, corner))


# ---------------------------------------------------------------------------------- the run


class Sweep(NamedTuple):
    """What stays fixed during one pass over the vertices."""

    scene: Scene
    photos: list[np.ndarray]  # (height, width) float32 each, grey levels, smoothed
    seen: np.ndarray  # (m, V) bool: the photos that each face uses; none where fewer than three see it
    sigma: np.ndarray  # (m,) float, grey levels: scale of the norm on each face

    def views(self, face: int) -> list[int]:
        """The photos of a face."""
        return np.flatnonzero(self.seen[face]).tolist()

    def faces(self, vertex: int) -> list[int]:
        """The faces around a vertex that photos see."""
        return [face for face in self.scene.mesh.one_rings[vertex].tolist() if self.seen[face].any()]

    def cells(self, vertices: np.ndarray, face: int) -> list[Cell]:
        """The cells of a face with the vertices (n, 3) at given positions."""
        triangle, views = vertices[self.scene.mesh.faces[face]], self.scene.views
        return [warp_to_cell(self.photos[v], views[v].camera, triangle) for v in self.views(face)]

    def energy(self, vertices: np.ndarray, vertex: int) -> float:
        """Energy of the faces around a vertex, after minimising over U and c."""
        cells = {face: np.array([cell.image for cell in self.cells(vertices, face)]) for face in self.faces(vertex)}
        return sum(face_energy(images, self.sigma[face]) for face, images in cells.items())


def begin_sweep(scene: Scene, photos: list[np.ndarray], vertices: np.ndarray, sigma_smooth: float) -> Sweep:
    """Choose the photos of each face (hidden faces are not treated), and sigma: "max(|e_c|) / sqrt(3)"."""
    faces, visibility, side = scene.mesh.faces, PRESETS["paper"].visibility, mesh_orientation(scene, vertices)
    found = [footprints(vertices, faces, view.camera, side, visibility, sigma_smooth) for view in scene.views]
    seen = np.column_stack([outlines.reason == Visibility.SEEN for outlines in found])
    seen[seen.sum(axis=1) < 3] = False
    sweep = Sweep(scene, photos, seen, np.full(len(faces), LEAST_SIGMA))
    for face in np.flatnonzero(seen.any(axis=1)).tolist():
        largest = np.abs(residual(np.array([cell.image for cell in sweep.cells(vertices, face)]))).max()
        sweep.sigma[face] = max(largest / np.sqrt(3), LEAST_SIGMA)
    return sweep


def fairing_step(sweep: Sweep, vertices: np.ndarray, vertex: int, damping: float = 0.0) -> np.ndarray:
    """delta eta (3,) of a vertex, from the sum of the normal equations of the faces around it."""
    H, g = np.zeros((3, 3)), np.zeros(3)
    for face in sweep.faces(vertex):
        cells, corner = sweep.cells(vertices, face), int(np.argmax(sweep.scene.mesh.faces[face] == vertex))
        cameras = [sweep.scene.views[v].camera for v in sweep.views(face)]
        e = residual(np.array([cell.image for cell in cells]))
        de = [residual_derivative(*of_photo, vertices[vertex], corner) for of_photo in zip(cells, cameras, strict=True)]
        H_face, g_face = gauss_newton(e, np.array(de), sweep.sigma[face])
        H, g = H + H_face, g + g_face
    return solve(H, g, damping)


def fair_vertex(sweep: Sweep, vertices: np.ndarray, vertex: int, longest: float) -> np.ndarray:
    """(n, 3) float: the vertices after eta(m + 1) = eta(m) + delta eta has converged for one of them.

    Steps longer than `longest` px in a photo are shortened. Only steps that lower the energy and fold no face are taken.
    """
    damping, energy, mesh = 0.0, sweep.energy(vertices, vertex), sweep.scene.mesh
    views = {v for face in sweep.faces(vertex) for v in sweep.views(face)}
    for _ in range(ITERATIONS):
        step = fairing_step(sweep, vertices, vertex, damping)
        by_photo = [pixel_displacement(sweep.scene.views[v].camera, vertices[vertex]) @ step for v in views]
        moved = max(float(np.linalg.norm(displacement)) for displacement in by_photo)
        after, shortened = vertices.copy(), min(1.0, longest / max(moved, 1e-12))
        after[vertex] += shortened * step
        energy_after = sweep.energy(after, vertex)
        folds = folded_faces(vertices, after, mesh.vertices, mesh.faces, PRESETS["paper"].step).any()
        if energy_after > energy or folds:
            damping = max(10 * damping, 1e-3)
            continue
        vertices, energy, damping = after, energy_after, damping / 10 if damping > 1e-3 else 0.0
        if moved < CONVERGED:
            break
    return vertices


def fair_by_the_paper(scene: Scene, free: Sequence[int] | None = None) -> np.ndarray:
    """(n, 3) float, world units: the vertices after fairing, level by level; `free` (default: all) may move, one at a time."""
    vertices, cameras = scene.mesh.vertices.copy(), [view.camera for view in scene.views]
    for sigma_smooth in SMOOTHING:
        photos = [smoothed(view.photo.load(), sigma_smooth) for view in scene.views]
        for _ in range(SWEEPS):
            sweep, begun = begin_sweep(scene, photos, vertices, sigma_smooth), vertices
            for vertex in range(len(vertices)) if free is None else free:
                if sweep.faces(vertex):
                    vertices = fair_vertex(sweep, vertices, vertex, LONGEST_STEP * sigma_smooth)
            moved = [camera.project(vertices)[0] - camera.project(begun)[0] for camera in cameras]
            if np.nanmax(np.linalg.norm(moved, axis=-1)) < SETTLED * sigma_smooth:
                break
    return vertices


def smoothed(photo: np.ndarray, sigma: float) -> np.ndarray:
    """(height, width) float32: the grey levels of a photo (height, width, 3) after Gaussian smoothing."""
    return cv2.GaussianBlur((photo @ LUMA).astype(np.float32), (0, 0), sigma)


def interpolate(photo: np.ndarray, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values (p,) and gradients (p, 2), by image coordinates, of a photo at pixels (p, 2): bilinear between pixel centres."""
    corner = np.clip(np.floor(pixels).astype(int), 0, np.array(photo.shape[::-1]) - 2)
    (x, y), (a, b) = corner.T, (pixels - corner).T
    square = photo[y, x], photo[y, x + 1], photo[y + 1, x], photo[y + 1, x + 1]
    here, right, below, both = (values.astype(float) for values in square)
    slope_x, slope_y = (1 - b) * (right - here) + b * (both - below), (1 - a) * (below - here) + a * (both - right)
    return here + a * (right - here) + b * slope_y, np.stack([slope_x, slope_y], axis=1)
