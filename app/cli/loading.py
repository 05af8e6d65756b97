"""Loading a scene with a progress bar."""

from collections.abc import Callable

from rich.console import Console
from rich.progress import Progress

from app.files.scene_source import SceneSource
from fairing.scene import Scene


def load_with_progress(source: SceneSource, console: Console) -> Scene:
    """The scene of a source. The bar shows rendering of a demo's photos and triangulation of sparse points."""
    return load_with_bar(source.scene, source.load, console)


def load_with_bar(name: str, load: Callable[[Callable[[float, str], None]], Scene], console: Console) -> Scene:
    """The result of `load`, which receives a callback (fraction done, line) that moves the bar."""
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(f"opening {name}", total=1.0)
        return load(lambda fraction, line: bar.update(task, completed=fraction, description=line))
