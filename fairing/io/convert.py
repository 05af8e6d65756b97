"""Capture conversion: photos, masks, cameras, points and mesh written to a self-contained, undistorted folder.

Photos are copied byte by byte; those that are undistorted or turned upright are written as PNG, because a second JPEG
compression would change them. The files that identify the format are removed first and written last, so that an
interrupted conversion is not recognised as a scene.
"""

import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Literal

import cv2
import numpy as np
from PIL import Image

from fairing.errors import InputError
from fairing.io import colmap_write, scene_json
from fairing.io.atomic import write_atomically
from fairing.io.capture import listed, reading
from fairing.io.mask_files import MASK_FOLDER
from fairing.io.mesh_file import write_mesh
from fairing.photo import FilePhoto
from fairing.scene import SparsePoints, View
from fairing.util.orientation import AS_STORED

Format = Literal["colmap", "scene.json"]

PHOTO_FOLDER = "images"
MESH = "mesh.ply"


def write_capture(
    out: Path,
    format: Format,
    views: Sequence[View],
    sparse: SparsePoints | None = None,
    mesh: tuple[np.ndarray, np.ndarray] | None = None,
    mesh_file: Path | None = None,
    on_photo: Callable[[int], None] = lambda done: None,
) -> tuple[str, ...]:
    """Write photos, masks, cameras, sparse points and a mesh to a folder made by `prepare_output_folder`.

    Args:
        mesh: vertices (n, 3) float, world units, and faces (m, 3) int.
        mesh_file: the file that the mesh was read from, whose attributes are kept as far as a PLY holds them.
        on_photo: called with the number of photos that are written; what it raises ends the conversion.

    Returns:
        Warnings about what the format cannot hold, one line each.

    Raises:
        InputError: a photo cannot be read, a file cannot be written, or COLMAP's PINHOLE cannot represent a camera.
    """
    if format == "colmap":
        colmap_write.check_cameras(views)
    described = [out / scene_json.FILE, *(out / "sparse" / name for name in colmap_write.FILES)]
    for file in (*described, out / MESH):
        with reading(file, "a file that may be replaced"):
            file.unlink(missing_ok=True)
    names = _names(views)
    for done, (view, name) in enumerate(zip(views, names, strict=True)):
        on_photo(done)
        _write_photo(view, out / PHOTO_FOLDER / name)
        mask = out / MASK_FOLDER / f"{name}.png"
        if view.mask is not None:
            _write_mask(view.mask.load(), mask)
        else:
            mask.unlink(missing_ok=True)  # of an earlier conversion
    if mesh is not None:
        write_mesh(out / MESH, *mesh, like=mesh_file)
    written = [replace(view, name=name) for view, name in zip(views, names, strict=True)]
    if format == "scene.json":
        scene_json.write(out, written, sparse, MESH if mesh is not None else None)
        return ()
    colmap_write.write_text_model(out / "sparse", written, sparse)
    weighted = [view.name for view in views if view.weight != 1]
    return (f"weights are not kept, COLMAP has none: {listed(weighted)}",) if weighted else ()


def _names(views: Sequence[View]) -> list[str]:
    """The photos' file names below `images/`: the views' names, with suffix .png where the photo is undistorted."""
    names = []
    for view in views:
        path = PurePosixPath(view.name.replace("\\", "/"))
        parts = [part for part in path.parts if part not in ("..", ".", "/")]
        name = PurePosixPath(*parts[1:] if len(parts) > 1 and parts[0] == PHOTO_FOLDER else parts)
        if not _is_copied(view):
            name = name.with_suffix(".png")
        elif not name.suffix and isinstance(view.photo, FilePhoto):
            name = name.with_suffix(view.photo.path.suffix)
        names.append(name.as_posix())
    repeated = {name for name in names if names.count(name) > 1}
    if repeated:
        raise InputError(f"photos: two would be written as {min(repeated)}; rename one of them")
    return names


def _is_copied(view: View) -> bool:
    photo = view.photo
    return isinstance(photo, FilePhoto) and photo.lens is None and photo.orientation == AS_STORED


def _write_photo(view: View, path: Path) -> None:
    _make_folder(path.parent)
    if isinstance(view.photo, FilePhoto) and _is_copied(view):
        source = view.photo.path
        with reading(source, "a photo"), source.open("rb") as photo:
            write_atomically(path, lambda file: shutil.copyfileobj(photo, file))
        return
    pixels = view.photo.full_depth()
    if pixels.dtype == np.uint8:
        image = Image.fromarray(pixels)
        write_atomically(path, lambda file: image.save(file, format="PNG", compress_level=3))
    else:  # Pillow writes no colour of 16 bits
        _, encoded = cv2.imencode(".png", np.ascontiguousarray(pixels[..., ::-1]), [cv2.IMWRITE_PNG_COMPRESSION, 3])
        write_atomically(path, lambda file: file.write(encoded.tobytes()))


def _write_mask(counts: np.ndarray, path: Path) -> None:
    _make_folder(path.parent)
    image = Image.fromarray(counts.astype(np.uint8) * 255)
    write_atomically(path, lambda file: image.save(file, format="PNG"))


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: could not be created ({error.strerror or error}); choose another folder") from None
