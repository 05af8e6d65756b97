"""What is faired: a mesh, the calibrated photos that saw the surface, and what else is known about it."""

from dataclasses import dataclass, field, replace

import numpy as np

from fairing.camera import Camera
from fairing.errors import InputError
from fairing.mesh import Mesh, weld
from fairing.photo import Mask, Photo, ResizedPhoto
from fairing.util.guards import check_coordinates, check_name


@dataclass(frozen=True, eq=False)
class View:
    """One calibrated photo.

    Attributes:
        mask: what of the photo counts; None: all of it.
        weight: how much the photo counts beside the others, more than 0.

    Raises:
        InputError: photo or mask cannot be read, a size contradicts the camera's, the weight is not positive, or the
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
                f"mask {self.mask.path}: expected the photo's {expected[0]}x{expected[1]} pixels, found {width}x{height}"
            )
        if not 0 < self.weight < float("inf"):
            raise InputError(
                f"photo {self.name}: expected a weight of more than 0, found {self.weight:g}; to ignore it, leave it out"
            )
        if expected != found:
            raise InputError(
                f"photo {self.name}: its camera expects {expected[0]}x{expected[1]} pixels, "
                f"the file has {found[0]}x{found[1]}; use the photos the cameras were calibrated with"
            )

    def resized(self, width: int, height: int) -> "View":
        """The same photo, camera and mask in another size, pixels."""
        mask = None if self.mask is None else replace(self.mask, resized=(width, height))
        photo = ResizedPhoto(self.photo, (width, height))
        return replace(self, camera=self.camera.resized(width, height), photo=photo, mask=mask)


@dataclass(frozen=True, eq=False)
class SparsePoints:
    """3D points of a reconstruction with the photos that see them.

    Attributes:
        positions: (n, 3) float, world units.
        colors: (n, 3) uint8, RGB.
        observations: (o, 2) int: a point's index and a view's index.
        pixels: (o, 2) float, pixels: where that view saw that point.

    Raises:
        InputError: positions or pixels are not finite or implausibly large.
    """

    positions: np.ndarray
    colors: np.ndarray
    observations: np.ndarray
    pixels: np.ndarray

    def __post_init__(self) -> None:
        check_coordinates(self.positions, "sparse points")
        check_coordinates(self.pixels, "observations of sparse points")


@dataclass(frozen=True, eq=False)
class Truth:
    """The exact surface of a synthetic scene.

    Attributes:
        surface: the true surface, any triangulation.
        vertices: (n, 3) float or None: where each vertex of the scene's mesh belongs, world units.
        normals: (n, d <= 3, 3) list or None: for each vertex the unit normals of the true surfaces that meet there;
            they span what photos can determine of it (one: free in a plane, two: free along an edge, three: a corner).
    """

    surface: Mesh
    vertices: np.ndarray | None = None
    normals: list[np.ndarray] | None = None


@dataclass(frozen=True, eq=False)
class Scene:
    """A mesh and its photos.

    `mesh` is welded: vertices of the input that share their coordinates are one, so that faces of both move together.
    `original_from_welded` gives the input's vertices back (`unweld`), in the input's order.

    Raises:
        InputError: fewer than three views, two views of one name.
    """

    name: str
    mesh: Mesh
    views: tuple[View, ...]
    original_from_welded: np.ndarray
    original_faces: np.ndarray
    truth: Truth | None = None
    sparse_points: SparsePoints | None = None
    warnings: tuple[str, ...] = field(default=())
    triangulated: bool = False
    """The mesh is no file's: it was made of the sparse points."""

    def __post_init__(self) -> None:
        if len(self.views) < 3:
            raise InputError(f"scene {self.name}: expected at least 3 photos, found {len(self.views)}; add photos")
        names = [view.name for view in self.views]
        repeated = {name for name in names if names.count(name) > 1}
        if repeated:
            raise InputError(f"scene {self.name}: two photos are named {min(repeated)}; names must be unique")

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
    ) -> "Scene":
        """A scene from a mesh as it was read: validated, then welded."""
        original = Mesh(vertices, faces)
        welded, original_from_welded = weld(original.vertices)
        faces = original_from_welded[original.faces]
        return cls(
            name, Mesh(welded, faces), views, original_from_welded, original.faces, truth, sparse_points, warnings
        )

    @property
    def sparse_positions(self) -> np.ndarray:
        """(p, 3) float, world units: of the sparse points; none where there are no points."""
        return np.zeros((0, 3)) if self.sparse_points is None else self.sparse_points.positions

    def unweld(self, vertices: np.ndarray) -> np.ndarray:
        """Positions (n_input, 3) in the input's order from welded positions (n, 3)."""
        return vertices[self.original_from_welded]
