"""Cache of rendered photos in the user's cache folder."""

import hashlib
import os
import zipfile
from collections.abc import Callable, Iterable
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
    """Photos of a scene (n, height, width, 3) uint8: read from the cache, or made and written to it.

    The file name holds the scene, a digest of the options and a digest of the code that makes photos. A file that is
    damaged or of another shape is replaced. Errors in writing the cache are ignored.
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
    """The photos in a file; None if it is missing or damaged."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            return archive["photos"]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None


def _write(path: Path, photos: np.ndarray) -> None:
    """Write to a temporary file and rename it, so that readers never see a partial file."""
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
    """Digest of the code that determines a photo's pixels, except for the code of single scenes in sub-packages."""
    modules = [Path(fairing.geometry.rasterize.__file__), Path(fairing.camera.__file__)]
    return source_digest([*_modules_in(Path(__file__).parent), *modules])


def package_digest(package: Path) -> str:
    """Digest of all modules of a package: for the key of photos that depend on it."""
    return source_digest(_modules_in(package))


def source_digest(modules: Iterable[Path]) -> str:
    """Digest of source files, 12 hexadecimal digits."""
    digest = hashlib.sha256()
    for module in modules:
        digest.update(module.read_bytes())
    return digest.hexdigest()[:12]


def _modules_in(package: Path) -> list[Path]:
    return sorted(package.glob("*.py"))
