"""View-dependent texture: each face's eigenspace coefficients, blended from the photos taken near the eye.

Eigen-texture (Nishino, Sato, Ikeuchi 1999): the photos of a face are modelled as a sum of a few images, with coefficients for
each photo. The first image is the static texture's U with the gain c as its coefficient; up to IMAGES more explain the
residual. Between photos the coefficients are averaged with the weights of unstructured lumigraph rendering (Buehler et al.
2001): by the angle at the face between eye and camera, falling to zero at the angle of the first photo left out, so that the
texture changes continuously as the eye moves.
"""

from dataclasses import dataclass

import numba
import numpy as np

from fairing.scene import Scene
from fairing.texture.fusion import exposures, fuse
from fairing.texture.layout import AtlasLayout
from fairing.texture.model import UNSEEN
from fairing.texture.samples import most_texels, sample
from fairing.texture.texels import SOURCE, columns, place, rows
from fairing.texture.view_choice import chosen_views, survey
from fairing.util.compiled_only import COMPILED_ONLY

GUTTER = 2  # texels: the atlas is small, and its image has no mip levels
IMAGES = 3  # in addition to the first
BLENDED = 3  # photos; weights fall to zero at the angle of the next nearest one
OUTLIER = (
    60.0  # grey levels, sigma of the Geman-McClure weight: wider than the static one's, because highlights are modelled
)
ROUNDS = 3
LEAST_DEVIATION = 1.0  # grey levels: an image that explains less than this is noise
TIE = 1e-6  # keeps the sum of the weights positive when all photos are equally near
OWN_ANGLE = 1e-3  # rad: within this angle of a photo's camera, that photo dominates


@dataclass(frozen=True, eq=False)
class EigenTexture:
    """A mesh with a texture that depends on the position of the eye: m faces, s photos per face, t texels.

    Attributes:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int.
        layout: the faces in the image.
        centers: (m, 3) float, world units: centroids of the faces.
        directions: (m, s, 3) float: unit vectors from these to the cameras of the face's photos, 0 for none.
        coefficients: (m, s, 1 + IMAGES) float: of the face's images for each of its photos, divided by the exposures.
        starts: (m + 1,) int: the first texel of each face in `basis`.
        basis: (t, 3, 1 + IMAGES) float32: the faces' images, texel by texel.
    """

    vertices: np.ndarray
    faces: np.ndarray
    layout: AtlasLayout
    centers: np.ndarray
    directions: np.ndarray
    coefficients: np.ndarray
    starts: np.ndarray
    basis: np.ndarray

    def weights_for(self, eye: np.ndarray) -> np.ndarray:
        """(m, s) float: blending weight of each photo of a face for an eye at (3,), world units; rows sum to 1 or 0."""
        sight = np.asarray(eye, dtype=np.float64) - self.centers
        sight /= np.maximum(np.linalg.norm(sight, axis=1, keepdims=True), 1e-300)
        is_there = self.directions.any(axis=2)
        # By the chord, because the arc cosine is inaccurate at small angles.
        chord = np.linalg.norm(self.directions - sight[:, None], axis=2)
        angle = np.where(is_there, 2 * np.arcsin(np.minimum(chord / 2, 1.0)), np.inf)
        end = np.sort(angle, axis=1)[:, BLENDED : BLENDED + 1]
        near = np.where(is_there, angle, 0.0)
        share = (np.maximum(1 - near / np.maximum(end, 1e-300), 0) + TIE) / (near + OWN_ANGLE)
        share = np.where(is_there, share, 0.0)
        return share / np.maximum(share.sum(axis=1, keepdims=True), 1e-300)

    def image_for(self, eye: np.ndarray) -> np.ndarray:
        """(h, w, 3) uint8, RGB: the texture for an eye at (3,), world units."""
        coefficients = np.einsum("ms,msk->mk", self.weights_for(eye), self.coefficients)
        coefficients[~self.directions.any(axis=(1, 2)), 0] = 1.0
        layout = self.layout
        image = np.full((layout.height, layout.width, 3), int(UNSEEN), dtype=np.uint8)
        compose(
            coefficients.astype(np.float32), self.starts, self.basis, layout.corner, layout.legs, layout.is_turned,
            layout.gutter, image,
        )  # fmt: skip
        return image


