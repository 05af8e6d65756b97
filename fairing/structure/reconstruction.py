"""A capture from a folder of photos: the whole of structure from motion, resumable at every step."""

import hashlib
import importlib.util
import json
import os
import shutil
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fairing.errors import Cancelled, InputError
from fairing.io import PhotoChoice, locked_output_folder, write_atomically
from fairing.io.capture import Capture, listed
from fairing.io.convert import PHOTO_FOLDER, write_capture
from fairing.io.load import read_capture
from fairing.io.mask_files import MASK_FOLDER
from fairing.io.mesh_place import in_frame
from fairing.structure.child import place_photos
from fairing.structure.frame import upright_frame
from fairing.structure.options import StructureOptions
from fairing.structure.outcome import nothing_placed, reasons_for_missing
from fairing.structure.pairs import MOST_EXHAUSTIVE, NEIGHBOURS, SIMILAR
from fairing.structure.photo_set import MIN_PHOTOS, PhotoSet, read_photo_set
from fairing.structure.preparation import prepare_photos, prepared_name, prepared_size
from fairing.structure.worker import JOB, MODEL

REPORT = "cameras.json"
_WORK = "work"
"""Folder of what is not finished, within the output folder."""
_PREPARING, _PLACING = 0.08, 0.92
"""Parts of the whole time, as measured on SceauxCastle, at the ends of which photos are prepared and cameras placed."""


@dataclass(frozen=True)
class PlacedPhotos:
    """A capture made from photos alone.

    Attributes:
        n_photos: number of photos in the folder.
        placed: names of those in the capture.
        left_out: reason by file name of the others.
        focal_lengths: of each camera, px; those of the undistorted photos may be larger.
        n_points: number of sparse points.
        reprojection: their mean reprojection error, px.
        pycolmap: its version.
        seconds: of all runs until it was finished.
        key: of photos and options.
    """

    n_photos: int
    placed: tuple[str, ...]
    left_out: dict[str, str]
    focal_lengths: tuple[float, ...]
    n_points: int
    reprojection: float
    pycolmap: str
    seconds: float
    key: str

    def lines(self) -> list[str]:
        """What was found, one line each."""
        focal = ", ".join(f"{length:.1f}" for length in self.focal_lengths)
        lines = [
            f"placed {len(self.placed)} of {self.n_photos} photos: {self.n_points} points, mean reprojection error "
            f"{self.reprojection:.2f} px, focal length {focal} px, {self.seconds:.0f} s"
        ]
        by_reason: dict[str, list[str]] = {}
        for name, reason in self.left_out.items():
            by_reason.setdefault(reason, []).append(name)
        return lines + [f"left out: {listed(names)}: {reason}" for reason, names in by_reason.items()]


def capture_of_photos(
    folder: Path,
    out: Path,
    options: StructureOptions | None = None,
    on_progress: Callable[[float, str], None] = lambda fraction, line: None,
    cancel_requested: Callable[[], bool] = lambda: False,
    reuse: Path | None = None,
) -> PlacedPhotos:
    """Compute the cameras of photos and write a capture: undistorted photos and a COLMAP model in text.

    An interrupted call continues in the next one on the same photos with the same options; a finished capture is used as it is.

    Args:
        folder: of the photos.
        out: folder for the capture: new, empty, or of an earlier call.
        on_progress: called with the finished part, 0 to 1, and a line.
        cancel_requested: polled several times a second.
        reuse: a folder whose finished capture of the same photos and options is copied, if it has one.

    Raises:
        InputError: pycolmap is not installed, the photos cannot be used, or too few of them could be placed.
        Cancelled: `cancel_requested` returned True; what is done is kept in the folder.
    """
    options = options or StructureOptions()
    photos = read_photo_set(folder)
    key = _key(folder, photos, options)
    if (finished := finished_capture(out)) is not None and finished.key == key:
        return finished
    if reuse is not None and (finished := finished_capture(reuse)) is not None and finished.key == key:
        with locked_output_folder(out):
            _copy(reuse, out)
        return finished
    check_pycolmap(folder, len(photos.photos))
    with locked_output_folder(out):
        work = out / _WORK
        job = _begun(work, key)
        began = time.monotonic()

        def save(seconds: float) -> None:
            _write_json(work / JOB, job | {"seconds": job["seconds"] + seconds})

        try:
            return _placed(folder, photos, out, work, options, job, key, on_progress, cancel_requested, began)
        except BaseException:
            if work.is_dir():
                save(time.monotonic() - began)
            raise


def check_pycolmap(folder: Path, n_photos: int) -> None:
    """Raises InputError if pycolmap is not installed."""
    if importlib.util.find_spec("pycolmap") is None:
        raise InputError(
            f"{folder}: expected cameras beside the {n_photos} photos, found none; computing them needs pycolmap: "
            '`pip install "eigenfairing[photos]"`'
        )


def finished_capture(out: Path) -> PlacedPhotos | None:
    """The report of the finished capture in a folder; None if there is none."""
    try:
        values = json.loads((out / REPORT).read_text(encoding="utf-8"))
        report = PlacedPhotos(**values)
    except (OSError, ValueError, TypeError):
        return None
    if not (out / MODEL / "cameras.txt").is_file():
        return None
    return replace(report, placed=tuple(report.placed), focal_lengths=tuple(report.focal_lengths))


