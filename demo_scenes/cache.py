"""Photos kept in the user's cache folder, so that only the first use of a scene pays for them."""

import hashlib
import os
import zipfile
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path

import numpy as np

import fairing.camera
import fairing.geometry.rasterize
from fairing.util.cache_folder import cache_folder


def cached_photos(
    scene: str, options: str, shape: tuple[int, int, int, int], make: Callable[[], np.ndarray]
) -> np.ndarray:
    """Photos of a scene (n, height, width, 3) uint8: read from the cache, else made and put there.

    The file's name holds the scene, a digest of the options and one of the code that makes photos. A file that is
    damaged or of another shape is made again; a cache that cannot be written is no reason to fail.
    """
    prefix = f"{scene}-{hashlib.sha256(options.encode()).hexdigest()[:12]}-"
    path = cache_folder() / f"{prefix}{_code_digest()}.npz"
    photos = _read(path)
    if photos is not None and photos.shape == shape and photos.dtype == np.uint8:
        return photos
    photos = make()
    with suppress(OSError):
        _write(path, photos)
        for outdated in path.parent.glob(f"{prefix}*.npz"):
            if outdated != path:
                outdated.unlink(missing_ok=True)
    return photos


def _read(path: Path) -> np.ndarray | None:
    """The photos in a file, None where it is missing or fails its zip checksum."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            return archive["photos"]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None


def _write(path: Path, photos: np.ndarray) -> None:
    """Write aside, then rename: readers never see half a file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    aside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with aside.open("wb") as file:
            np.savez(file, photos=photos)
        aside.replace(path)
    finally:
        aside.unlink(missing_ok=True)


@cache
def _code_digest() -> str:
    """Changes whenever the code that decides over a photo's pixels does."""
    digest = hashlib.sha256()
    sources = sorted(Path(__file__).parent.glob("*.py"))
    for source in [*sources, Path(fairing.geometry.rasterize.__file__), Path(fairing.camera.__file__)]:
        digest.update(source.read_bytes())
    return digest.hexdigest()[:12]
