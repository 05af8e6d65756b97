"""The child process that places photos with pycolmap: `python -m fairing.structure.worker WORK`.

pycolmap prints, and a failure of its native code ends the process that it runs in. So it has one of its own, which writes one
JSON object a line to its standard output; what pycolmap prints goes to `WORK/pycolmap.log`. The process ends with its standard
input, so it does not outlive its parent.

| line | meaning |
|---|---|
| `{"stage": "features" / "pairs" / "matches" / "mapping", "count": n}` | a stage begins, of n parts |
| `{"done": n}` | so many parts are finished; those of features and matches are counted in the database by the parent |
| `{"error": "..."}` | it failed, and says why |
| `{"finished": true}` | the model and `FACTS` are written |
"""

import json
import os
import signal
import sys
import threading
from pathlib import Path
from typing import Any, TextIO

from fairing.structure.pairs import pairs_to_match
from fairing.structure.preparation import MASKS, PHOTOS, prepared_name

JOB, FACTS, LOG, DATABASE, MODEL = "job.json", "facts.json", "pycolmap.log", "database.db", "sparse"
CAMERA_MODEL = "SIMPLE_RADIAL"
"""Focal length and one coefficient of distortion: what a few photos determine."""
SEED = 1
MIN_INLIERS = 15
"""Points of the model that must fit the pose of a photo, half of COLMAP's number: small photos show few."""
_IMPORTED = "imported"
"""File that shows that all photos are in the database."""


