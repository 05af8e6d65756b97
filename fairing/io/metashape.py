"""Agisoft Metashape: cameras exported as XML.

A camera has a 4x4 matrix from its axes (x right, y down, z forward) to the internal frame of its chunk, and its component
or the chunk a similarity from there to the frame in which meshes are exported: this module applies it, and
`Capture.frames` has it for a mesh in the internal frame. Photos are found by the camera's label, a file name with or
without its ending.

A pixel is u = width / 2 + cx + f x' + b1 x' + b2 y', v = height / 2 + cy + f y', with the centre of the top-left pixel at
(0.5, 0.5). Lenses: frame, x' = x s + p1 (r^2 + 2 x^2) + 2 p2 x y, y' = y s + p2 (r^2 + 2 y^2) + 2 p1 x y with s = 1 + k1 r^2 +
k2 r^4 + k3 r^6 + k4 r^8, so that OpenCV's p1 is p2 here; and fisheye, the same of the angle from the axis, without p1, p2.

Source: Metashape's manual, appendix on camera models; its export of cameras.
"""

import xml.etree.ElementTree as ElementTree
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fairing.errors import InputError
from fairing.io.calibrated import CalibratedPhoto, build_capture
from fairing.io.capture import Capture, files_in, listed, naming
from fairing.io.find_photo import LabelledPhotos
from fairing.io.poses import check_last_row, pose_of_center
from fairing.io.xml_file import holds_tags, number, numbers, read_xml, whole_attribute
from fairing.lens import Lens
from fairing.placement.frames import MeshFrame

NAME = "metashape"
FORMAT = "Agisoft Metashape (cameras exported as .xml)"

_SUFFIXES = frozenset({".xml"})
_MODELS = {"frame": "four radial", "fisheye": "fisheye", "equidistant_fisheye": "fisheye"}
_UNSUPPORTED = ("p3", "p4")


class _Similarity(NamedTuple):
    """x -> scale R x + t."""

    scale: float
    R: np.ndarray
    t: np.ndarray


def recognises(path: Path) -> bool:
    return _file(path) is not None


def read(path: Path) -> Capture:
    file = _file(path)
    assert file is not None
    root = read_xml(file, "cameras of Metashape")
    with naming(file):
        chunks = [root] if root.tag == "chunk" else root.findall("chunk")
        cameras = [
            [camera for camera in chunk.iter("camera") if camera.find("transform") is not None] for chunk in chunks
        ]
        if not any(cameras):
            raise InputError(
                "expected cameras with transforms, found none; align the photos and export the cameras again"
            )
        n_cameras = [len(found) for found in cameras]
        chosen = n_cameras.index(max(n_cameras))
        notes = [f"only the chunk with most cameras is read: {max(n_cameras)}"] if sum(map(bool, n_cameras)) > 1 else []
        chunk = chunks[chosen]
        component, used, left_out = _largest_component(cameras[chosen])
        unaligned = [
            camera.get("label", "")
            for camera in chunk.iter("camera")
            if camera.find("transform") is None and camera.get("id")
        ]
        notes += [
            f"photos left out, {reason}: {len(labels)} ({listed(labels)})"
            for reason, labels in (*left_out.items(), ("without a pose", unaligned))
            if labels
        ]
        world_from_chunk = _world_from_chunk(chunk, component)
        lenses = {sensor.get("id", ""): sensor for sensor in chunk.iter("sensor")}
        read_lenses: dict[str, Lens] = {}
        files, photos = LabelledPhotos([file.parent, file.parent.parent]), []
        for camera in used:
            sensor = camera.get("sensor_id", "")
            if sensor not in lenses:
                raise InputError(f"camera {camera.get('label')}: expected a sensor of the chunk, found {sensor[:40]!r}")
            if sensor not in read_lenses:
                read_lenses[sensor] = _lens(lenses[sensor])
            photos.append(_photo(camera, read_lenses[sensor], world_from_chunk, files))
        return build_capture(photos, warnings=tuple(notes))._replace(frames=_frames(world_from_chunk, file.name))


def _file(path: Path) -> Path | None:
    tags = ("chunk", "sensor")  # a file with a sensor for each photo names its cameras far behind
    if path.is_file():
        return path if holds_tags(path, *tags) else None
    found = [file for file in files_in(path, _SUFFIXES) if holds_tags(file, *tags)]
    if len(found) > 1:
        raise InputError(
            f"{path}: expected one file of cameras, found {listed(f.name for f in found)}; give one of them"
        )
    return found[0] if found else None


