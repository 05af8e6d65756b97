"""Textured models: all faces of a mesh in one texture atlas, painted from the photos.

What belongs here: the atlas (`layout`, `texels`), the photos that paint each face and their samples (`view_choice`, `samples`),
the static texture (`fusion`, `model`), the view-dependent texture (`eigen`), and software drawing (`draw`).

May import: the data modules of `fairing`, `fairing.util` and `fairing.geometry`.

Offers: `textured_model`, `eigen_texture`, `AtlasLayout`, `Drawing`.
"""

from fairing.texture.draw import Drawing
from fairing.texture.eigen import EigenTexture, eigen_texture
from fairing.texture.layout import AtlasLayout
from fairing.texture.model import TexturedModel, textured_model

__all__ = ["AtlasLayout", "Drawing", "EigenTexture", "TexturedModel", "eigen_texture", "textured_model"]
