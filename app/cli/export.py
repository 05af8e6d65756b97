"""`export`: a recorded run as a page, a report, a picture or a video; and lessons as pages."""

from collections.abc import Callable, Sequence
from pathlib import Path

from rich.console import Console

from app.cli.arguments import (
    ALL_PHOTOS,
    OwnArgument,
    PhotosArgument,
    RecordedMeshArgument,
    RecordedSceneArgument,
    RunArgument,
)
from app.cli.export_lesson import export_lesson, export_lessons
from app.cli.lines import note_outside_photos, print_line
from app.cli.loading import open_session
from app.cli.progress_bar import progress_bar
from app.debugger.moment_id import find_moment, parse_moment_id
from app.export.page import write_page
from app.export.picture import write_picture
from app.export.report_page import write_report
from app.export.run_facts import RunFacts
from app.export.video import write_video
from app.files.recorded_run import find_run
from app.files.scene_source import SceneSource
from fairing.errors import InputError
from fairing.options import options_from_dict
from fairing.trace import Trace

PAGE, PICTURE, VIDEOS = ".html", ".png", (".mp4", ".webm", ".gif")


def export(
    out: Path,
    run: RunArgument = None,
    lesson: str | None = None,
    lessons: bool = False,
    at: str | None = None,
    report: bool = False,
    scene: RecordedSceneArgument = None,
    mesh: RecordedMeshArgument = None,
    photos: PhotosArgument = ALL_PHOTOS,
    own: OwnArgument = (),
) -> int:
    """Write a recorded run as one file to share: a page (.html), a picture (.png) or a video (.mp4, .webm, .gif).
    With --lesson or --lessons: a lesson, or all lessons, as pages that need no server.

    Args:
        out: .html: a page that replays the run, offline. .png: the textured mesh before and after. .mp4, .webm, .gif: a video.
            With --lessons: a folder.
        lesson: Write this lesson (a name, or a Markdown file) as a page. The lesson `capture` uses the scene of --scene, by
            default the demo archway.
        lessons: Write all lessons as pages, and an index of them.
        at: The moment at which a page opens or that a picture shows: level:sweep:vertex:iteration from 1, `start` or `end`.
        report: With .html: a report with figures and pictures, to read and print, instead of the replay.
    """
    console = Console(stderr=True)
    if [run is not None, lesson is not None, lessons].count(True) != 1:
        raise InputError("export: expected one of RUN, --lesson NAME and --lessons")
    if run is not None:
        return export_to_file(lambda: find_run(run, scene, mesh, photos), out, at, report, console, own)
    if at is not None or report or own:
        raise InputError("--at, --report, --with: apply to a RUN; leave them out with --lesson and --lessons")
    if lesson is not None:
        source = None if scene is None else SceneSource.typed(scene, mesh, photos, "automatic")
        return export_lesson(lesson, source, out, console)
    if (scene, mesh, photos) != (None, None, ALL_PHOTOS):
        raise InputError(
            "--lessons: uses the demo scenes; for a scene of your own write --lesson capture --scene SCENE"
        )
    return export_lessons(out, console)


def export_to_file(
    find_run: Callable[[], tuple[Trace, SceneSource, Path]],
    out: Path,
    at: str | None,
    report: bool,
    console: Console,
    own: Sequence[Path] = (),
) -> int:
    """Write the file in the format of its ending. An existing file is replaced only by a complete one.

    Args:
        find_run: returns the trace, its scene and its path; called after the other arguments are checked.
        at: name of a moment.
        report: with .html: the report instead of the replay.
        own: files with the run's own terms, for their pulls.

    Returns:
        Exit code 0.

    Raises:
        InputError: no such ending or moment, or the run or its scene cannot be read.
    """
    ending = out.suffix.lower()
    _check(out, ending, at, report)
    trace, source, path = find_run()
    wanted = None if at is None else parse_moment_id(at, options_from_dict(trace.header["options"]).n_levels)
    session = open_session(source, console, trace=trace, own=own)
    note_outside_photos(console, source.scene, session.scene.views)
    moment = None if wanted is None else find_moment(trace, wanted)
    facts = RunFacts(session, path.parent)
    thinned = ""
    with progress_bar(console) as bar:
        task = bar.add_task(f"making {out.name}", total=1.0)

        def on_progress(fraction: float) -> None:
            bar.update(task, completed=fraction)

        if ending == PAGE and report:
            write_report(facts, out, on_progress)
        elif ending == PAGE:
            thinned = write_page(facts, out, moment or 0, on_progress)
        elif ending == PICTURE:
            write_picture(facts, out, moment, on_progress)
        else:
            write_video(facts, out, on_progress)
    size = f"{out.stat().st_size / 1e6:.1f} MB"
    print_line(console, f"wrote {out} ({size}{'; ' * bool(thinned)}{thinned})")
    return 0


def _check(out: Path, ending: str, at: str | None, report: bool) -> None:
    if ending not in (PAGE, PICTURE, *VIDEOS):
        raise InputError(f"--out {out}: expected a file ending in {', '.join((PAGE, PICTURE, *VIDEOS))}")
    if not out.parent.is_dir():
        raise InputError(f"--out {out}: there is no folder {out.parent}; create it first")
    if report and ending != PAGE:
        raise InputError(f"--report: expected --out to end in {PAGE}, found {out.name}")
    if at is not None and (ending in VIDEOS or report):
        raise InputError("--at: a video or a report shows the whole run; leave --at out")
