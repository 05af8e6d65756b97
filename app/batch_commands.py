"""The commands that write files and end: everything but the debugger."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Literal

import tyro
from rich.console import Console

from app.arguments import ALL_PHOTOS, PhotosArgument, Preset, SceneArgument, chosen_preset
from app.check_command import check_to_console
from app.convert_command import convert_to_folder
from app.demo_scan import write_demo_scan
from app.experiment_command import list_experiments
from app.export.command import export_to_file
from app.headless import fair_to_folder
from app.open_run import find_run
from app.register_command import register_to_file
from app.run_extras import TEXTURE_SIZE, RunExtras
from app.scene_source import SceneSource
from app.texture_command import texture_to_file
from app.triangulate_command import triangulate_to_file
from demo_scenes import BUILDING, DEMOS
from fairing.options import FairingOptions
from fairing.triangulation import TriangulationOptions

_TRIANGULATION = TriangulationOptions()
_NO_EXTRAS = RunExtras()


def check(
    scene: SceneArgument, mesh: Path | None = None, out: Path | None = None, photos: PhotosArgument = ALL_PHOTOS
) -> int:
    """Say whether a scene can be faired: cameras, coverage, sizes, and what to do.

    Args:
        scene: A demo's name or a folder or file with photos and cameras.
        mesh: The mesh to fair. Default: the one the scene names, or the only one in its folder, or sparse points triangulated.
        out: Folder for the mesh drawn over every photo and for check.json.
    """
    return check_to_console(SceneSource.typed(scene, mesh, photos), out, Console())


def convert(
    scene: SceneArgument,
    out: Path,
    mesh: Path | None = None,
    format: Literal["colmap", "scene.json"] = "colmap",
    photos: PhotosArgument = ALL_PHOTOS,
) -> int:
    """Write a scene in another format, with its photos straightened, sparse points, masks and mesh.

    Args:
        scene: A demo's name or a folder or file with photos and cameras.
        out: Folder for the copy: new, empty, or of an earlier conversion.
        mesh: The mesh to put beside. Default: the one the scene names, or the only one in its folder, if any.
        format: colmap: a COLMAP text model, sparse/ and images/. scene.json: EigenFairing's own.
    """
    return convert_to_folder(SceneSource.typed(scene, mesh, photos), out, format, Console(stderr=True))


def texture(
    scene: SceneArgument,
    out: Path,
    mesh: Path | None = None,
    size: int = TEXTURE_SIZE,
    photos: PhotosArgument = ALL_PHOTOS,
) -> int:
    """Write a mesh with a texture painted from the photos, for other programs.

    Args:
        scene: A demo's name or a folder or file with photos and cameras.
        out: The model: .glb, .obj (with .mtl and .png) or .ply (with .png).
        mesh: The mesh to paint. Default: the one the scene names, or the only one in its folder, or sparse points triangulated.
        size: Width and height of the texture at most; within it a texel is about a photo's pixel.
    """
    return texture_to_file(SceneSource.typed(scene, mesh, photos), out, size, Console(stderr=True))


def triangulate(
    scene: SceneArgument,
    out: Path,
    mesh: Path | None = None,
    max_vertices: int | None = None,
    spacing: float = _TRIANGULATION.spacing,
    photos: PhotosArgument = ALL_PHOTOS,
) -> int:
    """Make a start mesh from sparse points: a Delaunay triangulation, then edges flipped where photos agree better.

    Args:
        scene: A demo's name or a folder or file with photos, cameras and sparse points.
        out: The mesh (.ply or .obj); beside it go the record of flips (.flips) and a report (.report.json).
        mesh: Flip the edges of this mesh instead.
        max_vertices: At most so many points become vertices: those that most photos see, well spread.
        spacing: Smallest distance of two vertices in the central photo, pixels.
    """
    options = TriangulationOptions(max_vertices=max_vertices, spacing=spacing)
    return triangulate_to_file(SceneSource.typed(scene, mesh, photos), out, options, Console(stderr=True))


def register(
    scene: SceneArgument,
    scan: Path,
    matches: Path,
    out: Path,
    spacing: float = 2.0,
    photos: PhotosArgument = ALL_PHOTOS,
) -> int:
    """Bring a scan into the frame of the photos, and make a start mesh of the points where it bends or ends.

    Args:
        scene: A folder or file with photos and cameras.
        scan: Range data in a frame of its own: points or a mesh (.ply, .xyz, .obj, .off, .stl, .glb).
        matches: Text file of at least three points, a line each: `x y z X Y Z` (scan, world) or `x y z PHOTO u v ...`.
        out: The start mesh: .ply or .obj. Beside it go the moved scan, the record of flips and a report.
        spacing: Between points where the scan bends or ends, percent of its diagonal.
    """
    return register_to_file(SceneSource.typed(scene, None, photos), scan, matches, out, spacing, Console(stderr=True))


def export(
    run: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")],
    out: Path,
    at: str | None = None,
    report: bool = False,
    scene: str | None = None,
    mesh: Path | None = None,
    photos: PhotosArgument = ALL_PHOTOS,
) -> int:
    """Write a recorded run as one file to hand out: a page (.html), a picture (.png) or a video (.mp4, .webm, .gif).

    Args:
        run: The folder `fair` wrote, or its run.trace.
        out: .html: a page that replays the run, offline. .png: the textured mesh before and after. .mp4, .webm, .gif: a video.
        at: The moment a page opens at or a picture shows: level:sweep:vertex:iteration from 1, `start` or `end`.
        report: With .html: figures and pictures to read and print instead of the replay.
        scene: The scene it was recorded on, where it has moved. Default: where the run says it was.
        mesh: The mesh it was recorded on. Default: where the run says it was; with --scene the scene's own.
    """
    return export_to_file(lambda: find_run(run, scene, mesh, photos), out, at, report, Console(stderr=True))


def demos(scan: Path | None = None) -> int:
    """List the scenes that come with the program.

    Args:
        scan: Write the facade there as somebody has it who scanned it: photos, sparse points, and a scan to `register`.
    """
    console = Console()
    if scan is not None:
        return write_demo_scan(scan, console)
    for demo in [*DEMOS.values(), BUILDING]:
        console.print(f"{demo.name:15}{demo.description}", highlight=False, soft_wrap=True)
    return 0


def experiment() -> int:
    """Measure what to expect: `experiment NAME [SCENE] --out DIR`; without a name it lists them."""
    return list_experiments(Console())


def _fair_command(default: FairingOptions) -> Callable[..., int]:
    """`fair` with the options of the chosen preset as the defaults of its flags."""

    def fair(
        scene: SceneArgument,
        out: Path,
        mesh: Path | None = None,
        preset: Preset = "accurate",
        resume: bool = False,
        extras: Annotated[RunExtras, tyro.conf.arg(name="")] = _NO_EXTRAS,
        photos: PhotosArgument = ALL_PHOTOS,
        options: Annotated[FairingOptions, tyro.conf.arg(name="")] = default,
    ) -> int:
        """Fair a scene's mesh without a browser; writes mesh.ply, report.json and run.trace.

        Args:
            scene: A demo's name or a folder or file with photos and cameras.
            out: Folder for the results: new, empty, or of an earlier run.
            mesh: The mesh to fair. Default: the one the scene names, or the only one in its folder, or sparse points triangulated.
            preset: Options to begin with; further flags change single ones.
            resume: Go on with the run in `out`, recorded on the same scene with the same options.
        """
        console = Console(stderr=True)
        return fair_to_folder(SceneSource.typed(scene, mesh, photos), out, preset, options, resume, extras, console)

    return fair


def batch_commands(arguments: Sequence[str]) -> dict[str, Callable[..., int]]:
    """All of them by name; the defaults of `fair` depend on the preset among the arguments."""
    return {
        "fair": _fair_command(chosen_preset(arguments)),
        "check": check,
        "convert": convert,
        "texture": texture,
        "triangulate": triangulate,
        "register": register,
        "export": export,
        "demos": demos,
        "experiment": experiment,
    }
