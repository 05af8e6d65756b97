"""A small synthetic capture and its COLMAP files, written without the code under test."""

import struct
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

WIDTH, HEIGHT = 96, 72
FOCAL = (110.0, 112.0)
CENTER = (47.3, 36.1)
"""Principal point, pixel centres at integers."""

# OpenCV's k1, k2, p1, p2 and what COLMAP writes, by model.
LENSES = {
    "SIMPLE_PINHOLE": (0, 0, 0, 0),
    "PINHOLE": (0, 0, 0, 0),
    "SIMPLE_RADIAL": (-0.12, 0, 0, 0),
    "RADIAL": (-0.21, 0.07, 0, 0),
    "OPENCV": (0.11, -0.04, 0.003, -0.002),
}
MODEL_NUMBERS = {"SIMPLE_PINHOLE": 0, "PINHOLE": 1, "SIMPLE_RADIAL": 2, "RADIAL": 3, "OPENCV": 4, "OPENCV_FISHEYE": 5}

CUBE_VERTICES = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
CUBE_FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip


@dataclass
class SyntheticCapture:
    """Points in a cube of edge 2, seen by cameras on a circle of radius 7 around it."""

    model: str = "PINHOLE"
    names: tuple[str, ...] = ("a.png", "b.png", "c.png", "d.png")
    n_points: int = 40
    rvecs: list[np.ndarray] = field(init=False)
    tvecs: list[np.ndarray] = field(init=False)
    points: np.ndarray = field(init=False)
    pixels: list[np.ndarray] = field(init=False)

    def __post_init__(self) -> None:
        self.points = np.random.default_rng(1).uniform(-1, 1, (self.n_points, 3))
        angles = np.linspace(-0.5, 0.7, len(self.names))
        self.rvecs = [np.array([0.1, angle, 0.02]) for angle in angles]
        self.tvecs = [np.array([0.1, -0.1, 7.0 + angle]) for angle in angles]
        distortion = np.array(LENSES.get(self.model, LENSES["PINHOLE"]), dtype=float)
        self.pixels = [
            cv2.projectPoints(self.points, rvec, tvec, self.K, distortion)[0][:, 0]
            for rvec, tvec in zip(self.rvecs, self.tvecs, strict=True)
        ]

    @property
    def K(self) -> np.ndarray:
        fx, fy = FOCAL if self.model in ("PINHOLE", "OPENCV") else (FOCAL[0], FOCAL[0])
        return np.array([[fx, 0, CENTER[0]], [0, fy, CENTER[1]], [0, 0, 1]])

    def matrix(self, i: int) -> np.ndarray:
        """(3, 4) projection matrix of photo i."""
        return self.K @ np.column_stack([cv2.Rodrigues(self.rvecs[i])[0], self.tvecs[i]])

    @property
    def parameters(self) -> list[float]:
        """Of COLMAP's camera, pixel centres at 0.5."""
        k1, k2, p1, p2 = LENSES.get(self.model, LENSES["PINHOLE"])
        focal = list(FOCAL) if self.model in ("PINHOLE", "OPENCV") else [FOCAL[0]]
        lens = {"SIMPLE_RADIAL": [k1], "RADIAL": [k1, k2], "OPENCV": [k1, k2, p1, p2]}.get(self.model, [])
        return [*focal, CENTER[0] + 0.5, CENTER[1] + 0.5, *lens]

    def quaternion(self, i: int) -> np.ndarray:
        angle = np.linalg.norm(self.rvecs[i])
        return np.array([np.cos(angle / 2), *(np.sin(angle / 2) * self.rvecs[i] / angle)])

    def point_id(self, point: int) -> int:
        return 10 * point + 3

    def features(self, i: int) -> list[tuple[float, float, int]]:
        """x, y, point id, each second one of no point."""
        features = []
        for point, (x, y) in enumerate(self.pixels[i]):
            features += [(x + 0.5, y + 0.5, self.point_id(point)), (1.0, 2.0, -1)]
        return features

    def write_photos(self, folder: Path) -> None:
        for name in self.names:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            noise = np.random.default_rng(2).integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
            Image.fromarray(noise).save(folder / name)

    def write_mesh(self, path: Path) -> None:
        lines = [f"v {x} {y} {z}" for x, y, z in CUBE_VERTICES]
        lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in CUBE_FACES]
        path.write_text("\n".join(lines))

    def write_matrices(self, folder: Path) -> None:
        """One text file a photo."""
        folder.mkdir(parents=True, exist_ok=True)
        for i, name in enumerate(self.names):
            np.savetxt(folder / f"{Path(name).stem}.txt", self.matrix(i), fmt="%.17g")

    def write_text(self, folder: Path) -> None:
        """cameras.txt, images.txt, points3D.txt"""
        folder.mkdir(parents=True, exist_ok=True)
        parameters = " ".join(map(repr, self.parameters))
        (folder / "cameras.txt").write_text(f"# Camera list\n7 {self.model} {WIDTH} {HEIGHT} {parameters}\n")
        lines = ["# Image list"]
        for i, name in enumerate(self.names):
            pose = " ".join(repr(float(x)) for x in (*self.quaternion(i), *self.tvecs[i]))
            lines.append(f"{i + 1} {pose} 7 {name}")
            lines.append(" ".join(f"{float(x)!r} {float(y)!r} {point}" for x, y, point in self.features(i)))
        (folder / "images.txt").write_text("\n".join(lines) + "\n")
        lines = ["# Points"]
        for point, (x, y, z) in enumerate(self.points.tolist()):
            track = " ".join(f"{i + 1} {2 * point}" for i in range(len(self.names)))
            lines.append(f"{self.point_id(point)} {x!r} {y!r} {z!r} {point % 256} 20 30 0.5 {track}")
        (folder / "points3D.txt").write_text("\n".join(lines) + "\n")

    def write_binary(self, folder: Path) -> None:
        """cameras.bin, images.bin, points3D.bin"""
        folder.mkdir(parents=True, exist_ok=True)
        n = len(self.parameters)
        (folder / "cameras.bin").write_bytes(
            struct.pack(f"<QIiQQ{n}d", 1, 7, MODEL_NUMBERS[self.model], WIDTH, HEIGHT, *self.parameters)
        )
        data = struct.pack("<Q", len(self.names))
        for i, name in enumerate(self.names):
            data += struct.pack("<I7dI", i + 1, *self.quaternion(i), *self.tvecs[i], 7) + name.encode() + b"\0"
            data += struct.pack("<Q", len(self.features(i)))
            data += b"".join(struct.pack("<ddq", *feature) for feature in self.features(i))
        (folder / "images.bin").write_bytes(data)
        data = struct.pack("<Q", len(self.points))
        for point, position in enumerate(self.points):
            data += struct.pack("<Q3d3BdQ", self.point_id(point), *position, point % 256, 20, 30, 0.5, len(self.names))
            data += b"".join(struct.pack("<II", i + 1, 2 * point) for i in range(len(self.names)))
        (folder / "points3D.bin").write_bytes(data)


def write_colmap_capture(
    folder: Path, capture: SyntheticCapture | None = None, binary: bool = False
) -> SyntheticCapture:
    """A complete scene: images/, sparse/, mesh.obj."""
    capture = capture or SyntheticCapture()
    capture.write_photos(folder / "images")
    (capture.write_binary if binary else capture.write_text)(folder / "sparse")
    capture.write_mesh(folder / "mesh.obj")
    return capture
