"""Textured model: each face's texture is the first, view-independent component of its eigenspace.

A face's texels in the photos are modelled as one image U times a gain c for each photo: an eigenspace of one dimension, fitted
robustly, so that reflections, passers-by and wrong surfaces lose their weight. The exposure of each photo is estimated from the
gains of all faces and divided out, so that neighbours textured from different photos meet without a seam.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fairing.scene import Scene
from fairing.texture.fusion import exposures, fuse, multiply
from fairing.texture.layout import AtlasLayout
from fairing.texture.samples import most_texels, sample
from fairing.texture.view_choice import VIEWS_PER_FACE, chosen_views, survey

SAMPLE_BYTES = 400_000_000  # samples held in memory at a time
UNSEEN = 96.0  # grey level of faces that no photo sees


@dataclass(frozen=True, eq=False)
class TexturedModel:
    """A mesh with one texture image.

    Attributes:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int.
        uv: (m, 3, 2) float: texture coordinates of the corners, 0 to 1, origin at the top left.
        image: (h, w, 3) uint8, RGB.
    """

    vertices: np.ndarray
    faces: np.ndarray
    uv: np.ndarray
    image: np.ndarray


def textured_model(
    scene: Scene,
    vertices: np.ndarray,
    largest: int = 4096,
    on_progress: Callable[[float], None] = lambda fraction: None,
) -> TexturedModel:
    """Paint the scene's mesh from the scene's photos.

    Args:
        vertices: (n, 3) float, world units.
        largest: limit of the texture's width and height, texels; below it a texel is about a photo pixel.
        on_progress: callback with the completed fraction, 0 to 1.

    Raises:
        ValueError: too many faces for the largest texture.
        InputError: a photo cannot be read.
    """
    scores, edges = survey(scene, vertices, lambda fraction: on_progress(0.3 * fraction))
    layout = AtlasLayout.plan(edges, largest)
    chosen = chosen_views(scores)
    image = np.full((layout.height, layout.width, 3), UNSEEN, dtype=np.float32)
    log_gain = np.zeros(chosen.shape)
    texels = most_texels(layout)
    groups = np.cumsum(texels) // max(1, SAMPLE_BYTES // (VIEWS_PER_FACE * 4))
    n_groups = int(groups[-1]) + 1
    for group in range(n_groups):
        members = np.flatnonzero(groups == group)
        starts, colors, weights = sample(
            scene, vertices, layout, chosen, scores, members,
            lambda fraction, group=group: on_progress(0.3 + 0.65 * (group + fraction) / n_groups),
        )  # fmt: skip
        fuse(
            members, starts, colors, weights, layout.corner, layout.legs, layout.is_turned, layout.gutter, image, log_gain
        )  # fmt: skip
    gain = exposures(layout, chosen, log_gain, len(scene.views))[0]
    multiply(layout.corner, layout.legs, layout.is_turned, layout.gutter, gain.astype(np.float32), image)
    on_progress(1.0)
    return TexturedModel(vertices, scene.mesh.faces, layout.uv, np.clip(image + 0.5, 0, 255).astype(np.uint8))