def _largest_component(
    cameras: list[ElementTree.Element],
) -> tuple[str | None, list[ElementTree.Element], dict[str, list[str]]]:
    """The component with most enabled cameras, these, and the labels of the others by the reason."""
    left_out: dict[str, list[str]] = {"disabled": [], "of another component": []}
    enabled = []
    for camera in cameras:
        if camera.get("enabled", "true").lower() in ("true", "1"):
            enabled.append(camera)
        else:
            left_out["disabled"].append(camera.get("label", ""))
    if not enabled:
        raise InputError("expected enabled cameras, found none; enable them and export the cameras again")
    component = Counter(camera.get("component_id") for camera in enabled).most_common(1)[0][0]
    used = [camera for camera in enabled if camera.get("component_id") == component]
    left_out["of another component"] = [
        camera.get("label", "") for camera in enabled if camera.get("component_id") != component
    ]
    return component, used, left_out


def _world_from_chunk(chunk: ElementTree.Element, component: str | None) -> _Similarity:
    """The similarity of the component, else of the chunk, else none."""
    found = next(
        (item for item in chunk.iter("component") if component is not None and item.get("id") == component), None
    )
    transform = None if found is None else found.find("transform")
    transform = chunk.find("transform") if transform is None else transform
    if transform is None:
        return _Similarity(1.0, np.eye(3), np.zeros(3))
    what = "transform of the chunk"
    rotation, translation = transform.find("rotation"), transform.find("translation")
    R = np.eye(3) if rotation is None else numbers(rotation, 9, f"{what}: rotation").reshape(3, 3)
    t = np.zeros(3) if translation is None else numbers(translation, 3, f"{what}: translation")
    scale = number(transform, "scale", what, default=1.0)
    if not scale > 0 or np.abs(R).max() > 1.01 or np.abs(R @ R.T - np.eye(3)).max() > 1e-4:
        raise InputError(f"{what}: expected a rotation and a positive scale, found scale {scale:g}")
    return _Similarity(scale, R, t)


def _frames(world_from_chunk: _Similarity, name: str) -> tuple[MeshFrame, ...]:
    """The internal frame of the chunk, unless it is the cameras' world."""
    linear, shift = world_from_chunk.scale * world_from_chunk.R, world_from_chunk.t
    if np.array_equal(linear, np.eye(3)) and not shift.any():
        return ()
    return (MeshFrame(f"in the internal frame of {name}, before the chunk's transform", linear, shift),)


def _photo(
    camera: ElementTree.Element, lens: Lens, world_from_chunk: _Similarity, files: LabelledPhotos
) -> CalibratedPhoto:
    label = camera.get("label", "")
    if not label:
        raise InputError(f"camera {camera.get('id')}: expected a label, the photo's file name, found none")
    what = f"camera {label}: transform"
    chunk_from_camera = numbers(camera.find("transform"), 16, what).reshape(4, 4)
    check_last_row(chunk_from_camera, what)
    with np.errstate(all="ignore"):  # `Camera` refuses what is not finite
        center = world_from_chunk.scale * (world_from_chunk.R @ chunk_from_camera[:3, 3]) + world_from_chunk.t
        R = (world_from_chunk.R @ chunk_from_camera[:3, :3]).T
    return CalibratedPhoto(files.find(label), lens, R, pose_of_center(R, center))


def _lens(sensor: ElementTree.Element) -> Lens:
    what = f"sensor {sensor.get('label') or sensor.get('id')}"
    calibrations = sensor.findall("calibration")
    calibration = next((item for item in calibrations if item.get("class") == "adjusted"), None)
    calibration = calibration if calibration is not None else next(iter(calibrations), None)
    if calibration is None:
        raise InputError(f"{what}: expected a calibration, found none; align the photos and export the cameras again")
    kind = calibration.get("type") or sensor.get("type") or "frame"
    if kind not in _MODELS:
        raise InputError(f"{what}: camera type {kind[:40]} is not supported (expected {', '.join(_MODELS)})")
    if calibration.find("f") is None:
        raise InputError(f"{what}: expected a focal length f, found none; export the cameras with Metashape")
    resolution = calibration.find("resolution")
    resolution = sensor.find("resolution") if resolution is None else resolution
    if resolution is None:
        raise InputError(f"{what}: expected a resolution, found none")
    width, height = (whole_attribute(resolution, side, what) for side in ("width", "height"))

    def given(tag: str) -> float:
        return number(calibration, tag, what, default=0.0)

    model = _MODELS[kind]
    refused = [tag for tag in (*_UNSUPPORTED, *(("p1", "p2") if model == "fisheye" else ())) if given(tag)]
    if refused:
        raise InputError(f"{what}: distortion {refused[0]} of a {kind} camera is not supported; undistort the photos")
    f, b1, b2 = number(calibration, "f", what), given("b1"), given("b2")
    K = np.array([[f + b1, b2, width / 2 + given("cx") - 0.5], [0, f, height / 2 + given("cy") - 0.5], [0, 0, 1]])
    k1, k2, k3, k4 = (given(tag) for tag in ("k1", "k2", "k3", "k4"))
    distortion = [k1, k2, k3, k4] if model == "fisheye" else [k1, k2, given("p2"), given("p1"), k3, k4]
    with naming(what):
        return Lens(K, np.array(distortion), width, height, model)
