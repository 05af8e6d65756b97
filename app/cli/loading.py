"""Loading a scene with a progress bar."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from rich.console import Console

from app.cli.progress_bar import progress_bar
from app.files.scene_source import SceneSource
from app.html import duration
from fairing.scene import Scene

ShowProgress = Callable[[str, float | None], None]
"""Called with a line and the finished fraction, 0 to 1, or None."""
SHOW_EVERY = 0.25  # seconds between lines


@dataclass(frozen=True)
class OpeningProgress:
    """What is shown of the opening of a scene, and what the user requests meanwhile.

    Attributes:
        show: shows progress.
        skip_points: whether not to look for points in the photos.
    """

    show: ShowProgress = lambda line, fraction: None
    skip_points: Callable[[], bool] = lambda: False


_Loaded = TypeVar("_Loaded")


def load_with_progress(source: SceneSource, console: Console) -> Scene:
    """The scene of a source. The bar shows rendering of a demo's photos, finding and triangulation of sparse points."""
    return load_with_bar(source.scene, source.load, console)


def load_with_bar(
    name: str,
    load: Callable[[Callable[[float, str], None]], _Loaded],
    console: Console,
    show: ShowProgress = lambda line, fraction: None,
) -> _Loaded:
    """The result of `load`, which receives a callback (fraction done, line) that moves the bar.

    Ctrl-C raises KeyboardInterrupt.

    Args:
        show: called with the line and the remaining time, a few times a second.
    """
    with progress_bar(console) as bar:
        task, due = bar.add_task(f"opening {name}", total=1.0), 0.0

        def on_progress(fraction: float, line: str) -> None:
            nonlocal due
            if bar.tasks[0].finished and fraction < 1:  # another piece of work, which takes its own time
                bar.reset(task)
            bar.update(task, completed=fraction, description=line)
            if time.monotonic() < due:
                return
            due = time.monotonic() + SHOW_EVERY
            left = bar.tasks[0].time_remaining
            show(line if left is None or fraction == 0 else f"{line}; {duration(left)} left", fraction)

        return load(on_progress)
