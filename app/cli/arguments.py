"""Arguments that several commands have in common, with their help."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from fairing.io import PhotoChoice
from fairing.io.points_choice import PointsChoice
from fairing.options import FORMER_OPTIONS, PRESETS, FairingOptions
from fairing.scene import Around, BoxCorners, CamerasChoice


@dataclass(frozen=True)
class PageAddress:
    """Where the page is, and who may open it.

    Attributes:
        host: Address to listen on. 0.0.0.0 accepts connections from other machines, which need the token.
        port: Port of the page. A port that is in use is an error; 0 takes any free port.
        token: Secret that a browser has to present once; the printed address contains it. Default: none on this machine,
            a random one if --host accepts connections from other machines.
        browser: Open the page in the default browser.
    """

    host: str = "127.0.0.1"
    port: int = 8080
    token: str | None = None
    browser: bool = True


DEFAULT_PAGE = PageAddress()
ALL_PHOTOS = PhotoChoice()
SceneArgument = Annotated[
    str,
    tyro.conf.Positional,
    tyro.conf.arg(
        metavar="SCENE",
        help="Name of a demo (see `eigenfairing demos`), or a folder or file with photos and cameras. Of a folder of "
        "photos alone, `fair`, `view`, `check` and `triangulate` compute the cameras first.",
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
PointsArgument = Annotated[
    PointsChoice,
    tyro.conf.arg(
        help="Sparse points: those given with the capture, its own (found in its photos), both, or none. Automatic: the "
        "given ones if they are enough (3 for each vertex of the mesh; without a mesh 500), otherwise its own; for the "
        "demos cube, archway and dome the given ones.",
    ),
]
CamerasArgument = Annotated[
    CamerasChoice,
    tyro.conf.arg(
        help="Cameras: as given, or refined: their poses are corrected by bundle adjustment over points found in the photos. "
        "With refine_lens also focal lengths, principal points and, where none is given, radial distortion. Corrected cameras "
        "are used where held-out points are clearly better with them; `fair` writes them to the folder cameras as a COLMAP "
        "model. Automatic: refine; for demos given.",
    ),
]
OwnArgument = Annotated[
    tuple[Path, ...],
    tyro.conf.arg(
        name="with",
        metavar="FILE",
        help="Python files with terms of your own (subclasses of fairing.OwnTerm), a norm (a subclass of fairing.Norm) or a plan "
        "(a list named plan of fairing.PlanStage): their code is executed. The debugger loads them anew when the file "
        "is saved. Or names that installed packages offer.",
    ),
]
AroundArgument = Annotated[
    Around,
    tyro.conf.arg(
        help="Points that become vertices where there is no mesh: those of the object, in a box around what most photos look at, "
        "without ground and background, or everything. Automatic: the object if the cameras go around it.",
    ),
]
BoxArgument = Annotated[
    BoxCorners | None,
    tyro.conf.arg(
        metavar="X0 Y0 Z0 X1 Y1 Z1",
        help="The points in this box along the axes of the world become vertices where there is no mesh, instead of those that "
        "--around chooses: its corners with the smallest and the largest coordinates. The page helps to choose it.",
    ),
]
RunArgument = Annotated[
    Path | None,
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
PageArgument = Annotated[PageAddress, tyro.conf.arg(name="")]
PhotosArgument = Annotated[PhotoChoice, tyro.conf.arg(name="")]


@dataclass(frozen=True)
class ConvertedPhotos(PhotoChoice):
    """Photo choice of `convert`, whose `--format` is the format it writes."""

    format: Annotated[str | None, tyro.conf.arg(name="from-format")] = None
    """Format to read where a folder holds cameras in several, such as colmap, bundler, scene.json or that of an installed
    package. Default: the readable one with the most photos, then with sparse points."""

    def choice(self) -> PhotoChoice:
        """The photo choice with `--from-format` as its format."""
        return PhotoChoice(**vars(self))


ALL_CONVERTED_PHOTOS = ConvertedPhotos()
ConvertedPhotosArgument = Annotated[ConvertedPhotos, tyro.conf.arg(name="")]
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


FORMER_FLAGS = {"--schedule.start": "--schedule.first-level"}


def with_current_flags(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """The arguments with former names of flags replaced by the current ones, without flags of options that runs no longer have.

    Returns:
        The arguments, and a note for each flag left out.
    """
    current, notes, is_value_of_former = [], [], False
    for argument in arguments:
        name, separator, value = argument.partition("=")
        if is_value_of_former and _is_number(argument):
            continue
        instead = FORMER_OPTIONS.get(name.replace("-", "_").removeprefix("__"))
        is_value_of_former = instead is not None
        if instead is not None:
            notes.append(f"{name} has no effect any more: {instead}")
        else:
            current.append(FORMER_FLAGS.get(name, name) + separator + value)
    return current, notes


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
