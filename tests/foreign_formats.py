"""The same small scene as other programs would write it: a writer each, after their documents, without the code under test.

The scene is `SyntheticCapture`: world to camera x = R X + t, OpenCV axes, pixel centres at integers.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from tests.synthetic_capture import HEIGHT, WIDTH, SyntheticCapture

FLIP = np.diag([1.0, -1.0, -1.0])


@dataclass
class ForeignCapture(SyntheticCapture):
    """Square pixels and the principal point in the photo's middle, which every format can say; a lens on demand.

    Attributes:
        lens: k1, k2, p1, p2, k3 as OpenCV's.
    """

    lens: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)
    center: tuple[float, float] = ((WIDTH - 1) / 2, (HEIGHT - 1) / 2)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.pixels = [
            cv2.projectPoints(self.points, rvec, tvec, self.K, np.array(self.lens))[0][:, 0]
            for rvec, tvec in zip(self.rvecs, self.tvecs, strict=True)
        ]

    @property
    def focal(self) -> float:
        return 110.0

    @property
    def K(self) -> np.ndarray:
        return np.array([[self.focal, 0, self.center[0]], [0, self.focal, self.center[1]], [0, 0, 1]])

    def R(self, i: int) -> np.ndarray:
        return cv2.Rodrigues(self.rvecs[i])[0]

    def C(self, i: int) -> np.ndarray:
        return -self.R(i).T @ self.tvecs[i]


def write_colmap(capture: ForeignCapture, folder: Path) -> None:
    """FULL_OPENCV, centres at 0.5."""
    capture.write_text(folder / "sparse")
    k1, k2, p1, p2, k3 = capture.lens
    f, (cx, cy) = capture.focal, capture.center
    (folder / "sparse" / "cameras.txt").write_text(
        f"7 FULL_OPENCV {WIDTH} {HEIGHT} {f} {f} {cx + 0.5} {cy + 0.5} {k1} {k2} {p1} {p2} {k3} 0 0 0\n"
    )


def transforms(capture: ForeignCapture) -> dict[str, Any]:
    """nerfstudio: OpenGL axes, camera to world, centres at 0.5."""
    k1, k2, p1, p2, k3 = capture.lens
    frames = []
    for i, name in enumerate(capture.names):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = capture.R(i).T @ FLIP, capture.C(i)
        frames.append({"file_path": f"./images/{name}", "transform_matrix": pose.tolist()})
    cx, cy = capture.center
    return {
        "camera_model": "OPENCV", "fl_x": capture.focal, "fl_y": capture.focal, "cx": cx + 0.5, "cy": cy + 0.5,
        "w": WIDTH, "h": HEIGHT, "k1": k1, "k2": k2, "k3": k3, "k4": 0.0, "p1": p1, "p2": p2, "frames": frames,
    }  # fmt: skip


def write_transforms(capture: ForeignCapture, folder: Path) -> None:
    (folder / "transforms.json").write_text(json.dumps(transforms(capture)))


def write_nerf(capture: ForeignCapture, folder: Path) -> None:
    """The NeRF paper's: a field of view alone, photos without suffix."""
    content = transforms(capture)
    frames = [
        {"file_path": frame["file_path"].removesuffix(".png"), "transform_matrix": frame["transform_matrix"]}
        for frame in content["frames"]
    ]
    angle = 2 * float(np.arctan(WIDTH / 2 / capture.focal))
    (folder / "transforms.json").write_text(json.dumps({"camera_angle_x": angle, "frames": frames}))


def write_middlebury(capture: ForeignCapture, folder: Path) -> None:
    lines = [str(len(capture.names))]
    for i, name in enumerate(capture.names):
        numbers = [*capture.K.ravel(), *capture.R(i).ravel(), *capture.tvecs[i]]
        lines.append(" ".join([name, *(repr(float(number)) for number in numbers)]))
    (folder / "small_par.txt").write_text("\n".join(lines) + "\n")