def main() -> None:
    """Place the photos of a working folder."""
    lines = os.fdopen(os.dup(1), "w", encoding="utf-8")
    work = Path(sys.argv[1])
    log = os.open(work / LOG, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    for stream in (1, 2):
        os.dup2(log, stream)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all processes of a terminal; the parent ends this one
    threading.Thread(target=_end_with_input, daemon=True).start()
    try:
        _place(work, json.loads((work / JOB).read_text(encoding="utf-8")), lines)
        _tell(lines, finished=True)
    except Exception as error:
        _tell(lines, error=f"{type(error).__name__}: {error}")
    lines.flush()
    os._exit(0)  # without the destructors of native code


def _place(work: Path, job: dict[str, Any], lines: TextIO) -> None:
    """Find features, match them, place the photos and write the model with most photos.

    `job`: `cameras`, a list of {"photos": indices, "focal_length": px or null}, and `threads`.
    """
    import pycolmap  # pyright: ignore[reportMissingImports] - optional

    pycolmap.set_random_seed(SEED)
    database, photos, threads = work / DATABASE, work / PHOTOS, job["threads"] or -1
    indices = sorted(i for camera in job["cameras"] for i in camera["photos"])
    names = [prepared_name(i) for i in indices]
    reader = pycolmap.ImageReaderOptions()
    reader.camera_model = CAMERA_MODEL
    if any((work / MASKS).iterdir()):
        reader.mask_path = work / MASKS
    if not (work / _IMPORTED).exists():
        _import_photos(pycolmap, work, job["cameras"], reader)
    device = pycolmap.Device.cpu  # the same result on every machine

    _tell(lines, stage="features", count=len(names))
    extraction = pycolmap.FeatureExtractionOptions()
    extraction.num_threads = threads
    pycolmap.extract_features(
        database, photos, image_names=names, reader_options=reader, extraction_options=extraction, device=device
    )

    with pycolmap.Database.open(database) as opened:
        id_of = {image.name: image.image_id for image in opened.read_all_images()}
        ids = [id_of[name] for name in names]
        _tell(lines, stage="pairs", count=len(names))
        pairs = pairs_to_match(
            len(names), lambda i: opened.read_descriptors(ids[i]).data, lambda done: _tell(lines, done=done)
        )
    _tell(lines, stage="matches", count=len(pairs))
    listed = work / "pairs.txt"
    listed.write_text("".join(f"{names[i]} {names[j]}\n" for i, j in pairs), encoding="utf-8")
    matching, pairing = pycolmap.FeatureMatchingOptions(), pycolmap.ImportedPairingOptions()
    matching.num_threads, pairing.match_list_path = threads, listed
    verification = pycolmap.TwoViewGeometryOptions()
    verification.ransac.random_seed = SEED
    pycolmap.match_image_pairs(
        database, matching_options=matching, pairing_options=pairing, verification_options=verification, device=device
    )

    _tell(lines, stage="mapping", count=len(names))
    models = _mapped(pycolmap, work, threads, lambda done: _tell(lines, done=done))
    _write_facts(pycolmap, work, dict(zip(ids, indices, strict=True)), models)


def _import_photos(pycolmap: Any, work: Path, cameras: list[dict[str, Any]], reader: Any) -> None:
    """Enter photos and cameras into a new database. Photos of one device at one focal length share a camera."""
    for file in work.glob(f"{DATABASE}*"):
        file.unlink()
    database = work / DATABASE
    pycolmap.Database.open(database).close()
    for camera in cameras:
        names = [prepared_name(i) for i in camera["photos"]]
        mode = pycolmap.CameraMode.SINGLE
        pycolmap.import_images(database, work / PHOTOS, camera_mode=mode, image_names=names, options=reader)
    with pycolmap.Database.open(database) as opened:
        for camera in cameras:
            if camera["focal_length"] is None:
                continue
            entered = opened.read_camera(opened.read_image_with_name(prepared_name(camera["photos"][0])).camera_id)
            entered.focal_length, entered.has_prior_focal_length = camera["focal_length"], True
            opened.update_camera(entered)
    (work / _IMPORTED).touch()


def _mapped(pycolmap: Any, work: Path, threads: int, on_photo: Any) -> list[Any]:
    """The models, each of photos that could be placed together, the one with most photos first."""
    options = pycolmap.IncrementalPipelineOptions()
    options.num_threads, options.min_model_size = threads, 3
    options.mapper.abs_pose_min_num_inliers = MIN_INLIERS
    options.random_seed = options.mapper.random_seed = options.triangulation.random_seed = SEED
    placed = [0]

    def count(new: int) -> None:
        placed[0] += new
        on_photo(placed[0])

    folder = work / "models"
    folder.mkdir(exist_ok=True)
    found = pycolmap.incremental_mapping(
        work / DATABASE,
        work / PHOTOS,
        folder,
        options=options,
        initial_image_pair_callback=lambda: count(2),
        next_image_callback=lambda: count(1),
    )
    return sorted(found.values(), key=lambda model: (-model.num_reg_images(), -model.num_points3D()))


def _write_facts(pycolmap: Any, work: Path, index_of: dict[int, int], models: list[Any]) -> None:
    """Write the first model in COLMAP's text format, and what is known of each photo; see `fairing.structure.outcome`."""
    if models:
        (work / MODEL).mkdir(exist_ok=True)
        models[0].write_text(work / MODEL)
    with pycolmap.Database.open(work / DATABASE) as opened:
        features = {index_of[i]: int(opened.num_keypoints_for_image(i)) for i in index_of}
        pairs = []
        for pair, geometry in zip(*opened.read_two_view_geometries(), strict=True):
            first, second = pycolmap.pair_id_to_image_pair(pair)
            if len(geometry.inlier_matches):
                pairs.append([index_of[first], index_of[second], len(geometry.inlier_matches)])
    placed = [sorted(index_of[i] for i in model.reg_image_ids()) for model in models]
    facts = {
        "pycolmap": pycolmap.__version__,
        "features": features,
        "pairs": pairs,
        "groups": placed,
        "focal_lengths": [float(camera.focal_length) for camera in models[0].cameras.values()] if models else [],
        "reprojection": float(models[0].compute_mean_reprojection_error()) if models else None,
    }
    part = work / f"{FACTS}.part"
    part.write_text(json.dumps(facts), encoding="utf-8")
    part.replace(work / FACTS)


def _tell(lines: TextIO, **content: object) -> None:
    lines.write(json.dumps(content) + "\n")
    lines.flush()


def _end_with_input() -> None:
    sys.stdin.read()
    os._exit(1)


if __name__ == "__main__":
    main()
