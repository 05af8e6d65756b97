"""The small scene as OpenSfM, VisualSFM, Metashape and RealityScan would write it, after their documents.

Each program's lens is written and projected here in its own notation, without the code under test. `distort` maps rays (n, 2)
to distorted rays.
"""

import json
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tests.foreign_formats import FLIP, ForeignCapture, alicevision, openmvg, transforms
from tests.synthetic_capture import HEIGHT, WIDTH

SIDE = max(WIDTH, HEIGHT)
MIDDLE = np.array([(WIDTH - 1) / 2, (HEIGHT - 1) / 2])  # pixel centres at integers

Distort = Callable[[np.ndarray], np.ndarray]
Lens = dict[str, float]


def undistorted(rays: np.ndarray) -> np.ndarray:
    return rays


@dataclass
class ProgramCapture(ForeignCapture):
    """Points that fill the photos, seen through a lens.

    Attributes:
        distort: distorted rays of the lens, in the program's notation.
        skew, stretch: pixels by which one unit of a distorted ray's y and x moves x.
    """

    n_points: int = 60
    distort: Distort = undistorted
    skew: float = 0.0
    stretch: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self.points = np.random.default_rng(3).uniform((-2.3, -1.7, -1), (2.3, 1.7, 1), (self.n_points, 3))
        self.pixels = [self.project(i) for i in range(len(self.names))]

    def project(self, i: int) -> np.ndarray:
        """(n, 2) distorted pixels of the points in photo i."""
        x = self.points @ self.R(i).T + self.tvecs[i]
        rays = self.distort(x[:, :2] / x[:, 2:])
        pixels = self.focal * rays + np.array(self.center)
        pixels[:, 0] += self.skew * rays[:, 1] + self.stretch * rays[:, 0]
        return pixels


def radius2(rays: np.ndarray) -> np.ndarray:
    return (rays**2).sum(axis=1, keepdims=True)


# ---------------------------------------------------------------------- OpenSfM


def opensfm(capture: ForeignCapture, kind: str = "brown", lens: Lens | None = None) -> list[dict]:
    """Lengths over the larger side; one focal length in some kinds, two in the others."""
    focal, center = capture.focal / SIDE, (np.array(capture.center) - MIDDLE) / SIDE
    camera: dict = {"projection_type": kind, "width": WIDTH, "height": HEIGHT}
    if kind in ("perspective", "fisheye"):
        camera |= {"focal": focal}
    else:
        camera |= {"focal_x": focal, "focal_y": focal, "c_x": center[0], "c_y": center[1]}
    shots = {
        name: {"rotation": capture.rvecs[i].tolist(), "translation": capture.tvecs[i].tolist(), "camera": "c"}
        for i, name in enumerate(capture.names)
    }
    points = {
        str(7 * p): {"coordinates": x, "color": [p % 256, 20.0, 30.0]} for p, x in enumerate(capture.points.tolist())
    }
    return [{"cameras": {"c": camera | (lens or {})}, "shots": shots, "points": points}]


def write_opensfm(capture: ForeignCapture, folder: Path, kind: str = "brown", lens: Lens | None = None) -> None:
    (folder / "reconstruction.json").write_text(json.dumps(opensfm(capture, kind, lens)))
    lines = ["OPENSFM_TRACKS_VERSION_v2"]
    for i, name in enumerate(capture.names):
        for p, pixel in enumerate(capture.pixels[i]):
            x, y = (pixel - MIDDLE) / SIDE
            lines.append(f"{name}\t{7 * p}\t{p}\t{float(x)!r}\t{float(y)!r}\t0.004\t{p % 256}\t20\t30\t-1\t-1")
        lines.append(f"{name}\tunknown\t9\t0.1\t0.1\t0.004\t1\t1\t1\t-1\t-1")
    (folder / "tracks.csv").write_text("\n".join(lines) + "\n")


def brown(k1: float, k2: float, k3: float, p1: float, p2: float) -> Distort:
    def distort(rays: np.ndarray) -> np.ndarray:
        r2, (x, y) = radius2(rays), rays.T
        tangential = [2 * p1 * x * y + p2 * (r2[:, 0] + 2 * x * x), 2 * p2 * x * y + p1 * (r2[:, 0] + 2 * y * y)]
        return rays * (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) + np.stack(tangential, axis=1)

    return distort


