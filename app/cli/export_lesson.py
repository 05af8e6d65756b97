"""`export --lesson` and `--lessons`: lessons as pages, with a progress bar."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TypeVar

from rich.console import Console

from app.cli.lines import note_outside_photos, print_line
from app.cli.progress_bar import progress_bar
from app.files.scene_source import SceneSource
from fairing.errors import InputError
from fairing.io import locked_output_folder
from fairing.scene import Scene

PAGE = ".html"
_Written = TypeVar("_Written")


def export_lesson(name: str, source: SceneSource | None, out: Path, console: Console) -> int:
    """Write a lesson as a page.

    Args:
        source: the scene of a lesson on any scene; None: a demo.

    Returns:
        Exit code 0.

    Raises:
        InputError: there is no such lesson, it has a scene of its own, or a claim does not hold on the scene.
    """
    from app.lesson_pages.page import write_lesson
    from app.lessons.lesson import ANY_SCENE
    from app.lessons.reader import load_lesson

    if out.suffix.lower() != PAGE:
        raise InputError(f"--out {out}: expected a file ending in {PAGE}")
    if not out.parent.is_dir():
        raise InputError(f"--out {out}: there is no folder {out.parent}; create it first")
    if source is not None and load_lesson(name).scene != ANY_SCENE:
        raise InputError(f"lesson {name}: has a scene of its own; leave --scene out")

    def load(chosen: SceneSource, progress: Callable[[float, str], None]) -> Scene:
        scene = chosen.load(progress)
        note_outside_photos(console, chosen.scene, scene.views)
        return scene

    load_scene = None if source is None else partial(load, source)
    claims = _with_bar(console, lambda show: write_lesson(name, out, show, load_scene=load_scene))
    print_line(console, f"wrote {out} ({_size(out)}; {claims} claims verified)")
    return 0


def export_lessons(folder: Path, console: Console) -> int:
    """Write all lessons as pages, and their index, into a folder that is new, empty, or of an earlier export.

    Returns:
        Exit code 0.

    Raises:
        InputError: the folder cannot be written, or a claim does not hold.
    """
    from app.lesson_pages.page import INDEX, write_lessons
    from app.lessons.reader import lesson_names

    with locked_output_folder(folder):
        claims = _with_bar(console, lambda show: write_lessons(lesson_names(), folder, show))
    for name, count in claims.items():
        print_line(console, f"{name:14}{_size(folder / f'{name}{PAGE}')}, {count} claims verified")
    print_line(console, f"wrote {folder / INDEX}")
    return 0


def _with_bar(console: Console, write: Callable[[Callable[[float, str], None]], _Written]) -> _Written:
    """The result of `write`, which receives a callback (fraction done, line) that moves the bar."""
    with progress_bar(console) as bar:
        task = bar.add_task("lessons", total=1.0)
        return write(lambda fraction, line: bar.update(task, completed=fraction, description=line))


def _size(path: Path) -> str:
    return f"{path.stat().st_size / 1e6:.1f} MB"
