"""Frames: HTML pages and addresses as results that a notebook displays."""

from dataclasses import dataclass
from html import escape
from pathlib import Path

from fairing.errors import InputError
from fairing.io import write_atomically

MAX_BYTES = 16_000_000  # of a page in a notebook: the notebook file contains it
HEIGHT = 720  # px


@dataclass(frozen=True)
class Frame:
    """A page in a frame without access to the notebook or to a network.

    Attributes:
        html: the page, a complete document.
        about: one line, shown where there is no notebook.
        height: of the frame, px.
    """

    html: str
    about: str
    height: int = HEIGHT

    def __post_init__(self) -> None:
        size = len(self.html.encode())
        if size > MAX_BYTES:
            raise InputError(
                f"{self.about}: the page has {size / 1e6:.0f} MB, and a notebook takes at most {MAX_BYTES / 1e6:.0f} MB; "
                "write it with `eigenfairing export`"
            )

    def save(self, path: Path | str) -> Path:
        """Write the page to a file, which a browser opens."""
        out = Path(path)
        write_atomically(out, lambda file: file.write(self.html.encode()))
        return out

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{escape(self.html)}" sandbox="allow-scripts" title="{escape(self.about)}" loading="lazy" '
            f'style="width:100%;height:{self.height}px;border:0"></iframe>'
        )

    def __repr__(self) -> str:
        return f"<{self.about}; save(path) writes it as a file>"
