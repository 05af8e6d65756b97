"""Frames of a mesh: the similarity from its coordinates to the world of the cameras, and the ones that are confused."""

from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from fairing.camera import Camera
from fairing.errors import InputError

UNITS = (0.001, 1000.0, 0.01, 100.0, 0.1, 10.0, 0.0254, 1 / 0.0254, 0.3048, 1 / 0.3048)
"""Factors between units of length in use: mm, cm, dm, m, km, inch, foot."""
_NAMES = "xyz"


@dataclass(frozen=True, eq=False)
class MeshFrame:
    """A frame of a mesh: world = linear @ mesh + shift.

    Attributes:
        name: in words, after "the mesh ...".
        linear: (3, 3) float: a rotation times a scale, mirrored for a negative determinant.
        shift: (3,) float, world units.
    """

    name: str
    linear: np.ndarray
    shift: np.ndarray

    @property
    def scale(self) -> float:
        """World units of one unit of the mesh."""
        return float(np.cbrt(abs(np.linalg.det(self.linear))))

    @property
    def is_mirrored(self) -> bool:
        return bool(np.linalg.det(self.linear) < 0)

    @property
    def inverse(self) -> "MeshFrame":
        """The frame with the roles of mesh and world exchanged."""
        linear = np.linalg.inv(self.linear)
        return MeshFrame(self.name, linear, -linear @ self.shift)

    def mesh_from_world(self, points: np.ndarray) -> np.ndarray:
        """Positions (..., 3) in the mesh's frame from world positions (..., 3)."""
        return (points - self.shift) @ np.linalg.inv(self.linear).T

    def camera(self, camera: Camera) -> Camera:
        """The camera with the mesh's frame as its world.

        Raises:
            InputError: the frame is mirrored; no camera sees a mirrored world.
        """
        if self.is_mirrored:
            raise InputError(f"the mesh {self.name} is mirrored: flip one of its axes in the program that made it")
        world_from_mesh = np.vstack([np.column_stack([self.linear, self.shift]), [0, 0, 0, 1]])
        return Camera(camera.image_from_world @ world_from_mesh, camera.width, camera.height)


IDENTITY = MeshFrame("as it is", np.eye(3), np.zeros(3))


def parse_axes(text: str) -> np.ndarray:
    """(3, 3) float: world from mesh by three signed axes of the mesh, such as `x,-z,y`: world = (x, -z, y).

    Raises:
        InputError: these are not three different axes, or they are mirrored.
    """
    parts = text.replace(" ", "").split(",")
    letters = [part.lstrip("+-") for part in parts]
    if sorted(letters) != list(_NAMES) or any(
        len(part) - len(letter) > 1 for part, letter in zip(parts, letters, strict=True)
    ):
        raise InputError(
            f"--mesh-axes: expected x, y and z in any order, each with or without minus (x,-z,y), found {text}"
        )
    linear = np.zeros((3, 3))
    for row, (part, letter) in enumerate(zip(parts, letters, strict=True)):
        linear[row, _NAMES.index(letter)] = -1.0 if part.startswith("-") else 1.0
    if np.linalg.det(linear) < 0:
        raise InputError(f"--mesh-axes: {text} is mirrored; flip one axis of the mesh in the program that made it")
    return linear


def axes_text(linear: np.ndarray) -> str:
    """Signed axes as `parse_axes` reads them, of a signed permutation (3, 3)."""
    return ",".join(("-" if row.min() < 0 else "") + _NAMES[int(np.abs(row).argmax())] for row in linear)


def turned_frames() -> list[MeshFrame]:
    """The 23 other ways to lay the axes of a mesh along the world's, then the 24 mirrored ones."""
    found = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        linear = np.zeros((3, 3))
        linear[range(3), order] = signs
        if not np.array_equal(linear, np.eye(3)):
            found.append(MeshFrame(f"with its axes as ({axes_text(linear).replace(',', ', ')})", linear, np.zeros(3)))
    return sorted(found, key=lambda frame: frame.is_mirrored)


def scaled_frames(frames: list[MeshFrame]) -> list[MeshFrame]:
    """The frames in other units of length, about the origin."""
    return [
        MeshFrame(f"{frame.name}, scaled by {factor:.4g}", factor * frame.linear, factor * frame.shift)
        for frame in frames
        for factor in UNITS
    ]
