"""Scenes: a mesh, its calibrated photos, sparse points and, for synthetic scenes, the true surface."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from fairing.camera import Camera
from fairing.errors import InputError
from fairing.mesh import Mesh
from fairing.photo import Mask, Photo, ResizedPhoto
from fairing.util.guards import check_coordinates, check_name
from fairing.weld import Welded, welded

if TYPE_CHECKING:
    from fairing.cameras.refinement import Refinement
    from fairing.triangulation.object_box import ObjectBox

PointsChoice = Literal["automatic", "given", "own", "both", "none"]
"""Sparse points of a run: "given" with the capture; "own", found in its photos with its cameras; "both"; "none".
"automatic": the given ones if they are enough, else its own (`fairing.io.scene_points`)."""

CamerasChoice = Literal["automatic", "refine", "refine_lens", "given"]
"""Cameras of a run: "given" with the capture, or "refine": poses corrected where held-out points are clearly better with them
(`fairing.cameras`); "refine_lens": focal lengths, principal points and unknown radial distortion, too. "automatic": "refine"
for captures; "given" for demo scenes, whose cameras are exact."""

Around = Literal["automatic", "object", "everything"]
"""Points that become vertices where there is no mesh: those of the object, in a box around what most photos look at, or all.
"automatic": the object's if the cameras go around it (`fairing.triangulation.object_box`)."""

BoxCorners = tuple[float, float, float, float, float, float]
"""x0 y0 z0 x1 y1 z1, world units, of a box along the world's axes: the corners with the smallest and the largest coordinates."""

WEIGHTS = (1e-6, 1e6)
"""Smallest and largest weight of a photo: beyond them the others do not count, and squares of sums lose their digits."""


@dataclass(frozen=True, eq=False)
class View:
    """One calibrated photo.

    Attributes:
        mask: the part of the photo that is used; None for all of it.
        weight: weight of the photo relative to the others, within `WEIGHTS`.

    Raises:
        InputError: photo or mask cannot be read, a size contradicts the camera's, the weight is not within `WEIGHTS`, or the
            name cannot be written to a file.
    """

    name: str
    camera: Camera
    photo: Photo
    mask: Mask | None = None
    weight: float = 1.0

    def __post_init__(self) -> None:
        check_name(self.name, "photo")
        expected, found = (self.camera.width, self.camera.height), self.photo.size
        if self.mask is not None and self.mask.size != expected:
            width, height = self.mask.size
            raise InputError(
                f"mask {self.mask.files[0]}: expected the photo's {expected[0]}x{expected[1]} pixels, found {width}x{height}"
            )
        low, high = WEIGHTS
        if not low <= self.weight <= high:
            raise InputError(
                f"photo {self.name}: expected a weight of {low:g} to {high:g}, found {self.weight:g}; to ignore the photo, "
                "leave it out"
            )
        if expected != found:
            raise InputError(
                f"photo {self.name}: its camera expects {expected[0]}x{expected[1]} pixels, "
                f"the file has {found[0]}x{found[1]}; use the photos the cameras were calibrated with"
            )

    def resized(self, width: int, height: int) -> "View":
        """The view with photo, camera and mask scaled to another size in pixels."""
        mask = None if self.mask is None else replace(self.mask, resized=(width, height))
        photo = ResizedPhoto(self.photo, (width, height))
        return replace(self, camera=self.camera.resized(width, height), photo=photo, mask=mask)


@dataclass(frozen=True, eq=False)
class SparsePoints:
    """3D points of a reconstruction with their observations in photos.

    Attributes:
        positions: (n, 3) float, world units.
        colors: (n, 3) uint8, RGB.
        observations: (o, 2) int: index of a point and index of the view that observes it.
        pixels: (o, 2) float, pixels: the position of each observation in the undistorted photo.
        origin: "given" with the capture, "own" (found in its photos with its cameras) or "both".

    Raises:
        InputError: positions or pixels are not finite or implausibly large.
    """

    positions: np.ndarray
    colors: np.ndarray
    observations: np.ndarray
    pixels: np.ndarray
    origin: Literal["given", "own", "both"] = "given"

    def __post_init__(self) -> None:
        check_coordinates(self.positions, "sparse points")
        check_coordinates(self.pixels, "observations of sparse points")

    @property
    def n_observed(self) -> int:
        """The number of points that at least two photos observe; the others take no part (some formats have positions only)."""
        return int((np.bincount(self.observations[:, 0], minlength=1) > 1).sum())


@dataclass(frozen=True, eq=False)
class Truth:
    """The exact surface of a synthetic scene.

    Attributes:
        surface: the true surface, in any triangulation.
        vertices: (n, 3) float or None, world units: the true position of each vertex of the scene's mesh.
        normals: list of (d <= 3, 3) float or None: for each vertex the unit normals of the true surfaces that meet
            there. They span the directions that photos can determine (one: a plane, two: an edge, three: a corner).
    """

    surface: Mesh
    vertices: np.ndarray | None = None
    normals: list[np.ndarray] | None = None


