"""Carvings as names and arrays for a file, and back, checked."""

import json

import numpy as np

from fairing.errors import InputError
from fairing.mesh import Mesh
from fairing.trace_check import Field, check_fields, check_ids
from fairing.triangulation.carving import Carving
from fairing.triangulation.seen_surface import Fate
from fairing.triangulation.tetrahedra import Tetrahedra, facet_neighbours

_FIELDS = {
    "places": Field("f", ("places", 3), is_finite=True),
    "center": Field("f", (3,), is_finite=True),
    "scales": Field("f", (3,), is_finite=True),  # unit, sigma, quality
    "corners": Field("iu", ("tetrahedra", 4)),
    "of_cameras": Field("iu", ("photos",)),
    "cameras": Field("f", ("photos", 3), is_finite=True),
    "colors": Field("iu", ("points", 3)),
    "lines": Field("iu", ("lines", 2)),
    "is_outside": Field("iu", ("tetrahedra",)),
    "fates": Field("iu", ("facets",)),
    "sizes": Field("iu", ("meshes", 2)),
    "vertices": Field("f", ("vertices", 3)),
    "faces": Field("iu", ("faces", 3)),
}


def carving_arrays(carving: Carving) -> dict[str, np.ndarray]:
    """All arrays of a carving by name."""
    mesh, meshes = carving.mesh, carving.decimated
    sizes = np.array([[len(vertices), len(faces)] for vertices, faces in meshes], dtype=np.int32)
    return {
        "places": mesh.places,
        "center": mesh.center,
        "scales": np.array([mesh.unit, carving.sigma, carving.quality]),
        "corners": mesh.corners.astype(np.int32),
        "of_cameras": mesh.of_cameras.astype(np.int32),
        "cameras": mesh.cameras,
        "colors": carving.colors,
        "lines": carving.lines.astype(np.int32),
        "is_outside": carving.is_outside.astype(np.uint8),
        "fates": carving.fates,
        "sizes": sizes.reshape(-1, 2),
        "vertices": np.concatenate([np.zeros((0, 3)), *(vertices for vertices, _ in meshes)]),
        "faces": np.concatenate([np.zeros((0, 3), np.int64), *(faces for _, faces in meshes)]).astype(np.int32),
    }


def carving_names(carving: Carving) -> str:
    """The names of a carving, JSON."""
    return json.dumps({"photos": carving.photos, "left_out": carving.left_out})


def read_carving(names: str, arrays: dict[str, np.ndarray]) -> Carving:
    """The carving with these `carving_names` and `carving_arrays`.

    Raises:
        InputError: a name or an array is missing, of another kind, or out of range.
        ValueError: the tetrahedra do not fit together.
    """
    lengths: dict[str, int] = {}
    check_fields(arrays, _FIELDS, lengths)
    n_points = lengths["places"] - 8
    if n_points != lengths["points"]:
        raise InputError(f"colors: expected one of each of {n_points} points, found {lengths['points']}")
    for name, count in (("corners", n_points + 8), ("of_cameras", lengths["tetrahedra"]), ("is_outside", 2)):
        check_ids(arrays[name], count, name)
    check_ids(arrays["fates"], len(Fate), "fates")
    check_ids(arrays["lines"][:, 0], n_points, "lines")
    check_ids(arrays["lines"][:, 1], lengths["photos"], "lines")
    unit, sigma, quality = arrays["scales"].tolist()
    if not (unit > 0 and sigma > 0):
        raise InputError("scales: expected a unit and an uncertainty above 0")
    photos, left_out = _read_names(names, lengths["photos"])
    corners = arrays["corners"].astype(np.int64)
    mesh = Tetrahedra(
        arrays["places"], arrays["center"], unit, corners, facet_neighbours(corners),
        arrays["of_cameras"].astype(np.int64), arrays["cameras"],
    )  # fmt: skip
    carving = Carving(
        mesh, arrays["colors"].astype(np.uint8), photos, arrays["lines"].astype(np.int64), sigma, quality,
        arrays["is_outside"].astype(bool), arrays["fates"].astype(np.int8), _meshes(arrays), left_out,
    )  # fmt: skip
    expected, found = len(carving.facets[0]), lengths["facets"]
    if expected != found:
        raise InputError(f"fates: expected one of each of {expected} facets of the cut, found {found}")
    return carving


def _read_names(names: str, n_photos: int) -> tuple[tuple[str, ...], dict[str, int]]:
    """The names of the photos, and the number of points left out by reason."""
    try:
        found = json.loads(names)
        photos, left_out = tuple(found["photos"]), dict(found["left_out"])
    except (KeyError, TypeError, ValueError, RecursionError):
        raise InputError("expected names of photos and reasons in JSON, found none") from None
    if len(photos) != n_photos or not all(isinstance(name, str) for name in photos):
        raise InputError(f"photos: expected the names of {n_photos} photos, found something else")
    if not all(isinstance(count, int) for count in left_out.values()):
        raise InputError("left_out: expected counts by reason, found something else")
    return photos, left_out


def _meshes(arrays: dict[str, np.ndarray]) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """Vertices and faces of each mesh.

    Raises:
        InputError: the sizes do not add up, or a mesh has no surface or an index out of range.
    """
    sizes, vertices, faces = arrays["sizes"].astype(np.int64), arrays["vertices"], arrays["faces"]
    if (sizes < 0).any() or sizes.sum(axis=0).tolist() != [len(vertices), len(faces)]:
        raise InputError(f"sizes: expected {len(vertices)} vertices and {len(faces)} faces together, found others")
    ends = np.cumsum(sizes, axis=0)
    begins = ends - sizes
    found = [Mesh(vertices[a:b], faces[c:d]) for (a, c), (b, d) in zip(begins, ends, strict=True)]
    return tuple((mesh.vertices, mesh.faces) for mesh in found)
