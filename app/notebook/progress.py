"""Progress bars for notebooks and terminals."""

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from html import escape

EVERY = 0.2  # s between two updates
WIDTH = 40  # characters of a bar in a terminal


@contextlib.contextmanager
def progress(title: str) -> Iterator[Callable[[float], None]]:
    """Show a bar while the `with` block runs. The value is a function that takes the fraction done, 0 to 1.

    In a notebook the bar is a display that is updated in place, in a terminal a line, and nothing elsewhere.

        with progress("Fairing") as bar:
            session.run(on_step=lambda _: bar(session.progress))
    """
    show, began, due = _display(title), time.monotonic(), 0.0

    def update(fraction: float) -> None:
        nonlocal due
        now = time.monotonic()
        if now >= due:
            due = now + EVERY
            show(min(max(fraction, 0.0), 1.0), now - began)

    update(0.0)
    try:
        yield update
    except BaseException:
        show(float("nan"), time.monotonic() - began)
        raise
    show(1.0, time.monotonic() - began)


def _display(title: str) -> Callable[[float, float], None]:
    """A function that shows fraction (NaN: stopped) and seconds."""
    IPython = sys.modules.get("IPython")
    shell = None if IPython is None else IPython.get_ipython()
    if shell is not None and hasattr(shell, "kernel"):
        from IPython.display import HTML, display  # pyright: ignore[reportMissingImports] - imported only where it runs

        handle = display(HTML(_bar(title, 0.0, 0.0)), display_id=True)
        return lambda fraction, seconds: handle.update(HTML(_bar(title, fraction, seconds)))
    if sys.stderr.isatty():
        return lambda fraction, seconds: _print_bar(title, fraction, seconds)
    return lambda fraction, seconds: None


def _bar(title: str, fraction: float, seconds: float) -> str:
    if fraction != fraction:
        return f"<div>{escape(title)}: stopped after {seconds:.0f} s</div>"
    return (
        f"<div>{escape(title)} <progress value='{fraction:.3f}' max='1' aria-label='{escape(title)}' "
        f"style='width:min(320px,50%);vertical-align:middle'></progress> {100 * fraction:.0f} %, {seconds:.0f} s</div>"
    )


def _print_bar(title: str, fraction: float, seconds: float) -> None:
    is_over = not 0 <= fraction < 1
    done = 0 if fraction != fraction else round(WIDTH * fraction)
    line = f"\r{title} [{'#' * done}{' ' * (WIDTH - done)}] {seconds:.0f} s"
    sys.stderr.write(line + "\n" * is_over)
    sys.stderr.flush()
