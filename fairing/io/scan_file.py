"""Scan files and match files: range data, and points matched between a scan and the photos."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fairing.errors import InputError
from fairing.io.atomic import write_atomically
from fairing.io.capture import naming, read_text
from fairing.io.mesh_file import read_document
from fairing.io.xyz import read_xyz
from fairing.mesh import Mesh
from fairing.registration.alignment import Match
from fairing.scene import View
from fairing.util.guards import LARGEST_COORDINATE, check_coordinates

SCAN_SUFFIXES = frozenset({".ply", ".xyz", ".obj", ".off", ".stl", ".glb"})


def read_scan(path: Path) -> Mesh | np.ndarray:
    """A surface, or points (n, 3) float where the file holds no faces, in the scan's own frame and unit.

    Raises:
        InputError: no such file, another format, damaged, or numbers that are not finite.
    """
    if path.suffix.lower() == ".xyz":
        points = read_xyz(path)
        check_coordinates(points, str(path))
        return points
    document = read_document(path, "a scan", SCAN_SUFFIXES)
    with naming(path):
        points, faces = document.vertices, document.faces
    check_coordinates(points, str(path))
    return Mesh(points, faces) if len(faces) else points


def read_points_of_scan(path: Path) -> np.ndarray:
    """The points (n, 3) float of a scan, or the vertices of its surface; exceptions as of `read_scan`."""
    scan = read_scan(path)
    return scan.vertices if isinstance(scan, Mesh) else scan


def write_scan(path: Path, points: np.ndarray) -> None:
    """Write points (n, 3) float as PLY, in double precision."""
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"]
    header += [*(f"property double {axis}" for axis in "xyz"), "end_header", ""]
    data = "\n".join(header).encode() + np.ascontiguousarray(points, dtype="<f8").tobytes()
    write_atomically(path, lambda file: file.write(data))


def read_matches(path: Path, views: Sequence[View]) -> list[Match]:
    """Matched points, one per line: the point in the scan, then its world position or its pixels in photos.

    `x y z  X Y Z` or `x y z  PHOTO u v  [PHOTO u v ...]`, pixel centres at integers; `#` begins a comment.

    Raises:
        InputError: no such file, or a malformed line.
    """
    ids = {view.name: v for v, view in enumerate(views)}
    matches = []
    for number, line in enumerate(read_text(path, "matched points").splitlines(), start=1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        try:
            matches.append(_match(words, ids))
        except ValueError as error:
            raise InputError(
                f"{path}: line {number}: expected `x y z X Y Z` or `x y z PHOTO u v ...`, found {error}"
            ) from None
    return matches


def _match(words: list[str], ids: dict[str, int]) -> Match:
    """The match of a line's words. Raises ValueError with the offending words."""
    point = _numbers(words[:3], 3)
    rest = words[3:]
    if len(rest) == 3 and rest[0] not in ids:
        return Match(point, _numbers(rest, 3))
    if not rest or len(rest) % 3:
        raise ValueError(f"{len(words)} words")
    sightings = []
    for photo, u, v in zip(rest[::3], rest[1::3], rest[2::3], strict=True):
        if photo not in ids:
            raise ValueError(f"a photo {photo[:60]!r} that the capture does not have")
        sightings.append((ids[photo], _numbers([u, v], 2)))
    return Match(point, None, tuple(sightings))


def _numbers(words: list[str], count: int) -> np.ndarray:
    if len(words) != count:
        raise ValueError(f"{len(words)} words")
    try:
        values = np.array([float(word) for word in words])
    except ValueError:
        raise ValueError(" ".join(words)[:60]) from None
    if not (np.abs(values) <= LARGEST_COORDINATE).all():
        raise ValueError(" ".join(words)[:60])
    return values