def fisheye(k1: float = 0, k2: float = 0, k3: float = 0, k4: float = 0) -> Distort:
    def distort(rays: np.ndarray) -> np.ndarray:
        r = np.sqrt(radius2(rays))
        angle = np.arctan2(r, 1)
        return rays / r * (angle + k1 * angle**3 + k2 * angle**5 + k3 * angle**7 + k4 * angle**9)

    return distort


# ---------------------------------------------------------------------- VisualSFM


def write_nvm(capture: ForeignCapture, folder: Path, r1: float = 0.0, fixed: bool = False) -> None:
    cx, cy = (float(x) + 0.5 for x in capture.center)
    header = f"NVM_V3 FixedK {capture.focal} {cx!r} {capture.focal} {cy!r} {r1!r}" if fixed else "NVM_V3"
    lines = [header, "", str(len(capture.names))]
    for i, name in enumerate(capture.names):
        pose = " ".join(repr(float(x)) for x in (*capture.quaternion(i), *capture.C(i)))
        lines.append(f"images\\{name}\t{capture.focal!r} {pose} {r1!r} 0")
    lines += ["", str(len(capture.points))]
    for p, point in enumerate(capture.points.tolist()):
        seen = [f"{i} {p} " + " ".join(repr(float(x)) for x in capture.pixels[i][p] - capture.center) for i in range(4)]
        lines.append(" ".join([*map(repr, point), f"{p % 256} 20 30", str(len(seen)), *seen]))
    (folder / "scene.nvm").write_text("\n".join([*lines, "", "0", "", "#the last part of NVM", "0", ""]))


def measured_radial(r1: float) -> Distort:
    """m with (1 + r1 |m|^2) m = ray, by the roots of the cubic."""

    def distort(rays: np.ndarray) -> np.ndarray:
        radii = np.sqrt(radius2(rays))[:, 0]
        found = []
        for radius in radii:
            roots = np.roots([r1, 0, 1, -radius])
            real = roots[np.abs(roots.imag) < 1e-9].real
            found.append(real[real > 0].min())
        return rays * (np.array(found) / radii)[:, None]

    return distort


# ---------------------------------------------------------------------- Metashape


def metashape(
    capture: ForeignCapture, kind: str = "frame", lens: Lens | None = None, similarity: np.ndarray | None = None
) -> ElementTree.Element:
    """The world is `similarity` (4, 4) times the chunk's frame; labels without ending."""
    world = np.eye(4) if similarity is None else similarity
    scale = float(np.cbrt(np.linalg.det(world[:3, :3])))
    root = ElementTree.Element("document", version="2.0.0")
    chunk = ElementTree.SubElement(root, "chunk", label="Chunk 1", enabled="true")
    sensor = ElementTree.SubElement(
        ElementTree.SubElement(chunk, "sensors", next_id="1"), "sensor", id="0", label="unknown", type=kind
    )
    ElementTree.SubElement(sensor, "resolution", width=str(WIDTH), height=str(HEIGHT))
    calibration = ElementTree.SubElement(sensor, "calibration", {"type": kind, "class": "adjusted"})
    ElementTree.SubElement(calibration, "resolution", width=str(WIDTH), height=str(HEIGHT))
    cx, cy = np.array(capture.center) - MIDDLE
    for tag, value in ({"f": capture.focal, "cx": cx, "cy": cy} | (lens or {})).items():
        ElementTree.SubElement(calibration, tag).text = repr(float(value))
    component = ElementTree.SubElement(
        ElementTree.SubElement(chunk, "components", next_id="1"), "component", id="0", label="Component 1"
    )
    transform = ElementTree.SubElement(component, "transform")
    for tag, values in (("rotation", world[:3, :3] / scale), ("translation", world[:3, 3]), ("scale", np.array(scale))):
        ElementTree.SubElement(transform, tag).text = " ".join(repr(x) for x in values.ravel().tolist())
    cameras = ElementTree.SubElement(chunk, "cameras", next_id="9", next_group_id="1")
    group = ElementTree.SubElement(cameras, "group", id="0", label="Group", type="folder")
    for i, name in enumerate(capture.names):
        world_from_camera = np.eye(4)
        world_from_camera[:3, :3], world_from_camera[:3, 3] = capture.R(i).T, capture.C(i)
        chunk_from_camera = np.linalg.inv(world) @ world_from_camera
        chunk_from_camera[:3, :3] *= scale
        camera = ElementTree.SubElement(
            group if i else cameras,
            "camera",
            id=str(i),
            sensor_id="0",
            component_id="0",
            label=Path(name).stem,
            enabled="true",
        )
        text = " ".join(repr(x) for x in chunk_from_camera.ravel().tolist())
        ElementTree.SubElement(camera, "transform").text = text
    return root