def write_strecha(capture: ForeignCapture, folder: Path) -> None:
    for i, name in enumerate(capture.names):
        rows = [*capture.K, np.zeros(3), *capture.R(i).T, capture.C(i)]
        lines = [" ".join(repr(float(number)) for number in row) + " " for row in rows]
        (folder / f"{name}.camera").write_text("\n".join([*lines, f"{WIDTH} {HEIGHT}"]) + "\n")


def write_bundler(capture: ForeignCapture, folder: Path) -> None:
    """Camera looks down -z, y up; pixels from the photo's middle, y up."""
    (folder / "list.txt").write_text("".join(f"images/{name} 0 110.00000\n" for name in capture.names))
    lines = ["# Bundle file v0.3", f"{len(capture.names)} {len(capture.points)}"]
    for i in range(len(capture.names)):
        lines.append(f"{capture.focal!r} {capture.lens[0]!r} {capture.lens[1]!r}")
        lines += [" ".join(repr(float(x)) for x in row) for row in (*(FLIP @ capture.R(i)), FLIP @ capture.tvecs[i])]
    for p, point in enumerate(capture.points.tolist()):
        seen = []
        for i in range(len(capture.names)):
            x, y = capture.pixels[i][p]
            seen.append(f"{i} {p} {float(x - (WIDTH - 1) / 2)!r} {float((HEIGHT - 1) / 2 - y)!r}")
        lines += [" ".join(map(repr, point)), f"{p % 256} 20 30", f"{len(seen)} " + " ".join(seen)]
    (folder / "bundle.out").write_text("\n".join(lines) + "\n")


def openmvg(capture: ForeignCapture) -> dict[str, Any]:
    """cereal's JSON: the type's name at its first use only; here each photo has intrinsics of its own."""
    k1, k2, p1, p2, k3 = capture.lens
    views, intrinsics, extrinsics = [], [], []
    for i, name in enumerate(capture.names):
        data: dict[str, Any] = {
            "local_path": "", "filename": name, "width": WIDTH, "height": HEIGHT,
            "id_view": 10 + i, "id_intrinsic": 20 + i, "id_pose": 30 + i,
        }  # fmt: skip
        views.append({"key": 10 + i, "value": {"polymorphic_id": 1 << 30, "ptr_wrapper": {"id": i, "data": data}}})
        pinhole = {"width": WIDTH, "height": HEIGHT, "focal_length": capture.focal, "principal_point": capture.center}
        # Older versions write the base type's fields among the others, newer ones as value0.
        data = dict(pinhole) if i % 2 else {"value0": pinhole}
        data["disto_t2"] = [k1, k2, k3, p1, p2]
        kind = {"polymorphic_id": 1} if i else {"polymorphic_id": (1 << 31) + 1, "polymorphic_name": "pinhole_brown_t2"}
        intrinsics.append({"key": 20 + i, "value": {**kind, "ptr_wrapper": {"id": i, "data": data}}})
        pose = {"rotation": capture.R(i).tolist(), "center": capture.C(i).tolist()}
        extrinsics.append({"key": 30 + i, "value": pose})
    structure = [
        {
            "key": p,
            "value": {
                "X": point,
                "observations": [
                    {"key": 10 + i, "value": {"id_feat": p, "x": capture.pixels[i][p].tolist()}}
                    for i in range(len(capture.names))
                ],
            },
        }
        for p, point in enumerate(capture.points.tolist())
    ]
    return {
        "sfm_data_version": "0.3", "root_path": "/another/machine/images", "views": views, "intrinsics": intrinsics,
        "extrinsics": extrinsics, "structure": structure, "control_points": [],
    }  # fmt: skip


def write_openmvg(capture: ForeignCapture, folder: Path) -> None:
    (folder / "sfm_data.json").write_text(json.dumps(openmvg(capture)))