def eigen_texture(scene: Scene, vertices: np.ndarray, largest: int = 1024) -> EigenTexture:
    """The eigen-texture of the scene's mesh with its vertices at given positions.

    Args:
        vertices: (n, 3) float, world units.
        largest: limit of the texture's width and height, texels. The basis has 12 numbers per texel, 48 bytes: at most 50 MB
            for 1024.

    Raises:
        ValueError: too many faces for the largest texture.
        InputError: a photo cannot be read.
    """
    scores, edges = survey(scene, vertices, lambda fraction: None)
    layout = AtlasLayout.plan(edges, largest, GUTTER)
    chosen = chosen_views(scores)
    members = np.arange(len(chosen))
    starts, colors, weights = sample(scene, vertices, layout, chosen, scores, members)
    image = np.full((layout.height, layout.width, 3), UNSEEN, dtype=np.float32)
    log_gain = np.zeros(chosen.shape)
    placed = (layout.corner, layout.legs, layout.is_turned, layout.gutter)
    fuse(members, starts, colors, weights, *placed, image, log_gain)
    basis = np.zeros((int(most_texels(layout).sum()), 3, 1 + IMAGES), dtype=np.float32)
    coefficients = np.zeros((*chosen.shape, 1 + IMAGES))
    coefficients[..., 0] = np.exp(log_gain)
    explain(starts, colors, weights, *placed, image, coefficients, basis)
    exposure = exposures(layout, chosen, log_gain, len(scene.views))[1]
    coefficients /= exposure[chosen][..., None]
    centers = vertices[scene.mesh.faces].mean(axis=1)
    eyes = np.array([view.camera.center for view in scene.views])
    directions = eyes[chosen] - centers[:, None]
    directions /= np.maximum(np.linalg.norm(directions, axis=2, keepdims=True), 1e-300)
    directions[chosen < 0] = 0
    return EigenTexture(vertices, scene.mesh.faces, layout, centers, directions, coefficients, starts, basis)


@numba.njit(nogil=True, **COMPILED_ONLY)
def _explain(starts, colors, weights, corner, legs, is_turned, gutter, image, coefficients, basis):
    """The images of every face: U, and the principal components of the residual of U times the gains.

    Unseen samples, and outliers in part, are replaced by their prediction from the images, at first from U alone (weighted
    low-rank approximation by expectation maximisation, Srebro and Jaakkola 2003).
    """
    n_slots = weights.shape[1]
    for face in range(legs.shape[0]):
        start, w, h = starts[face], legs[face, 0], legs[face, 1]
        t = start
        for row in range(rows(h, gutter)):
            for column in range(columns(row, w, h, gutter)):
                y, x = place(row, column, corner[face], w, h, is_turned[face], gutter)
                for k in range(3):
                    basis[t, k, 0] = image[y, x, k]
                t += 1
        n = t - start
        left = np.zeros((n_slots, 3 * n))
        trust = np.zeros((n_slots, 3 * n))
        n_views = 0
        for s in range(n_slots):
            is_used = False
            gain = coefficients[face, s, 0]
            for i in range(n):
                if weights[start + i, s] > 1:
                    is_used = True
                    squared = 0.0
                    for k in range(3):
                        left[s, 3 * i + k] = colors[start + i, s, k] - gain * basis[start + i, k, 0]
                        squared += left[s, 3 * i + k] ** 2 / 3
                    for k in range(3):
                        trust[s, 3 * i + k] = 1 / (1 + squared / OUTLIER**2) ** 2
            n_views += is_used
        if n_views < 2:
            continue
        filled = trust * left
        axes, images = np.zeros((n_slots, IMAGES)), np.zeros((IMAGES, 3 * n))
        for _ in range(ROUNDS):
            values, vectors = np.linalg.eigh(filled @ filled.T)
            for j in range(IMAGES):
                last = n_slots - 1 - j
                counts = values[last] > LEAST_DEVIATION**2 * 3 * n * n_views
                for s in range(n_slots):
                    axes[s, j] = vectors[s, last] if counts else 0.0
            images = axes.T @ filled
            filled = trust * left + (1 - trust) * (axes @ images)
        for j in range(IMAGES):
            for s in range(n_slots):
                coefficients[face, s, 1 + j] = axes[s, j]
            for i in range(n):
                for k in range(3):
                    basis[start + i, k, 1 + j] = images[j, 3 * i + k]


@numba.njit(nogil=True, **COMPILED_ONLY)
def _compose(coefficients, starts, basis, corner, legs, is_turned, gutter, image):
    """The texture for coefficients (m, 1 + IMAGES), into `image`."""
    for face in range(legs.shape[0]):
        w, h = legs[face, 0], legs[face, 1]
        t = starts[face]
        for row in range(rows(h, gutter)):
            for column in range(columns(row, w, h, gutter)):
                y, x = place(row, column, corner[face], w, h, is_turned[face], gutter)
                for k in range(3):
                    value = np.float32(0.5)
                    for j in range(coefficients.shape[1]):
                        value += coefficients[face, j] * basis[t, k, j]
                    image[y, x, k] = np.uint8(min(max(value, 0.0), 255.0))
                t += 1


def _cached_for(source):
    @numba.njit(cache=True, nogil=True)
    def explain(*arguments):
        """See `_explain`."""
        assert source >= 0
        _explain(*arguments)

    @numba.njit(cache=True, nogil=True)
    def compose(*arguments):
        """See `_compose`."""
        assert source >= 0
        _compose(*arguments)

    return explain, compose


explain, compose = _cached_for(SOURCE)
