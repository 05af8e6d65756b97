"""The command `eigenfairing`.

Exit codes: 0 done, 1 the input or the run failed (one line says why), 2 wrong usage, 130 cancelled.

The debugger's commands are here. They import as little as possible before the page is served: the engine and the other
commands take a second to import, during which a browser can already load the viewer.
"""

import io
import os
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro
from rich.console import Console

from app.cli.arguments import (
    ALL_PHOTOS,
    DEFAULT_PAGE,
    AroundArgument,
    BoxArgument,
    CamerasArgument,
    MeshArgument,
    OwnArgument,
    PageAddress,
    PageArgument,
    PhotosArgument,
    PointsArgument,
    Preset,
    RecordedMeshArgument,
    RecordedSceneArgument,
    SceneArgument,
    with_current_flags,
)
from app.cli.loading import OpeningProgress, load_with_bar, open_session
from app.cli.photos_alone import check_openable, with_cameras
from app.debugger.moment_id import START, find_moment, parse_moment_id
from app.files.recorded_run import find_run
from app.files.run_files import FLIPS
from app.files.scene_source import SceneSource, write_points_of_run
from fairing.errors import InputError
from fairing.io import PhotoChoice
from fairing.options import PRESETS, FairingOptions, options_from_dict

if TYPE_CHECKING:
    from app.viser_bridge.server import ViewerServer
    from fairing.run.session import Session

DESCRIPTION = (
    "See how photographs pull a triangle mesh onto the truth. "
    "Without a command it opens the demo cube, with the flags of `view`."
)


def view(
    scene: SceneArgument = "cube",
    mesh: MeshArgument = None,
    preset: Preset = "accurate",
    page: PageArgument = DEFAULT_PAGE,
    save_to: Path | None = None,
    at: str = "start",
    lesson: str | None = None,
    points: PointsArgument = "automatic",
    photos: PhotosArgument = ALL_PHOTOS,
    cameras: CamerasArgument = "automatic",
    around: AroundArgument = "automatic",
    box: BoxArgument = None,
    own: OwnArgument = (),
) -> int:
    """Open the debugger on a scene, paused.

    Of photos without cameras a capture is made first, in the cache folder.

    Args:
        preset: Options to start from.
        save_to: File for the record of all steps, for `eigenfairing replay`.
        at: Run to this moment first and open there: level:sweep:vertex:iteration from 1, `start` or `end`.
        lesson: Open this lesson, on the scene that it uses: a name, or a Markdown file (.md). The page lists all lessons.
    """
    console = Console(stderr=True)
    source = SceneSource.typed(scene, mesh, photos, points, cameras, around, box)
    check_openable(source)
    wanted = parse_moment_id(at, PRESETS[preset].n_levels)
    load = None
    if lesson is not None:
        from app.lessons.opening import scene_of_lesson

        load = scene_of_lesson(lesson, source)

    def open_run(opening: OpeningProgress) -> "Session":
        # Imported here: the page is served before the engine is loaded.
        from fairing.run.trace_header import REFINEMENT

        placed = with_cameras(source, console, show=opening.show)
        session = open_session(placed, console, PRESETS[preset], opening=opening, load=load, own=own)
        if lesson is None or session.scene.name == source.scene:  # a lesson's own scene has no name to find it by
            header = session.trace.header
            placed.resolved(session.scene.sparse_points, REFINEMENT in header).note_in(header)
        if save_to is not None:
            write_points_of_run(session.scene.sparse_points, save_to)
        return session

    if at.strip() == START:
        return _serve(open_run, page, title=source.title, save_to=save_to, lesson=lesson)
    from app.cli.run_progress import run_to

    session = open_run(OpeningProgress())
    run_to(session, wanted, console)
    return _serve(lambda _: session, page, title=source.title, save_to=save_to, page_first=False, lesson=lesson)


