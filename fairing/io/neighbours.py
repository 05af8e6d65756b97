"""Files beside a mesh that it refers to: data, materials and textures. Only regular files in its folder or below are read."""

import re
import shutil
from pathlib import Path, PurePath
from urllib.parse import unquote

from fairing.errors import InputError
from fairing.io.atomic import write_atomically
from fairing.io.capture import PHOTO_SUFFIXES, reading

MAX_BYTES = 1 << 30
"""Of all files that one mesh file refers to."""
_MOST_COPIED = 1 << 34
"""Bytes of the materials and textures of one mesh."""
_COPIED = PHOTO_SUFFIXES | {".mtl"}
_TEXTURE_LINE = re.compile(rb"^\s*(?:map_\w+|bump|disp|decal|norm|refl)\s+(.+?)\s*$", re.MULTILINE | re.IGNORECASE)
_LARGEST_MATERIAL = 1 << 24
"""Bytes of a material file whose textures are copied too."""


class Neighbours:
    """The files that a mesh file refers to, at most `MAX_BYTES` in all."""

    def __init__(self, path: Path) -> None:
        self._path, self._bytes_left = path, MAX_BYTES

    def read(self, name: str) -> bytes:
        """The bytes of a file by its name or percent-encoded URI.

        Raises:
            InputError: no such file in the folder of the mesh, a pipe or device, or too much data.
        """
        found = self._find(name)
        with reading(found, f"a file that {self._path.name} refers to"):
            size = found.stat().st_size
            if size > self._bytes_left:
                raise InputError(
                    f"{self._path}: expected references to at most {MAX_BYTES >> 20} MiB, found more with {found.name!r}; "
                    "export the mesh again"
                )
            self._bytes_left -= size
            return found.read_bytes()

    def _find(self, name: str) -> Path:
        """The file of this name, as it is or percent-encoded; of a path that leads elsewhere, the file beside the mesh."""
        for candidate in (unquote(name), name, name.rpartition("/")[2]):
            if path := _inside(self._path.parent, candidate):
                return path
        raise InputError(
            f"{self._path}: expected the files it refers to in its folder, found no {name[:80]!r} there; copy it there"
        )


def copy_neighbours(path: Path, names: tuple[str, ...], folder: Path) -> list[Path]:
    """Copy the materials and textures that a mesh file refers to into another folder, under the same names.

    Names of files that do not exist, lie elsewhere or are no material or image are left alone: the reference is as good as it
    was. Textures that material files name are copied too.

    Returns:
        The files written.

    Raises:
        InputError: a file is too large, cannot be read, or cannot be written.
    """
    written, waiting, bytes_left = [], list(dict.fromkeys(names)), _MOST_COPIED
    seen = set(waiting)
    while waiting:
        name = waiting.pop()
        found = None if ".." in PurePath(name).parts else _inside(path.parent, name)
        if found is None or not found.is_file() or found.suffix.lower() not in _COPIED:
            continue
        target = folder / name
        with reading(found, f"a file that {path.name} refers to"):
            bytes_left -= found.stat().st_size
            if bytes_left < 0:
                raise InputError(
                    f"{path}: expected materials and textures of at most {_MOST_COPIED >> 30} GiB, found more with {name!r}"
                )
            if target.exists() and target.samefile(found):
                continue
            target.parent.mkdir(parents=True, exist_ok=True)
            with found.open("rb") as source:
                write_atomically(target, lambda file, source=source: shutil.copyfileobj(source, file))
            written.append(target)
            if found.suffix.lower() == ".mtl" and found.stat().st_size <= _LARGEST_MATERIAL:
                textures = _textures(found.read_bytes(), name) - seen
                seen |= textures
                waiting += sorted(textures)
    return written


def _textures(material: bytes, name: str) -> set[str]:
    """Names of the images in a material file, relative to the mesh: the end of each line, after possible options."""
    folder = name.rpartition("/")[0]
    found: set[str] = set()
    for match in _TEXTURE_LINE.finditer(material):
        written = match[1].decode("utf-8", "replace").replace("\\", "/")
        for image in (written, written.split()[-1]):
            found.add(f"{folder}/{image}" if folder else image)
    return found


def _inside(folder: Path, name: str) -> Path | None:
    """The existing file of this name if it lies in the folder or below."""
    try:
        folder = folder.resolve()
        path = (folder / name).resolve()
        return path if path.is_relative_to(folder) and path.exists() else None
    except (OSError, ValueError, RuntimeError):  # a name too long, with a NUL, or a loop of links
        return None