def _placed(
    folder: Path,
    photos: PhotoSet,
    out: Path,
    work: Path,
    options: StructureOptions,
    job: dict[str, Any],
    key: str,
    on_progress: Callable[[float, str], None],
    cancel_requested: Callable[[], bool],
    began: float,
) -> PlacedPhotos:
    """The capture, written; see `capture_of_photos`."""
    n = len(photos.photos)

    def show_prepared(done: int) -> None:
        on_progress(_PREPARING * done / n, f"preparing photos: {done} of {n}")

    damaged = prepare_photos(photos, folder, work, options.largest_side, show_prepared, cancel_requested)
    cameras = []
    for group in photos.cameras:
        if usable := [i for i in group if i not in damaged]:
            photo = photos.photos[usable[0]]
            length = photo.focal_length(prepared_size(photo, options.largest_side))
            cameras.append({"photos": usable, "focal_length": length})
    n_usable = n - len(damaged)
    if n_usable < MIN_PHOTOS:
        raise InputError(f"{folder}: expected at least {MIN_PHOTOS} photos that can be decoded, found {n_usable}")
    _write_json(work / JOB, job | {"cameras": cameras, "threads": options.threads})
    n_pairs = n_usable * (n_usable - 1) // 2 if n_usable <= MOST_EXHAUSTIVE else n_usable * (NEIGHBOURS + SIMILAR)
    part = _PLACING - _PREPARING
    facts = place_photos(
        work,
        n_usable,
        n_pairs,
        lambda fraction, line: on_progress(_PREPARING + part * fraction, line),
        cancel_requested,
    )
    if not facts["groups"] or len(facts["groups"][0]) < MIN_PHOTOS:
        shutil.rmtree(work)
        raise InputError(f"{folder}: {nothing_placed(facts, n_usable)}")
    on_progress(_PLACING, "undistorting photos")
    capture = _read(work, photos)
    _write(capture, out, on_progress, cancel_requested)
    names = [photo.path.name for photo in photos.photos]
    missing = {i: reason for i, reason in reasons_for_missing(facts, names).items() if i not in damaged} | damaged
    assert capture.sparse_points is not None
    report = PlacedPhotos(
        n_photos=n + len(photos.unreadable),
        placed=tuple(view.name for view in capture.views),
        left_out=photos.unreadable | {names[i]: reason for i, reason in sorted(missing.items())},
        focal_lengths=tuple(round(length, 2) for length in facts["focal_lengths"]),
        n_points=len(capture.sparse_points.positions),
        reprojection=round(float(facts["reprojection"]), 4),
        pycolmap=facts["pycolmap"],
        seconds=round(job["seconds"] + time.monotonic() - began, 1),
        key=key,
    )
    _write_json(out / REPORT, asdict(report))
    shutil.rmtree(work)
    return report


def _begun(work: Path, key: str) -> dict[str, Any]:
    """The job of an interrupted call with the same key, else a new one in an empty working folder."""
    try:
        job = json.loads((work / JOB).read_text(encoding="utf-8"))
        if job["key"] == key:
            return {"key": key, "seconds": float(job["seconds"])}
    except (OSError, ValueError, KeyError, TypeError):
        pass
    if work.is_dir():
        shutil.rmtree(work)
    work.mkdir()
    job = {"key": key, "seconds": 0.0}
    _write_json(work / JOB, job)
    return job


def _read(work: Path, photos: PhotoSet) -> Capture:
    """The placed photos under their own names, upright and centred."""
    capture = read_capture(work, PhotoChoice(format="colmap"))
    names = {prepared_name(i): photo.name for i, photo in enumerate(photos.photos)}
    capture = capture._replace(views=tuple(replace(view, name=names[view.name]) for view in capture.views))
    points = capture.sparse_points
    if points is None or len(points.positions) == 0 or not np.isfinite(points.positions).all():
        raise InputError(f"{work}: expected points in the model of the photos, found none")
    return in_frame(capture, upright_frame(capture.views, points))


def _write(
    capture: Capture,
    out: Path,
    on_progress: Callable[[float, str], None],
    cancel_requested: Callable[[], bool],
) -> None:
    """Write the capture; photos of an earlier one are removed."""
    count = len(capture.views)

    def show(done: int) -> None:
        on_progress(_PLACING + (1 - _PLACING) * done / count, f"undistorting photos: {done} of {count}")
        if cancel_requested():
            raise Cancelled

    earlier = finished_capture(out)
    (out / REPORT).unlink(missing_ok=True)
    for name in earlier.placed if earlier is not None else ():
        (out / PHOTO_FOLDER / name).unlink(missing_ok=True)
    write_capture(out, "colmap", capture.views, capture.sparse_points, on_photo=show)


def _copy(finished: Path, out: Path) -> None:
    """Copy a finished capture; its report comes last and makes it one."""
    for folder in (PHOTO_FOLDER, MASK_FOLDER, MODEL):
        if (finished / folder).is_dir():
            shutil.copytree(finished / folder, out / folder, dirs_exist_ok=True)
    shutil.copyfile(finished / REPORT, out / REPORT)


def _key(folder: Path, photos: PhotoSet, options: StructureOptions) -> str:
    """Changes with the photos, their masks and the options that the result depends on."""
    files = [photo.path for photo in photos.photos]
    masks = [
        path for place in {folder, *(file.parent for file in files)} for path in (place / MASK_FOLDER).glob("**/*")
    ]
    facts = []
    for path in [*files, *sorted(masks)]:
        status = os.stat(path)
        facts.append((str(path.name), status.st_size, status.st_mtime_ns))
    return hashlib.sha256(repr((facts, options.largest_side)).encode("utf-8", "surrogateescape")).hexdigest()[:16]


def _write_json(path: Path, values: dict[str, Any]) -> None:
    write_atomically(path, lambda file: file.write(json.dumps(values, indent=1).encode()))
