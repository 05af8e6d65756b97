"""The JSON of a glTF, read by type: another type is an error that names its place."""

from dataclasses import dataclass
from typing import Any

from fairing.errors import InputError

_MISSING = object()


@dataclass(frozen=True)
class GltfObject:
    """A JSON object and its place in the file."""

    value: dict[str, Any]
    where: str = "glTF"

    def __contains__(self, key: str) -> bool:
        return key in self.value

    def whole(self, key: str, default: Any = _MISSING) -> int:
        """A whole number that is not negative."""
        found = self._get(key, default)
        if isinstance(found, bool) or not isinstance(found, int) or found < 0:
            raise self._unexpected(key, "a whole number")
        return found

    def text(self, key: str, default: Any = _MISSING) -> str:
        found = self._get(key, default)
        if not isinstance(found, str):
            raise self._unexpected(key, "a text")
        return found

    def numbers(self, key: str, default: list[float]) -> list[float]:
        """As many numbers as the default has."""
        found = self._get(key, default)
        is_right = isinstance(found, list) and len(found) == len(default)
        if not is_right or not all(isinstance(x, int | float) and abs(x) < 1e300 for x in found):
            raise self._unexpected(key, f"{len(default)} numbers")
        return [float(x) for x in found]

    def wholes(self, key: str) -> list[int]:
        """Whole numbers that are not negative; none without the key."""
        found = self._get(key, [])
        if not isinstance(found, list) or not all(type(x) is int and x >= 0 for x in found):
            raise self._unexpected(key, "a list of whole numbers")
        return found

    def texts(self, key: str) -> list[str]:
        """Texts; none without the key."""
        found = self._get(key, [])
        if not isinstance(found, list) or not all(isinstance(x, str) for x in found):
            raise self._unexpected(key, "a list of texts")
        return found

    def child(self, key: str) -> "GltfObject":
        """An object; an empty one without the key."""
        found = self._get(key, {})
        if not isinstance(found, dict):
            raise self._unexpected(key, "an object")
        return GltfObject(found, f"{self.where}.{key}")

    def children(self, key: str) -> list["GltfObject"]:
        """A list of objects; an empty one without the key."""
        found = self._get(key, [])
        if not isinstance(found, list) or not all(isinstance(x, dict) for x in found):
            raise self._unexpected(key, "a list of objects")
        return [GltfObject(x, f"{key}[{i}]") for i, x in enumerate(found)]

    def _get(self, key: str, default: Any) -> Any:
        found = self.value.get(key, default)
        if found is _MISSING:
            raise InputError(f"{self.where}: expected {key}, found none; export the mesh again")
        return found

    def _unexpected(self, key: str, expected: str) -> InputError:
        found = repr(self.value.get(key))
        return InputError(f"{self.where}.{key}: expected {expected}, found {found:.60}; export the mesh again")


def item(items: list[GltfObject], index: int, what: str) -> GltfObject:
    """The item with an index that the file gives.

    Raises:
        InputError: there is none.
    """
    if index >= len(items):
        raise InputError(f"{what}: expected 0 to {len(items) - 1}, found {index}; export the mesh again")
    return items[index]
