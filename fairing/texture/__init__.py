"""A textured model of a mesh: its faces side by side in one image, painted from the photos."""

from fairing.texture.draw import Drawing
from fairing.texture.eigen import EigenTexture, eigen_texture
from fairing.texture.layout import AtlasLayout
from fairing.texture.model import TexturedModel, textured_model

__all__ = ["AtlasLayout", "Drawing", "EigenTexture", "TexturedModel", "eigen_texture", "textured_model"]
