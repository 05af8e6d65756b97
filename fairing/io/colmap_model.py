"""COLMAP models as stored: numbers and names without conversion.

Text and binary files are read into the same records; `colmap.py` converts them to views.
"""

from dataclasses import dataclass

import numpy as np

from fairing.errors import InputError

# COLMAP's numbers of the camera models, used by binary files only.
MODEL_NAMES = {
    0: "SIMPLE_PINHOLE",
    1: "PINHOLE",
    2: "SIMPLE_RADIAL",
    3: "RADIAL",
    4: "OPENCV",
    5: "OPENCV_FISHEYE",
    6: "FULL_OPENCV",
    7: "FOV",
    8: "SIMPLE_RADIAL_FISHEYE",
    9: "RADIAL_FISHEYE",
    10: "THIN_PRISM_FISHEYE",
    11: "RAD_TAN_THIN_PRISM_FISHEYE",
    12: "SIMPLE_DIVISION",
    13: "DIVISION",
    14: "SIMPLE_FISHEYE",
    15: "FISHEYE",
    16: "EUCM",
    17: "EQUIRECTANGULAR",
}

# Parameter names of the supported camera models, and the model of `fairing.distortion` of those that are no polynomials.
PARAMETERS = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
    "FULL_OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    "OPENCV_FISHEYE": ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"),
    "SIMPLE_RADIAL_FISHEYE": ("f", "cx", "cy", "k1"),
    "RADIAL_FISHEYE": ("f", "cx", "cy", "k1", "k2"),
    "SIMPLE_FISHEYE": ("f", "cx", "cy"),
    "FISHEYE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_DIVISION": ("f", "cx", "cy", "k"),
    "DIVISION": ("fx", "fy", "cx", "cy", "k"),
}
DISTORTION_MODELS = {
    "OPENCV_FISHEYE": "fisheye",
    "SIMPLE_RADIAL_FISHEYE": "fisheye",
    "RADIAL_FISHEYE": "fisheye",
    "SIMPLE_FISHEYE": "fisheye",
    "FISHEYE": "fisheye",
    "SIMPLE_DIVISION": "division",
    "DIVISION": "division",
}


@dataclass(frozen=True)
class ColmapCamera:
    """Intrinsics; pixel centres at 0.5."""

    model: str
    width: int
    height: int
    parameters: dict[str, float]


@dataclass(frozen=True, eq=False)
class ColmapImage:
    """A registered photo.

    Attributes:
        quaternion: (4,) float, w x y z: camera from world.
        translation: (3,) float, world units: camera from world.
        pixels: (o, 2) float: observed features, pixel centres at 0.5.
        point_ids: (o,) int: the id of the point each of them shows, -1 for none.
    """

    name: str
    camera_id: int
    quaternion: np.ndarray
    translation: np.ndarray
    pixels: np.ndarray
    point_ids: np.ndarray


@dataclass(frozen=True, eq=False)
class ColmapPoints:
    """The points of the sparse reconstruction, without their tracks, which the images repeat.

    Attributes:
        ids: (n,) int.
        positions: (n, 3) float, world units.
        colors: (n, 3) uint8, RGB.
    """

    ids: np.ndarray
    positions: np.ndarray
    colors: np.ndarray


@dataclass(frozen=True, eq=False)
class ColmapModel:
    """Cameras and images by id; points are None where the model has no file of them."""

    cameras: dict[int, ColmapCamera]
    images: dict[int, ColmapImage]
    points: ColmapPoints | None


def parameter_names(model: str) -> tuple[str, ...]:
    """The parameters of a camera model, in the file's order.

    Raises:
        InputError: the model is not supported.
    """
    if model not in PARAMETERS:
        raise InputError(
            f"camera model {model} is not supported (expected {', '.join(PARAMETERS)}); "
            "run COLMAP's image_undistorter and use its output"
        )
    return PARAMETERS[model]
