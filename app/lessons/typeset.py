"""Typesetting of lesson texts as HTML: paragraphs, lists, *emphasis*, **strong**, `code`, formulas and numbers.

Formulas become MathML, which browsers render natively, without any download.
"""

import re
from collections.abc import Callable
from functools import cache

from latex2mathml.converter import convert

from app.html import number, text

_DIGITS = 3
_SPANS = re.compile(
    r"\$\$(?P<shown>.+?)\$\$|\$(?P<formula>[^$]+)\$|`(?P<code>[^`]+)`|\*\*(?P<strong>.+?)\*\*|\*(?P<stress>.+?)\*"
    r"|\{(?P<number>[^{}]+)\}",
    re.DOTALL,
)


@cache
def formula(latex: str, *, is_block: bool) -> str:
    """MathML of a formula."""
    return convert(latex.strip(), display="block" if is_block else "inline")


def paragraphs(markdown: str, numbers: dict[str, float]) -> str:
    """HTML of a text; numbers that are not known yet are shown as an ellipsis."""
    blocks = [block.strip() for block in re.split(r"\n\s*\n", markdown) if block.strip()]
    return "".join(_block(block, numbers) for block in blocks)


def line(markdown: str, numbers: dict[str, float]) -> str:
    """HTML of a single line of text."""

    def replaced(found: re.Match) -> str:
        kind, content = found.lastgroup or "", found.group(found.lastgroup or 0)
        return _MAKERS[kind](content, numbers)

    pieces, at = [], 0
    for found in _SPANS.finditer(markdown):
        pieces += [text(markdown[at : found.start()]), replaced(found)]
        at = found.end()
    return "".join([*pieces, text(markdown[at:])])


def _block(block: str, numbers: dict[str, float]) -> str:
    lines = block.splitlines()
    if all(row.startswith("- ") for row in lines):
        return f"<ul>{''.join(f'<li>{line(row[2:], numbers)}</li>' for row in lines)}</ul>"
    return f"<p>{line(block, numbers)}</p>"


def _number(expression: str, numbers: dict[str, float]) -> str:
    value = numbers.get(expression)
    if value is None:
        return "<b>…</b>"
    return f"<b>{f'{value:.0f}' if value == round(value) else number(value, _DIGITS)}</b>"


_MAKERS: dict[str, Callable[[str, dict[str, float]], str]] = {
    "shown": lambda content, _: formula(content, is_block=True),
    "formula": lambda content, _: formula(content, is_block=False),
    "code": lambda content, _: f"<code>{text(content)}</code>",
    "strong": lambda content, numbers: f"<b>{line(content, numbers)}</b>",
    "stress": lambda content, numbers: f"<em>{line(content, numbers)}</em>",
    "number": _number,
}
