"""Memory estimate of a run, before it starts: photos dominate, then faces."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fairing.cells.pair_photos import blur_octaves, blur_of_octave
from fairing.cells.point_spread import patch_pixels
from fairing.cells.scale_space import (
    KEPT_BYTES,
    MAX_CONCURRENT_PHOTOS,
    MEMORY,
    exceeds,
    reduction,
)
from fairing.cells.visibility import Visibility, footprints
from fairing.options import FairingOptions
from fairing.photo import LOADED_BYTES, Photo, ResizedPhoto
from fairing.scene import Scene

# Bytes, measured on runs of 1,000 to 100,000 vertices and of 10 to 200 photos.
PROGRAM = 300_000_000  # the program itself
PER_FACE = 8_000  # normal equations, their sparse factors, and a sweep's record
PER_FACE_AND_VIEW = 60  # footprints and visibility
PER_PIXEL_IN_WORK = 28  # a photo being decoded and blurred
PER_PIXEL_DECODED = 10  # a photo being decoded, before it is reduced
PER_MAP_PIXEL = 40  # a depth map being made
USABLE_PART = 0.9  # of the memory that is available
PHOTO_SCALES = (0.75, 0.6, 0.5, 0.4, 0.3, 0.25, 0.2, 0.15, 0.1)


def memory_needed(scene: Scene, options: FairingOptions, scale: float = 1.0) -> int:
    """Approximate peak memory of a run, bytes.

    Args:
        scale: factor of the photos' width and height (`--photo-scale`).
    """
    sizes = scale**2 * np.array([view.camera.width * view.camera.height for view in scene.views], dtype=float)
    channels, n_faces = 3 if options.cells.color else 1, len(scene.mesh.faces)
    threads = min(options.threads or os.cpu_count() or 1, len(sizes))
    largest, others = (4 * channels * pixels for pixels in _pixels_laid_out(scene, options, scale, sizes))
    laid_out = largest + min(others, KEPT_BYTES)
    decoded = min((3 if options.cells.color else 2) * float(sizes.sum()), MEMORY)
    decoded += min(3 * float(sizes.sum()), LOADED_BYTES)
    at_a_time = min(threads, MAX_CONCURRENT_PHOTOS)
    in_work = max(
        at_a_time * PER_PIXEL_IN_WORK * float(sizes.max()),
        at_a_time * PER_PIXEL_DECODED * max(_pixels_as_taken(view.photo) for view in scene.views),
        threads * PER_MAP_PIXEL / options.visibility.reduction**2 * float(sizes.max()),
    )
    masked = np.array([view.mask is not None for view in scene.views])
    masks = float(sizes[masked].sum()) / options.visibility.reduction**2
    by_face = n_faces * (PER_FACE + PER_FACE_AND_VIEW * len(sizes))
    return int(PROGRAM + laid_out + decoded + in_work + masks + by_face)


def _pixels_as_taken(photo: Photo) -> int:
    """Pixels of a photo before it is reduced."""
    if isinstance(photo, ResizedPhoto):
        return _pixels_as_taken(photo.whole)
    width, height = photo.size
    return width * height


def _pixels_laid_out(scene: Scene, options: FairingOptions, scale: float, sizes: np.ndarray) -> tuple[float, float]:
    """Blurred pixels of the level that stores most, whole photos or the patches of photos around each face; of all levels.

    Large faces need whole photos at several blurs, see `fairing.cells.pair_photos`.

    Args:
        sizes: (V,) float, px: pixels of the photos.
    """
    laid_out, is_large = np.zeros(options.n_levels), exceeds(float(sizes.sum()))
    patches, count = np.zeros(len(scene.mesh.faces)), np.zeros(len(scene.mesh.faces))
    everywhere = replace(options.visibility, min_angle=0.0, min_footprint=0.0)
    for v, view in enumerate(scene.views):
        outline = footprints(scene.mesh.vertices, scene.mesh.faces, view.camera, 1, everywhere, 0.0)
        is_seen = np.isin(outline.reason, (Visibility.SEEN, Visibility.TURNED_AWAY))
        longest, height = scale * outline.longest_edge[is_seen], scale * outline.height[is_seen]
        patches[is_seen] += patch_pixels(longest, height)
        count[is_seen] += 1
        for level, at in enumerate(options.levels):
            octaves = np.unique(blur_octaves(longest / at.size, at.blur)).tolist()
            for octave in octaves or [0]:
                size = (view.camera.width, view.camera.height)
                factor = reduction(size, blur_of_octave(octave, at.blur), at.blur, is_large)
                laid_out[level] += sizes[v] / factor**2
    of_patches = float((patches * np.minimum(1, options.visibility.max_views / np.maximum(count, 1))).sum())
    uses_patches = [level.point_spread == "common" and not exceeds(of_patches) for level in options.levels]
    largest = max(of_patches if patched else float(laid_out[level]) for level, patched in enumerate(uses_patches))
    return largest, float(laid_out[np.logical_not(uses_patches)].sum())


def memory_available() -> tuple[int, int] | None:
    """Total and available memory of this machine, bytes; None if unknown."""
    status = Path("/proc/meminfo")
    if status.exists():
        lines = dict(line.split(":", 1) for line in status.read_text().splitlines())
        total, free = (1024 * int(lines[key].split()[0]) for key in ("MemTotal", "MemAvailable"))
        return total, free
    try:
        total = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return None
    return total, total


class MemoryWarning(NamedTuple):
    """A warning about a run's memory.

    Attributes:
        line: memory needed, memory available, and a remedy.
        is_too_much: whether the run needs more than the machine has.
    """

    line: str
    is_too_much: bool


def memory_warning(
    scene: Scene, options: FairingOptions, afterwards: Callable[[float], int] = lambda scale: 0
) -> MemoryWarning | None:
    """A warning if a run needs more memory than is available; else None.

    Args:
        afterwards: returns the bytes that what follows the run needs, for a factor of the photos' width and height.
    """

    def needed_at(scale: float) -> int:
        return max(memory_needed(scene, options, scale), afterwards(scale))

    available = memory_available()
    needed = needed_at(1.0)
    if available is None or needed <= USABLE_PART * min(available):
        return None
    total, free = available
    scale = next((s for s in PHOTO_SCALES if needed_at(s) <= USABLE_PART * free), None)
    remedy = "leave out photos (--leave-out) or use a coarser mesh" if scale is None else f"try --photo-scale {scale:g}"
    line = f"{len(scene.views)} photos and {len(scene.mesh.faces)} faces need about {needed / 1e9:.1f} GB of memory, "
    if needed > total:
        return MemoryWarning(f"{line}this machine has {total / 1e9:.1f} GB: {remedy}", True)
    return MemoryWarning(f"{line}{free / 1e9:.1f} GB are free: if the system ends the run, {remedy}", False)
