"""Arguments that several commands have in common."""

from collections.abc import Sequence
from typing import Annotated, Literal

import tyro

from fairing.io import PhotoChoice
from fairing.options import PRESETS, FairingOptions

ALL_PHOTOS = PhotoChoice()
SceneArgument = Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")]
PhotosArgument = Annotated[PhotoChoice, tyro.conf.arg(name="")]
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


FORMER_FLAGS = {"--schedule.start": "--schedule.first-level"}


def with_current_flags(arguments: Sequence[str]) -> list[str]:
    """The arguments with former names of flags replaced by the current ones."""
    current = []
    for argument in arguments:
        name, separator, value = argument.partition("=")
        current.append(FORMER_FLAGS.get(name, name) + separator + value)
    return current
