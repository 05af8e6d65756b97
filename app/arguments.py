"""Arguments that several commands have in common."""

from typing import Annotated, Literal

import tyro

from fairing.io import PhotoChoice

ALL_PHOTOS = PhotoChoice()
SceneArgument = Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")]
PhotosArgument = Annotated[PhotoChoice, tyro.conf.arg(name="")]
Preset = Literal["accurate", "paper"]
