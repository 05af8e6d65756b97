"""Lesson pages: a lesson as one HTML file that opens without a server, and an index of several.

A Content-Security-Policy forbids all requests. The page computes cells and energies at any moment, at any position of a
vertex and for any k from the photos it contains; texts, numbers, claims, certainty, flows, energy profiles and experiments
are computed by the engine when the page is made.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from string import Template

from app.export.assets import asset, offline_document, time_buttons
from app.html import text
from app.lesson_pages.measured import experiment_of, measured_experiment
from app.lesson_pages.page_data import lesson_data
from app.lesson_pages.playing import play_lesson
from app.lesson_pages.texts import all_lines
from app.lessons.lesson import ANY_SCENE, Lesson
from app.lessons.reader import load_lesson
from app.lessons.scenes import load_lesson_scene
from app.page_state.cells_state import PAGES, SPANS
from app.palette import REFERENCE, solid
from fairing.io import write_atomically
from fairing.io.scene_points import with_points
from fairing.scene import Scene

INDEX = "index.html"
STAND_IN = "archway"  # scene of a lesson on any scene, unless another is given
Progress = Callable[[float, str], None]
LoadScene = Callable[[Callable[[float, str], None]], Scene]


def write_lesson(
    name: str,
    out: Path,
    on_progress: Progress,
    *,
    load_scene: LoadScene | None = None,
    with_experiment: bool = True,
    index: str = "",
) -> int:
    """Play a lesson and write its page.

    Args:
        name: of the lesson.
        out: the file; an existing one is replaced only by a complete one.
        on_progress: called with the fraction that is done and a line.
        load_scene: loads the scene of a lesson on any scene; default: a demo.
        with_experiment: measure the experiment that the lesson offers. Without it, its step has no charts.
        index: address of the index; empty if there is none.

    Returns:
        Number of claims that were verified.

    Raises:
        InputError: there is no such lesson, or a claim does not hold on the scene.
    """
    lesson = load_lesson(name)

    def part(first: float, last: float, line: str) -> Callable[[float], None]:
        return lambda fraction: on_progress(first + (last - first) * fraction, line)

    def opening(fraction: float, line: str) -> None:
        on_progress(0.1 * fraction, line)

    if lesson.scene != ANY_SCENE or load_scene is None:
        wanted = STAND_IN if lesson.scene == ANY_SCENE else lesson.scene
        scene = load_lesson_scene(wanted, opening)
    else:
        scene = load_scene(opening)
    scene = with_points(scene, opening)
    played = play_lesson(lesson, scene, part(0.1, 0.4, f"{name}: running the engine"))
    data = lesson_data(played, part(0.4, 0.7, f"{name}: writing the runs"))
    experiment = experiment_of(lesson)
    data["experiment"] = None
    if experiment is not None and with_experiment:
        show = part(0.7, 1.0, f"{name}: experiment {experiment[0]}")
        data["experiment"] = measured_experiment(*experiment, scene, show)
    page = _page(lesson, data, index)
    write_atomically(out, lambda file: file.write(page.encode()))
    on_progress(1.0, name)
    return sum(len(step.findings.claims) for step in played.steps)


def write_lessons(names: Sequence[str], folder: Path, on_progress: Progress) -> dict[str, int]:
    """Write a page for each lesson, and an index of them.

    Returns:
        Number of verified claims of each lesson.

    Raises:
        InputError: a page cannot be made; see `write_lesson`.
    """
    claims = {}
    for n, name in enumerate(names):

        def show(fraction: float, line: str, n: int = n) -> None:
            on_progress((n + fraction) / len(names), line)

        claims[name] = write_lesson(name, folder / f"{name}.html", show, index=INDEX)
    index = _index([load_lesson(name) for name in names])
    write_atomically(folder / INDEX, lambda file: file.write(index.encode()))
    return claims


def _page(lesson: Lesson, data: dict, index: str) -> str:
    back = f"<a class='chip' href='{text(index)}'>All lessons</a>" if index else ""
    body = Template(asset("lesson.html", "app.lesson_pages")).substitute(
        time_buttons=time_buttons(",", "."),
        title=text(lesson.title),
        about=text(lesson.about),
        index=back,
        listing=all_lines(),
        pages="".join(
            f"<button type='button' class='chip' data-page='{p}'>{text(t)}</button>" for p, t in PAGES.items()
        ),
        spans="".join(
            f"<button type='button' class='chip' data-span='{s}'>{text(t)}</button>" for s, t in SPANS.items()
        ),
    )
    title = f"{lesson.title}: an EigenFairing lesson"
    style = f":root {{ --reference:{solid(REFERENCE)}; }}\n{asset('page.css', 'app')}{asset('lesson.css', 'app.lesson_pages')}"
    return offline_document(title, lesson.about, style, body, data, "lesson_pages/web/lesson.js")


def _index(lessons: Sequence[Lesson]) -> str:
    rows = "".join(
        f"<li><a href='{lesson.name}.html'><b>{text(lesson.title)}</b><span>{text(lesson.about)} "
        f"{len(lesson.steps)} steps.</span></a></li>"
        for lesson in lessons
    )
    body = Template(asset("index.html", "app.lesson_pages")).substitute(rows=rows)
    about = f"{len(lessons)} lessons, one file each"
    return offline_document("EigenFairing: lessons", about, asset("index.css", "app.lesson_pages"), body)