@dataclass(frozen=True, eq=False)
class Scene:
    """A mesh and its photos.

    `mesh` is the surface of the input (`fairing.weld`): the copies of a vertex are merged, so that their faces move together,
    and faces without area are left out, so that they neither take part nor hold vertices back.

    Attributes:
        original_from_welded: (n_input,) int: for each vertex of the input its index in `mesh`; `unweld` maps back.
        original_faces: (m_input, 3) int: all faces of the input, as indices of its vertices.
        input_faces: (m,) int: for each face of `mesh` its index in the input.

    `points_choice` is the choice of sparse points that a run still has to make: `Session.choose_inputs` makes it, and its scene has
    the chosen points as "given" ones. Without it the sparse points are used as they are.

    Raises:
        InputError: there are fewer than three views, or two views share a name.
    """

    name: str
    mesh: Mesh
    views: tuple[View, ...]
    original_from_welded: np.ndarray
    original_faces: np.ndarray
    input_faces: np.ndarray
    truth: Truth | None = None
    sparse_points: SparsePoints | None = None
    warnings: tuple[str, ...] = field(default=())
    triangulated: bool = False
    """Whether the mesh was triangulated from the sparse points instead of read from a file."""
    object_box: "ObjectBox | None" = None
    """The box whose points were triangulated; None where all were, or the mesh was read."""
    mesh_file: Path | None = None
    """The file that the mesh was read from: the mesh is written with its attributes, see `fairing.write_mesh`."""
    points_choice: PointsChoice = "automatic"
    cameras_choice: Literal["refine", "refine_lens", "given"] = "given"
    """The choice of cameras that a run still has to make, alike."""
    given_cameras: tuple[Camera, ...] | None = None
    """The cameras of the capture where `fairing.cameras.refine` corrected those of the views; a run records the latter."""
    refinement: "Refinement | None" = None
    """What that refinement found, also where it kept the given cameras; None before it."""

    def __post_init__(self) -> None:
        if len(self.views) < 3:
            raise InputError(f"scene {self.name}: expected at least 3 photos, found {len(self.views)}; add photos")
        names = [view.name for view in self.views]
        repeated = {name for name in names if names.count(name) > 1}
        if repeated:
            raise InputError(f"scene {self.name}: two photos are named {min(repeated)}; names must be unique")

    @property
    def cameras_origin(self) -> Literal["given", "corrected"]:
        """Origin of the cameras of the views."""
        return "given" if self.given_cameras is None else "corrected"

    @classmethod
    def build(
        cls,
        name: str,
        vertices: np.ndarray,
        faces: np.ndarray,
        views: tuple[View, ...],
        truth: Truth | None = None,
        sparse_points: SparsePoints | None = None,
        warnings: tuple[str, ...] = (),
        points_choice: PointsChoice = "automatic",
    ) -> "Scene":
        """A scene from vertices (n, 3), world units, and faces (m, 3) as read; the mesh is validated and welded.

        Raises:
            InputError: the mesh is invalid or has no face with area, there are too few views, or two views share a name.
        """
        surface = welded(Mesh(vertices, faces))
        return cls.of_surface(name, surface, views, truth, sparse_points, warnings, points_choice)

    @classmethod
    def of_surface(
        cls,
        name: str,
        surface: Welded,
        views: tuple[View, ...],
        truth: Truth | None = None,
        sparse_points: SparsePoints | None = None,
        warnings: tuple[str, ...] = (),
        points_choice: PointsChoice = "automatic",
    ) -> "Scene":
        """A scene from the surface of a mesh as read.

        Raises:
            InputError: there are too few views, or two views share a name.
        """
        return cls(
            name, surface.mesh, views, surface.vertex_of_input, surface.original.faces, surface.input_faces, truth,
            sparse_points, warnings, points_choice=points_choice,
        )  # fmt: skip

    @property
    def sparse_positions(self) -> np.ndarray:
        """(p, 3) float, world units: positions of the sparse points; p = 0 without sparse points."""
        return np.zeros((0, 3)) if self.sparse_points is None else self.sparse_points.positions

    @cached_property
    def connected_mesh(self) -> Mesh:
        """`mesh` with the faces without area that connect others: their three corners differ.

        Its boundary is that of the surface where an edge of one face meets the split edge of its neighbours.
        """
        faces = self.original_from_welded[self.original_faces]
        return Mesh(self.mesh.vertices, faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)])

    def unweld(self, vertices: np.ndarray) -> np.ndarray:
        """Positions (n_input, 3) in the input's order from welded positions (n, 3)."""
        return vertices[self.original_from_welded]
