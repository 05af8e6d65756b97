"""A guide: one Markdown file, with formulas and links in the form that the site needs."""

import html
import re
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from app.lessons.typeset import formula

ROOT = Path(__file__).parents[2]
"""The folder of the packages: links lead to files of `app`, `fairing` and `demo_scenes`."""
NAMES = ("method", "accuracy", "captures", "debugger", "python", "extending", "files")
"""The guides of this room, in the order of the site's list."""

_CODE = re.compile(r"^(?P<fence>`{3,})[^\n]*\n.*?^(?P=fence)$|`[^`\n]+`", re.DOTALL | re.MULTILINE)
_FORMULA = re.compile(r"\$\$(?P<shown>.+?)\$\$|\$(?P<inline>[^$\n]+)\$", re.DOTALL)
_LINK = re.compile(r"\]\((?P<target>[^()\s]+)\)")
_WHOLE_LINK = re.compile(r"(?P<picture>!?)\[(?P<text>[^\[\]]*)\]\([^()\s]+\)")


@dataclass(frozen=True)
class Section:
    """A part of a guide below one heading.

    Attributes:
        title: the heading, without marks; of the part before the first one, the title of the guide.
        anchor: fragment of the heading's address, as GitHub and pdoc form it; empty before the first one.
        text: Markdown without links and pictures, whose addresses depend on the page that shows it.
    """

    title: str
    anchor: str
    text: str


@dataclass(frozen=True)
class Guide:
    """A guide as it is in its file.

    Attributes:
        path: of the file.
        text: Markdown.
    """

    path: Path
    text: str

    @property
    def name(self) -> str:
        """The name of its page."""
        return self.path.stem

    @property
    def title(self) -> str:
        """The heading of the file."""
        return self.text.partition("\n")[0].removeprefix("# ")

    @property
    def about(self) -> str:
        """The first paragraph below the title, in one line."""
        return " ".join(self.text.split("\n\n")[1].split())

    @property
    def targets(self) -> list[str]:
        """Where its links and pictures lead, as written."""
        texts = (_FORMULA.sub("", piece) for piece in _pieces(self.text)[::2])
        return [found["target"] for text in texts for found in _LINK.finditer(text)]

    def file_of(self, target: str) -> Path:
        """The file that a link's target names, without its fragment."""
        return (self.path.parent / target.partition("#")[0]).resolve() if target[0] != "#" else self.path

    def page_text(self, address: Callable[[str], str]) -> str:
        """Markdown with formulas as MathML, which browsers render without any download.

        Args:
            address: from a link's target, as written, to its address in the site.
        """
        return _outside_code(
            self.text, lambda piece: _LINK.sub(lambda found: f"]({address(found['target'])})", _typeset(piece))
        )

    @property
    def sections(self) -> list[Section]:
        """The parts below its headings of the second level, in their order."""
        begins = [found.start() for found in _headings(self.text)]
        parts = [self.text[a:b] for a, b in zip([0, *begins], [*begins, len(self.text)], strict=True)]
        return [self._section(part) for part in parts]

    def _section(self, part: str) -> Section:
        heading, _, text = part.partition("\n")
        title = heading.lstrip("# ").replace("`", "")
        text = _WHOLE_LINK.sub(lambda found: "" if found["picture"] else found["text"], _outside_code(text, _typeset))
        return Section(title, slug(title) if heading.startswith("## ") else "", text.strip())


def guides() -> list[Guide]:
    """All guides, in the order of the site's list: the README, unless the packages are installed without it, those of this room,
    and the one of the lessons."""
    room = [Path(__file__).with_name(f"{name}.md") for name in NAMES]
    paths = [ROOT / "README.md", *room, ROOT / "app" / "lessons" / "for_teachers.md"]
    return [Guide(path, path.read_text(encoding="utf-8")) for path in paths if path in room or path.exists()]


def slug(heading: str) -> str:
    """The fragment of a heading's address, as GitHub forms it."""
    return re.sub(r"\s", "-", re.sub(r"[^\w\s-]", "", heading.lower().strip()))


def _headings(text: str) -> list[re.Match]:
    """Where lines begin with `## `, outside code."""
    code = [found.span() for found in _CODE.finditer(text)]
    found = re.finditer(r"^## ", text, re.MULTILINE)
    return [match for match in found if not any(a <= match.start() < b for a, b in code)]


def _pieces(text: str) -> list[str]:
    """The text in pieces, in turn outside of code and code."""
    spans = [found.span() for found in _CODE.finditer(text)]
    ends = [0, *(end for span in spans for end in span), len(text)]
    return [text[a:b] for a, b in pairwise(ends)]


def _outside_code(text: str, change: Callable[[str], str]) -> str:
    pieces = _pieces(text)
    pieces[::2] = map(change, pieces[::2])
    pieces[1::2] = map(_as_html, pieces[1::2])
    return "".join(pieces)


def _as_html(code: str) -> str:
    """A block that contains fences, which pdoc's Markdown would take for blocks of their own, as HTML; other code as it is."""
    if not code.startswith("````"):
        return code
    lines = html.escape("\n".join(code.splitlines()[1:-1])).replace("`", "&#96;")
    return f'<div class="pdoc-code codehilite"><pre><code>{lines}</code></pre></div>'


def _typeset(piece: str) -> str:
    def mathml(found: re.Match) -> str:
        if found["shown"]:
            return f"<div>{formula(found['shown'], is_block=True)}</div>"
        return formula(found["inline"], is_block=False)

    return _FORMULA.sub(mathml, piece)
