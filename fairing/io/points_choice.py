"""Names of the choices of sparse points and cameras, and how many given points are enough."""

from pathlib import Path
from typing import cast, get_args

from fairing.errors import InputError
from fairing.scene import Around, CamerasChoice, PointsChoice

POINTS_PER_VERTEX = 3
"""Given points are enough for a mesh with that many for each vertex: the three coordinates of a vertex need the distances
of at least three points from faces around it."""
POINTS_WITHOUT_MESH = 500
"""Given points are enough to triangulate a mesh from that many (ledger: given points that are enough)."""


def are_enough(n_points: int, n_vertices: int | None) -> bool:
    """Whether given points need no further points from the photos.

    Args:
        n_vertices: of the mesh; None if the mesh is to be triangulated from the points.
    """
    return n_points >= (POINTS_WITHOUT_MESH if n_vertices is None else POINTS_PER_VERTEX * n_vertices)


def check_points_choice(name: str, where: Path) -> PointsChoice:
    """The choice of points of that name.

    Raises:
        InputError: there is none; the message begins with `where`.
    """
    return cast("PointsChoice", _checked(name, get_args(PointsChoice), f"{where}: points"))


def check_cameras_choice(name: str, where: Path) -> CamerasChoice:
    """The choice of cameras of that name; raises as `check_points_choice`."""
    return cast("CamerasChoice", _checked(name, get_args(CamerasChoice), f"{where}: cameras"))


def check_around(name: str, where: Path) -> Around:
    """The choice of points to triangulate of that name; raises as `check_points_choice`."""
    return cast("Around", _checked(name, get_args(Around), f"{where}: around"))


def _checked(name: str, choices: tuple[str, ...], where: str) -> str:
    if name not in choices:
        raise InputError(f"{where}: expected one of {', '.join(choices)}, found {name}")
    return name
