"""JSON files read item by item: errors name the path of the offending value in the file."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fairing.errors import InputError
from fairing.io.capture import listed, naming, read_text
from fairing.util.guards import check_name


@dataclass(frozen=True)
class Item:
    """A value of a JSON file.

    Attributes:
        where: the path of the value, such as `views[3].camera`; empty for the whole file.
        quoted: whether numbers may be strings ("1.5").
    """

    value: Any
    where: str = ""
    quoted: bool = False

    def __contains__(self, key: str) -> bool:
        return key in self._object()

    def __getitem__(self, key: str) -> "Item":
        """The value of an object's key."""
        content = self._object()
        if key not in content:
            raise InputError(f"{self.where or 'the file'}: expected {key}, found only {listed(content) or 'nothing'}")
        return Item(content[key], f"{self.where}.{key}" if self.where else key, self.quoted)

    def __iter__(self) -> Iterator["Item"]:
        """The items of a list."""
        if not isinstance(self.value, list):
            raise InputError(f"{self.where}: expected a list, found {self.kind}")
        for i, value in enumerate(self.value):
            yield Item(value, f"{self.where}[{i}]", self.quoted)

    @property
    def names(self) -> list[str]:
        """The keys of an object."""
        return list(self._object())

    def text(self, may_be_empty: bool = False) -> str:
        """A string without NUL characters that UTF-8 can hold; not empty by default."""
        if not isinstance(self.value, str) or not (self.value or may_be_empty):
            raise InputError(f"{self.where}: expected a text, found {self.kind}")
        check_name(self.value, self.where)
        return self.value

    def whole(self, lowest: int = 0) -> int:
        """A whole number, which may be written as 3.0."""
        number = self._unquoted()
        if isinstance(number, float) and number.is_integer():
            number = int(number)
        if not isinstance(number, int) or isinstance(number, bool) or number < lowest:
            raise InputError(f"{self.where}: expected a {_WHOLE[lowest]} number, found {self.kind}")
        if number > _LARGEST_WHOLE:
            raise InputError(f"{self.where}: expected a {_WHOLE[lowest]} number below 2^63, found {self.kind}")
        return number

    def number(self) -> float:
        """A finite number."""
        number = self._unquoted()
        if not isinstance(number, int | float) or isinstance(number, bool):
            raise InputError(f"{self.where}: expected a number, found {self.kind}")
        if not abs(number) < 1e300:
            raise InputError(f"{self.where}: expected a finite number, found {self.kind}")
        return float(number)

    def numbers(self, *shape: int) -> np.ndarray:
        """A float array of exactly this shape. Its values may be NaN or infinite."""
        expected = f"{'x'.join(map(str, shape))} numbers"
        try:
            array = np.array(self.value)
        except (ValueError, RecursionError):
            raise InputError(f"{self.where}: expected {expected}, found rows of different lengths") from None
        if array.dtype.kind == "U" and self.quoted:
            try:
                array = array.astype(np.float64)
            except ValueError:
                raise InputError(f"{self.where}: expected {expected}, found {self.kind}") from None
        if array.shape != shape or array.dtype.kind not in "iuf":
            raise InputError(f"{self.where}: expected {expected}, found {self.kind}")
        return array.astype(np.float64)

    @property
    def kind(self) -> str:
        """The value as JSON for messages, at most 40 characters."""
        try:
            text = json.dumps(self.value)
        except RecursionError:
            return "deeply nested JSON"
        return text if len(text) <= 40 else f"{text[:37]}..."

    def _object(self) -> dict[str, Any]:
        if not isinstance(self.value, dict):
            raise InputError(f"{self.where or 'the file'}: expected an object, found {self.kind}")
        return self.value

    def _unquoted(self) -> Any:
        if not (self.quoted and isinstance(self.value, str)):
            return self.value
        for number in (int, float):
            try:
                return number(self.value)
            except ValueError:
                continue
        return None


_WHOLE = {0: "whole", 1: "positive whole"}
_LARGEST_WHOLE = (1 << 63) - 1


def read_json(path: Path, expected: str, quoted: bool = False) -> Item:
    """The content of a JSON file.

    Raises:
        InputError: the file cannot be read, is no JSON, or an object has a key twice.
    """
    text = read_text(path, expected)
    with naming(path):
        try:
            return Item(json.loads(text, object_pairs_hook=_object), quoted=quoted)
        except InputError:
            raise
        except json.JSONDecodeError as error:
            raise InputError(f"line {error.lineno}: expected JSON ({error.msg.lower()})") from None
        except RecursionError:
            raise InputError(f"expected {expected}, found JSON nested too deeply") from None
        except ValueError:  # a number of more digits than Python converts
            raise InputError("expected JSON, found a number of thousands of digits") from None


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) != len(pairs):
        names = [name for name, _ in pairs]
        repeated = next(name for name in names if names.count(name) > 1)
        raise InputError(
            f"expected each key of an object once, found {json.dumps(repeated)[:60]} twice; remove one of them"
        )
    return content


def holds(path: Path, *words: str) -> bool:
    """Whether the first 64 KiB of a JSON file hold all these keys; the file may be damaged."""
    beginning = beginning_of(path) if path.suffix.lower() in (".json", ".sfm") else b""
    return all(f'"{word}"'.encode() in beginning for word in words)


def beginning_of(path: Path) -> bytes:
    """The first 64 KiB of a file; nothing where there is none that can be read."""
    if not path.is_file():
        return b""
    try:
        with path.open("rb") as file:
            return file.read(1 << 16)
    except OSError:
        return b""
