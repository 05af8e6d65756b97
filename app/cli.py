"""The command `eigenfairing`.

Exit codes: 0 done, 1 the input or the run failed (one line says why), 2 wrong usage, 130 cancelled.
"""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Literal

import tyro
from rich.console import Console

from app.check_command import check_to_console
from app.convert_command import convert_to_folder
from app.headless import TRACE, fair_to_folder, run_to
from app.loading import load_with_progress
from app.moment_id import START, find_moment, parse_moment_id
from app.register_command import register_to_file
from app.run_extras import TEXTURE_SIZE, RunExtras
from app.scene_source import SceneSource
from app.texture_command import texture_to_file
from app.triangulate_command import triangulate_to_file
from demo_scenes import DEMOS
from fairing.errors import InputError
from fairing.io import PhotoChoice
from fairing.options import PRESETS, FairingOptions
from fairing.session import Session
from fairing.trace import Trace
from fairing.triangulation import TriangulationOptions

_ALL_PHOTOS = PhotoChoice()
_TRIANGULATION = TriangulationOptions()
_NO_EXTRAS = RunExtras()
SceneArgument = Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")]
PhotosArgument = Annotated[PhotoChoice, tyro.conf.arg(name="")]
Preset = Literal["accurate", "paper"]


def view(
    scene: SceneArgument = "cube",
    mesh: Path | None = None,
    preset: Preset = "accurate",
    port: int = 8080,
    host: str = "127.0.0.1",
    browser: bool = True,
    save_to: Path | None = None,
    at: str = "start",
    photos: PhotosArgument = _ALL_PHOTOS,
) -> int:
    """Open the debugger on a scene, paused.

    Args:
        scene: A demo's name (see `eigenfairing demos`) or a folder or file with photos and cameras.
        mesh: The mesh to fair. Default: the one the scene names, or the only one in its folder, or sparse points triangulated.
        preset: Options to begin with.
        port: Port of the page; the next free one is taken if it is in use.
        host: Address to listen on. 0.0.0.0 lets other machines in.
        browser: Open the page in the browser.
        save_to: Keep the record of all steps in this file, for `eigenfairing replay`.
        at: The moment to open at, after running up to there: level:sweep:vertex:iteration from 1, `start` or `end`.
    """
    console = Console(stderr=True)
    source = SceneSource.typed(scene, mesh, photos)
    wanted = parse_moment_id(at, PRESETS[preset].n_levels)
    session = Session(load_with_progress(source, console), PRESETS[preset])
    source.note_in(session.trace.header)
    if at.strip() != START:
        run_to(session, wanted, console)
    return _serve(session, host, port, browser, save_to, None)


def check(
    scene: SceneArgument, mesh: Path | None = None, out: Path | None = None, photos: PhotosArgument = _ALL_PHOTOS
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
    photos: PhotosArgument = _ALL_PHOTOS,
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
    photos: PhotosArgument = _ALL_PHOTOS,
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
    photos: PhotosArgument = _ALL_PHOTOS,
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
    photos: PhotosArgument = _ALL_PHOTOS,
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


def demos() -> int:
    """List the scenes that come with the program."""
    console = Console()
    for demo in DEMOS.values():
        console.print(f"{demo.name:10}{demo.description}", highlight=False, soft_wrap=True)
    return 0


def replay(
    run: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")],
    scene: str | None = None,
    mesh: Path | None = None,
    port: int = 8080,
    host: str = "127.0.0.1",
    browser: bool = True,
    at: str = "start",
    photos: PhotosArgument = _ALL_PHOTOS,
) -> int:
    """Open the debugger on a recorded run, with the scene and the photos it was recorded on.

    Args:
        run: The folder `fair` wrote, or its run.trace.
        scene: The scene it was recorded on, where it has moved. Default: where the run says it was.
        mesh: The mesh it was recorded on. Default: where the run says it was; with --scene the scene's own.
        port: Port of the page; the next free one is taken if it is in use.
        host: Address to listen on. 0.0.0.0 lets other machines in.
        browser: Open the page in the browser.
        at: The moment to open at: level:sweep:vertex:iteration from 1, `start` or `end`.
    """
    path = run / TRACE if run.is_dir() else run
    trace = Trace.load(path)
    source = SceneSource.of_replay(trace.header, path, scene, mesh, photos)
    session = Session(load_with_progress(source, Console(stderr=True)), trace=trace)
    session.go_to(find_moment(trace, parse_moment_id(at, session.options.n_levels)))
    return _serve(session, host, port, browser, None, path)


def _fair_command(default: FairingOptions) -> Callable[..., int]:
    """`fair` with the options of the chosen preset as the defaults of its flags."""

    def fair(
        scene: SceneArgument,
        out: Path,
        mesh: Path | None = None,
        preset: Preset = "accurate",
        resume: bool = False,
        extras: Annotated[RunExtras, tyro.conf.arg(name="")] = _NO_EXTRAS,
        photos: PhotosArgument = _ALL_PHOTOS,
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


def _serve(
    session: Session, host: str, port: int, browser: bool, save_to: Path | None, recorded_in: Path | None
) -> int:
    from app.server import serve  # the page's packages take a second to import; only this needs them

    serve(session, host=host, port=port, open_browser=browser, save_to=save_to, recorded_in=recorded_in)
    return 0


def _chosen_preset(arguments: Sequence[str]) -> FairingOptions:
    """The parser's defaults depend on --preset, so it is looked up before parsing; a wrong name fails there."""
    chosen = "accurate"
    for i, argument in enumerate(arguments):
        if argument == "--preset" and i + 1 < len(arguments):
            chosen = arguments[i + 1]
        elif argument.startswith("--preset="):
            chosen = argument.partition("=")[2]
    return PRESETS.get(chosen, PRESETS["accurate"])


def run(arguments: Sequence[str]) -> int:
    """Carry out a command line; returns the exit code.

    Raises:
        SystemExit: wrong usage (2) or help (0), from the parser.
    """
    if not arguments or (arguments[0].startswith("-") and arguments[0] not in ("-h", "--help")):
        arguments = ["view", "cube", *arguments]
    commands = {
        "view": view,
        "fair": _fair_command(_chosen_preset(arguments)),
        "check": check,
        "convert": convert,
        "texture": texture,
        "triangulate": triangulate,
        "register": register,
        "replay": replay,
        "demos": demos,
    }
    try:
        return tyro.extras.subcommand_cli_from_dict(
            commands,
            prog="eigenfairing",
            description="See how photographs pull a triangle mesh onto the truth. "
            "Without a command it opens the demo cube, with the flags of `view`.",
            args=arguments,
        )
    except InputError as error:
        return _fail(str(error))
    except OSError as error:
        return _fail(f"{error.filename or 'disk'}: {error.strerror or error}")
    except MemoryError:
        return _fail("not enough memory; use smaller photos or fewer of them")
    except KeyboardInterrupt:
        _fail("cancelled")
        return 130


def _fail(line: str) -> int:
    sys.stderr.write(f"eigenfairing: {line}\n")
    return 1


def main() -> None:
    """The entry point of the command `eigenfairing`."""
    sys.exit(run(sys.argv[1:]))
