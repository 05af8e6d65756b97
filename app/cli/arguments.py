"""Arguments that several commands have in common."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import tyro

from fairing.io import PhotoChoice
from fairing.io.photo_choice import SceneFormat
from fairing.options import PRESETS, FairingOptions

ALL_PHOTOS = PhotoChoice()
SceneArgument = Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")]
PhotosArgument = Annotated[PhotoChoice, tyro.conf.arg(name="")]


@dataclass(frozen=True)
class ConvertedPhotos(PhotoChoice):
    """Photo choice of `convert`, whose `--format` is the format it writes."""

    format: Annotated[SceneFormat | None, tyro.conf.arg(name="from-format")] = None
    """Format to read where a folder holds cameras in several. Default: the readable one with the most photos, then with
    sparse points."""

    def choice(self) -> PhotoChoice:
        """The same choice as every other command has it."""
        return PhotoChoice(**vars(self))


ALL_CONVERTED_PHOTOS = ConvertedPhotos()
ConvertedPhotosArgument = Annotated[ConvertedPhotos, tyro.conf.arg(name="")]
Preset = Literal["accurate", "paper"]


def chosen_preset(arguments: Sequence[str]) -> FairingOptions:
    """The parser's defaults depend on --preset, so it is looked up before parsing; a wrong name fails there."""
    chosen = "accurate"
    for i, argument in enumerate(arguments):
        if argument == "--preset" and i + 1 < len(arguments):
            chosen = arguments[i + 1]
        elif argument.startswith("--preset="):
            chosen = argument.partition("=")[2]
    return PRESETS.get(chosen, PRESETS["accurate"])
