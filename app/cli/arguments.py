"""Arguments that several commands have in common, with their help."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import tyro

from fairing.io import PhotoChoice
from fairing.options import PRESETS, FairingOptions

ALL_PHOTOS = PhotoChoice()
SceneArgument = Annotated[
    str,
    tyro.conf.Positional,
    tyro.conf.arg(
        metavar="SCENE",
        help="Name of a demo (see `eigenfairing demos`), or a folder or file with photos and cameras.",
    ),
]
MeshArgument = Annotated[
    Path | None,
    tyro.conf.arg(
        metavar="PATH",
        help="The mesh. Default: the mesh that the scene names, or the only one in its folder, or a triangulation of its "
        "sparse points.",
    ),
]
RunArgument = Annotated[
    Path,
    tyro.conf.Positional,
    tyro.conf.arg(metavar="RUN", help="The folder that `fair` wrote, or its run.trace."),
]
RecordedSceneArgument = Annotated[
    str | None,
    tyro.conf.arg(
        metavar="SCENE",
        help="The scene of the run, if it has moved. Default: the location that the run recorded.",
    ),
]
RecordedMeshArgument = Annotated[
    Path | None,
    tyro.conf.arg(
        metavar="PATH",
        help="The mesh of the run, if it has moved. Default: the location that the run recorded; with --scene the scene's "
        "own mesh.",
    ),
]
PortArgument = Annotated[
    int, tyro.conf.arg(help="Port of the page. If it is in use, the command ends; choose another one, or 0 for any.")
]
HostArgument = Annotated[
    str, tyro.conf.arg(help="Address to listen on. 0.0.0.0 accepts connections from other machines.")
]
BrowserArgument = Annotated[bool, tyro.conf.arg(help="Open the page in the default browser.")]
PhotosArgument = Annotated[PhotoChoice, tyro.conf.arg(name="")]
Preset = Literal["accurate", "paper"]


def chosen_preset(arguments: Sequence[str]) -> FairingOptions:
    """The options that --preset names.

    The parser's defaults depend on it, so it is looked up before parsing; the parser then reports a wrong name.
    """
    chosen = "accurate"
    for i, argument in enumerate(arguments):
        if argument == "--preset" and i + 1 < len(arguments):
            chosen = arguments[i + 1]
        elif argument.startswith("--preset="):
            chosen = argument.partition("=")[2]
    return PRESETS.get(chosen, PRESETS["accurate"])