def write_metashape(
    capture: ForeignCapture,
    folder: Path,
    kind: str = "frame",
    lens: Lens | None = None,
    similarity: np.ndarray | None = None,
) -> None:
    root = metashape(capture, kind, lens, similarity)
    (folder / "cameras.xml").write_text(
        '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode")
    )


def metashape_frame(k: tuple[float, ...], p1: float, p2: float) -> Distort:
    """Metashape's p1 and p2 change places with OpenCV's."""

    def distort(rays: np.ndarray) -> np.ndarray:
        r2, (x, y) = radius2(rays), rays.T
        tangential = [p1 * (r2[:, 0] + 2 * x * x) + 2 * p2 * x * y, p2 * (r2[:, 0] + 2 * y * y) + 2 * p1 * x * y]
        return rays * (1 + k[0] * r2 + k[1] * r2**2 + k[2] * r2**3 + k[3] * r2**4) + np.stack(tangential, axis=1)

    return distort


# ---------------------------------------------------------------------- RealityScan


def write_realityscan(capture: ForeignCapture, folder: Path, lens: Lens | None = None) -> None:
    """Angles of Rz(-heading) Rx(pitch) Ry(roll), from the camera's axes x right, y up, z backwards to the world."""
    columns = ("k1", "k2", "k3", "k4", "t1", "t2")
    px, py = (np.array(capture.center) - MIDDLE) / SIDE
    lines = ["#name,x,y,alt,heading,pitch,roll,f,px,py," + ",".join(columns)]
    for i, name in enumerate(capture.names):
        R = capture.R(i).T @ FLIP
        # R = Rz(h) Rx(p) Ry(r): R[2, 1] = sin p, R[0, 1] = -sin h cos p, R[2, 0] = -cos p sin r.
        pitch = np.arcsin(R[2, 1])
        heading = -np.arctan2(-R[0, 1], R[1, 1])
        roll = np.arctan2(-R[2, 0], R[2, 2])
        angles = np.degrees([heading, pitch, roll])
        numbers = [
            *capture.C(i),
            *angles,
            capture.focal / SIDE * 36,
            px,
            py,
            *((lens or {}).get(c, 0.0) for c in columns),
        ]
        lines.append(",".join([name, *(repr(float(number)) for number in numbers)]))
    (folder / "cameras.csv").write_text("\n".join(lines) + "\n")


# ---------------------------------------------------------------------- lenses of programs that are read already


def write_colmap_lens(capture: ForeignCapture, folder: Path, model: str, lens: tuple[float, ...]) -> None:
    """A model of one focal length, or two, with the given parameters of distortion."""
    capture.write_text(folder / "sparse")
    focal = [capture.focal] * (1 if model.startswith(("SIMPLE", "RADIAL")) else 2)
    numbers = [*focal, *(np.array(capture.center) + 0.5), *lens]
    (folder / "sparse" / "cameras.txt").write_text(
        f"7 {model} {WIDTH} {HEIGHT} " + " ".join(repr(float(number)) for number in numbers) + "\n"
    )


def write_nerfstudio_lens(capture: ForeignCapture, folder: Path, model: str, lens: dict[str, Any]) -> None:
    content = transforms(capture) | {"camera_model": model} | lens
    (folder / "transforms.json").write_text(json.dumps(content))


def write_meshroom_fisheye(capture: ForeignCapture, folder: Path, lens: tuple[float, ...]) -> None:
    content = alicevision(capture)
    content["intrinsics"][0] |= {"distortionType": "fisheye4", "distortionParams": [repr(k) for k in lens]}
    (folder / "cameras.sfm").write_text(json.dumps(content))


def write_openmvg_fisheye(capture: ForeignCapture, folder: Path, lens: tuple[float, ...]) -> None:
    content = openmvg(capture)
    for item in content["intrinsics"]:
        value = item["value"]
        if "polymorphic_name" in value:
            value["polymorphic_name"] = "fisheye"
        value["ptr_wrapper"]["data"]["fisheye"] = list(lens)
    (folder / "sfm_data.json").write_text(json.dumps(content))


PROGRAM_WRITERS: dict[str, Callable[[ForeignCapture, Path], None]] = {
    "OpenSfM": write_opensfm,
    "VisualSFM": write_nvm,
    "Metashape": write_metashape,
    "RealityScan": write_realityscan,
}
