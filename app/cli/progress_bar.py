"""Progress bar of the commands: line, bar, percentage and time."""

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn, TimeRemainingColumn


def progress_bar(console: Console, time: ProgressColumn | None = None) -> Progress:
    """A bar that disappears at its end, and is not shown where the console is no terminal.

    Args:
        time: the last column; default: the remaining time.
    """
    columns = TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:3.0f} %")
    return Progress(
        *columns, time or TimeRemainingColumn(), console=console, transient=True, disable=not console.is_terminal
    )