def replay(
    run: Annotated[
        Path | None,
        tyro.conf.Positional,
        tyro.conf.arg(
            metavar="RUN",
            help="The folder that `fair` wrote, or its run.trace; or the .flips file that `triangulate` wrote. With --meshes: "
            "the folder or file with photos and cameras.",
        ),
    ] = None,
    scene: RecordedSceneArgument = None,
    mesh: RecordedMeshArgument = None,
    page: PageArgument = DEFAULT_PAGE,
    at: str = "start",
    photos: PhotosArgument = ALL_PHOTOS,
    own: OwnArgument = (),
    meshes: tuple[Path, ...] = (),
    save_to: Path | None = None,
) -> int:
    """Open the debugger on a recorded run, with the scene and the photos it was recorded on.

    With --meshes the moments are the meshes that another program made.

    Args:
        at: The moment to open at: level:sweep:vertex:iteration from 1, `start` or `end`.
        meshes: Mesh files of another program, in their order, on the photos of RUN (or of the last word of the list).
        save_to: With --meshes: file for the record, for `replay` and `export`.
    """
    if meshes:
        return _replay_meshes(run, meshes, mesh, page, at, photos, save_to)
    if run is None or save_to is not None:
        found = "no RUN" if run is None else f"--save-to {save_to} without --meshes"
        raise InputError(f"replay: expected RUN, or --meshes with files, found {found}")
    if run.suffix == FLIPS:
        return _replay_flips(run, scene, page, photos)
    trace, source, path = find_run(run, scene, mesh, photos)
    wanted = parse_moment_id(at, options_from_dict(trace.header["options"]).n_levels)

    def open_run(opening: OpeningProgress) -> "Session":
        session = open_session(source, Console(stderr=True), trace=trace, opening=opening, own=own)
        session.go_to(find_moment(trace, wanted))
        return session

    return _serve(open_run, page, title=source.title, recorded_in=path)


def _replay_flips(run: Path, scene: str | None, page: PageAddress, photos: PhotoChoice) -> int:
    from app.cli.serve import serve_app

    def open_app(server: "ViewerServer") -> Callable[[], None]:
        from app.flips.opening import open_flips

        return open_flips(server, run, scene, photos).stop

    serve_app(open_app, page)
    return 0


def _replay_meshes(
    capture: Path | None,
    meshes: Sequence[Path],
    faces: Path | None,
    page: PageAddress,
    at: str,
    photos: PhotoChoice,
    save_to: Path | None,
) -> int:
    from app.files.mesh_series import open_series

    if capture is None:  # the shell put it at the end of the list
        *meshes, capture = meshes
    series = open_series(str(capture), meshes, faces, photos)
    wanted = parse_moment_id(at, FairingOptions().n_levels)

    def open_run(opening: OpeningProgress) -> "Session":
        session = load_with_bar(series.source.scene, series.session, Console(stderr=True), opening.show)
        session.go_to(find_moment(session.trace, wanted))
        return session

    return _serve(open_run, page, title=series.source.title, save_to=save_to)


def _serve(open_run: Callable[[OpeningProgress], "Session"], page: PageAddress, **how: Any) -> int:
    from app.cli.serve import serve

    serve(open_run, address=page, **how)
    return 0


def run(arguments: Sequence[str]) -> int:
    """Execute a command line and return the exit code.

    Raises:
        SystemExit: wrong usage (2) or help (0), from the parser.
    """
    if not arguments or (arguments[0].startswith("-") and arguments[0] not in ("-h", "--help")):
        arguments = ["view", "cube", *arguments]
    arguments, notes = with_current_flags(arguments)
    for note in notes:
        sys.stderr.write(f"note: {note}\n")
    commands: dict[str, Callable[..., int]] = {"view": view, "replay": replay}
    prog, description = "eigenfairing", DESCRIPTION
    if arguments[0] == "experiment" and len(arguments) > 1:
        from app.cli.experiment import ABOUT, experiment_commands

        commands, prog, description = experiment_commands(arguments), "eigenfairing experiment", ABOUT
        arguments = arguments[1:]
    elif arguments[0] not in commands:
        from app.cli.batch_commands import batch_commands

        commands |= batch_commands(arguments)
    try:
        return tyro.extras.subcommand_cli_from_dict(commands, prog=prog, description=description, args=arguments)
    except InputError as error:
        return _fail(str(error))
    except BrokenPipeError:  # the reader of the output, such as `head`, has ended
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # the interpreter still flushes it
        return 1
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
    if isinstance(sys.stdout, io.TextIOWrapper):  # escapes what its encoding lacks, as stderr does
        sys.stdout.reconfigure(errors="backslashreplace")
    code = run(sys.argv[1:])
    # The interpreter aborts if it exits while a daemon thread is inside compiled code, for example while it computes the
    # texture of a large mesh. Everything is saved and closed at this point.
    if any(thread.daemon for thread in threading.enumerate()):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    sys.exit(code)
