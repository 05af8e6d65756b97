"""Texture keyframes: the texture of the mesh at a few moments of a run. Between two of them, both are blended."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from app.export.run_facts import RunFacts
from fairing.camera import Camera
from fairing.errors import InputError
from fairing.texture import Drawing, textured_model
from fairing.texture.draw import RGB


@dataclass(frozen=True, eq=False)
class TextureKeyframe:
    """Attributes:
    moment: at which the texture was computed.
    uv: (m, 3, 2) float: texture coordinates of the faces' corners, 0 to 1, origin at the top left.
    image: (h, w, 3) uint8, RGB.
    """

    moment: int
    uv: np.ndarray
    image: np.ndarray


def texture_keyframes(
    facts: RunFacts, moments: Sequence[int], largest: int, on_progress: Callable[[float], None]
) -> list[TextureKeyframe]:
    """Compute the texture of the mesh at some moments.

    Args:
        largest: maximal width and height of a texture, texels.
        on_progress: called with the fraction that is done.

    Raises:
        InputError: the mesh has too many faces for the texture, or a photo is missing.
    """
    keyframes = []
    for k, moment in enumerate(moments):
        vertices = facts.trace.vertices_at(moment)
        try:
            model = textured_model(
                facts.scene, vertices, largest, lambda fraction, k=k: on_progress((k + fraction) / len(moments))
            )
        except ValueError as error:
            raise InputError(f"{error}; the mesh is too large for an exported picture") from None
        keyframes.append(TextureKeyframe(moment, model.uv, model.image))
    return keyframes


class KeyframeRenderer:
    """Renders any moment of a run, with textures blended between keyframes."""

    def __init__(self, facts: RunFacts, keyframes: list[TextureKeyframe], camera: Camera, background: RGB) -> None:
        self._facts, self._keyframes, self._camera, self._background = facts, keyframes, camera, background

    def draw(self, moment: float) -> np.ndarray:
        """(h, w, 3) uint8 RGB: the mesh at a moment; between two moments, vertices are interpolated linearly."""
        trace, low = self._facts.trace, int(moment)
        vertices = trace.vertices_at(low)
        if moment > low:
            vertices += (moment - low) * (trace.vertices_at(low + 1) - vertices)
        drawing = Drawing(vertices, trace.faces, self._camera)
        first, second, share = self._between(moment)
        picture = drawing.textured(first.uv, first.image, self._background)
        if share == 0:
            return picture
        other = drawing.textured(second.uv, second.image, self._background)
        return np.clip((1 - share) * picture + share * other + 0.5, 0, 255).astype(np.uint8)

    def _between(self, moment: float) -> tuple[TextureKeyframe, TextureKeyframe, float]:
        """The keyframes before and after a moment, and the weight of the second, 0 to 1."""
        moments = [keyframe.moment for keyframe in self._keyframes]
        k = int(np.searchsorted(moments, moment, side="right")) - 1
        if k + 1 == len(moments):
            return self._keyframes[k], self._keyframes[k], 0.0
        now, low, high = np.interp(
            [moment, moments[k], moments[k + 1]], np.arange(len(self._facts.pace)), self._facts.pace
        )
        return self._keyframes[k], self._keyframes[k + 1], float((now - low) / (high - low)) if high > low else 0.0