def alicevision(capture: ForeignCapture, version: tuple[int, int, int] = (1, 2, 14)) -> dict[str, Any]:
    """boost's JSON: every number a text, empty lists empty texts; rotations column by column."""
    k1, k2, p1, p2, k3 = capture.lens
    sensor, (cx, cy) = 36.0, capture.center
    middle = (WIDTH / 2, HEIGHT / 2) if version >= (1, 2, 1) else (0, 0)
    intrinsic: dict[str, Any] = {
        "intrinsicId": 5, "width": WIDTH, "height": HEIGHT, "sensorWidth": sensor, "sensorHeight": 24, "serialNumber": "",
        "type": "pinhole" if version >= (1, 2, 6) else "brown", "initializationMode": "none", "pixelRatio": 1,
        "principalPoint": [cx - middle[0], cy - middle[1]], "distortionParams": [k1, k2, k3, p1, p2], "locked": "false",
    }  # fmt: skip
    if version >= (1, 2, 6):
        intrinsic["distortionType"] = "brown"
    if version >= (1, 2, 2):
        intrinsic["focalLength"] = capture.focal / WIDTH * sensor
    else:
        intrinsic["pxFocalLength"] = [capture.focal] * 2 if version >= (1, 2, 0) else capture.focal
    views = [
        {"viewId": 3000000000 + i, "poseId": 40 + i, "intrinsicId": 5, "path": f"C:\\photos\\{name}", "width": WIDTH,
         "height": HEIGHT, "metadata": ""}
        for i, name in enumerate(capture.names)
    ]  # fmt: skip
    poses = [
        {"poseId": 40 + i, "pose": {"transform": {"rotation": capture.R(i).T.ravel().tolist(),
                                                  "center": capture.C(i).tolist()}, "locked": "false"}}
        for i in range(len(capture.names))
    ]  # fmt: skip
    structure = [
        {
            "landmarkId": p, "descType": "dspsift", "color": [p % 256, 20, 30], "X": point,
            "observations": [
                {"observationId": 3000000000 + i, "featureId": p, "x": capture.pixels[i][p].tolist(), "scale": 0}
                for i in range(len(capture.names))
            ],
        }
        for p, point in enumerate(capture.points.tolist())
    ]  # fmt: skip
    content = {"version": list(version), "views": views, "intrinsics": [intrinsic], "poses": poses}
    return as_texts({**content, "structure": structure})


def as_texts(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: as_texts(item) for key, item in value.items()}
    if isinstance(value, list):
        return [as_texts(item) for item in value]
    return value if isinstance(value, str) else repr(value)


def write_alicevision(capture: ForeignCapture, folder: Path) -> None:
    (folder / "cameras.sfm").write_text(json.dumps(alicevision(capture)))


def write_scene_json(capture: ForeignCapture, folder: Path) -> None:
    views = [
        {"name": name, "photo": f"images/{name}", "width": WIDTH, "height": HEIGHT, "K": capture.K.tolist(),
         "R": capture.R(i).tolist(), "t": capture.tvecs[i].tolist()}
        for i, name in enumerate(capture.names)
    ]  # fmt: skip
    (folder / "scene.json").write_text(json.dumps({"views": views}))


def write_matrices(capture: ForeignCapture, folder: Path) -> None:
    capture.write_matrices(folder / "cameras")


Writer = Callable[[ForeignCapture, Path], None]
WRITERS: dict[str, Writer] = {
    "COLMAP": write_colmap,
    "nerfstudio": write_transforms,
    "NeRF": write_nerf,
    "Middlebury": write_middlebury,
    "Strecha": write_strecha,
    "Bundler": write_bundler,
    "OpenMVG": write_openmvg,
    "Meshroom": write_alicevision,
    "matrices": write_matrices,
    "scene.json": write_scene_json,
}


def write_scene(capture: ForeignCapture, folder: Path, writer: str | Writer) -> Path:
    """Photos, a mesh and the cameras in one format; returns the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    capture.write_photos(folder / "images")
    capture.write_mesh(folder / "mesh.obj")
    (WRITERS[writer] if isinstance(writer, str) else writer)(capture, folder)
    return folder
