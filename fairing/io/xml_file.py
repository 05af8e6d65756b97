"""XML files read element by element: errors name the file and the element. No declarations of types or entities."""

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np

from fairing.errors import InputError
from fairing.io.capture import naming, read_text
from fairing.io.json_file import beginning_of
from fairing.util.guards import check_regular_file

LARGEST_FILE = 50_000_000
"""Bytes: the parsed document takes many times as much memory, and no camera file of any project is nearly as large."""
_DECLARATION = re.compile(r"<!\s*(DOCTYPE|ENTITY)", re.IGNORECASE)


def read_xml(path: Path, expected: str) -> ElementTree.Element:
    """The root of a file in UTF-8. Declarations are refused, so that no entity expands and no other file is read.

    Raises:
        InputError: the file cannot be read, is too large, or is no XML.
    """
    check_regular_file(path, expected)
    if path.is_file() and path.stat().st_size > LARGEST_FILE:
        raise InputError(
            f"{path}: expected {expected} of at most {LARGEST_FILE / 1e6:g} MB, found {path.stat().st_size / 1e6:.0f}"
        )
    text = read_text(path, expected)
    with naming(path):
        if _DECLARATION.search(text):
            raise InputError(
                "expected XML without DOCTYPE and ENTITY declarations, found one; export the cameras again"
            )
        try:
            return ElementTree.fromstring(text)
        except ElementTree.ParseError as error:
            raise InputError(f"line {error.position[0]}: expected XML ({str(error).split(':')[0]})") from None
        except ValueError as error:  # an encoding that contradicts the text
            raise InputError(f"expected XML ({error})") from None


def holds_tags(path: Path, *tags: str) -> bool:
    """Whether the first 64 KiB of an .xml file hold all these tags; the file may be damaged."""
    beginning = beginning_of(path) if path.suffix.lower() == ".xml" else b""
    return all(f"<{tag}".encode() in beginning for tag in tags)


def numbers(element: ElementTree.Element | None, count: int, what: str) -> np.ndarray:
    """The finite numbers (count,) in the text of an element.

    Raises:
        InputError: there is no element, or its text is something else.
    """
    words = (element.text or "").split() if element is not None else []
    try:
        values = np.array([float(word) for word in words[: count + 1]])
    except ValueError:
        values = np.zeros(0)
    if len(values) != count or len(words) != count or not np.isfinite(values).all():
        found = "nothing" if not words else " ".join(words)[:60]
        raise InputError(f"{what}: expected {count} finite numbers, found {found}")
    return values


def number(parent: ElementTree.Element, tag: str, what: str, default: float | None = None) -> float:
    """The number in a child, or the default where there is no such child."""
    child = parent.find(tag)
    if child is None and default is not None:
        return default
    return float(numbers(child, 1, f"{what}: {tag}")[0])


def whole_attribute(element: ElementTree.Element, name: str, what: str) -> int:
    """A positive whole number in an attribute."""
    text = element.get(name, "")
    if not (text.isascii() and text.isdigit() and len(text) <= 9 and int(text) > 0):
        raise InputError(f"{what}: expected a positive whole number as {name}, found {text[:40]!r}")
    return int(text)
