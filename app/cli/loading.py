"""Loading a scene with a progress bar."""

import time
from collections.abc import Callable
from typing import TypeVar

from rich.console import Console
from rich.progress import Progress

from app.files.scene_source import SceneSource
from fairing.scene import Scene

ShowLine = Callable[[str], None]
SHOW_EVERY = 0.25  # seconds between lines

_Loaded = TypeVar("_Loaded")


def load_with_progress(source: SceneSource, console: Console) -> Scene:
    """The scene of a source. The bar shows rendering of a demo's photos, finding and triangulation of sparse points."""
    return load_with_bar(source.scene, source.load, console)


def load_with_bar(
    name: str,
    load: Callable[[Callable[[float, str], None]], _Loaded],
    console: Console,
    show: ShowLine = lambda line: None,
) -> _Loaded:
    """The result of `load`, which receives a callback (fraction done, line) that moves the bar.

    Ctrl-C raises KeyboardInterrupt.

    Args:
        show: called with the line and the remaining time, a few times a second.
    """
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task, due = bar.add_task(f"opening {name}", total=1.0), 0.0

        def on_progress(fraction: float, line: str) -> None:
            nonlocal due
            bar.update(task, completed=fraction, description=line)
            if time.monotonic() < due:
                return
            due = time.monotonic() + SHOW_EVERY
            left = bar.tasks[0].time_remaining
            show(line if left is None else f"{line}, {round(left)} s left")

        return load(on_progress)
