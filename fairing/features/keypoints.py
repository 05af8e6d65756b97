"""SIFT keypoints of a photo with RootSIFT descriptors."""

from dataclasses import dataclass

import cv2
import numpy as np

from fairing.camera import resizing
from fairing.features.options import FeatureOptions
from fairing.lens import Lens
from fairing.scene import View

BLUNT_SCALE = 1.5
"""Scale in px from which on a keypoint's error grows with its scale (ledger: keypoint sigma)."""
DESCRIPTOR_LENGTH = 512
"""Length of a descriptor before it is rounded. Scalar products of such descriptors are whole numbers below 2^24, so single
precision holds them, and each of their partial sums, exactly: matches do not depend on the order of a summation."""


@dataclass(frozen=True, eq=False)
class Keypoints:
    """Keypoints of one photo, ordered by row and column.

    Attributes:
        pixels: (n, 2) float, px, integers at pixel centres.
        scale: (n,) float, px: standard deviation of the Gaussian at which the keypoint was found.
        descriptors: (n, 128) uint8: RootSIFT (Arandjelovic and Zisserman, CVPR 2012) times `DESCRIPTOR_LENGTH`, rounded.
        colors: (n, 3) uint8, RGB of the nearest pixel.
        contrast: (n,) float: fraction of the grey range.
    """

    pixels: np.ndarray
    scale: np.ndarray
    descriptors: np.ndarray
    colors: np.ndarray
    contrast: np.ndarray

    def __len__(self) -> int:
        return len(self.pixels)

    def undistorted(self, lens: Lens) -> "Keypoints":
        """The keypoints in the undistorted photo, without those that it does not show."""
        pixels = lens.undistort(self.pixels)
        shown = np.isfinite(pixels).all(axis=1)
        return Keypoints(pixels[shown], *(values[shown] for name, values in vars(self).items() if name != "pixels"))

    def strongest(self, count: int) -> "Keypoints":
        """The `count` keypoints of the highest contrast, and those that equal the last of them."""
        if len(self) <= count:
            return self
        kept = self.contrast >= np.partition(self.contrast, -count)[-count]
        return Keypoints(*(values[kept] for values in vars(self).values()))


def detect_keypoints(view: View, options: FeatureOptions, most: int = 0) -> Keypoints:
    """The keypoints of a view's photo, none within two scales of a pixel that its mask excludes.

    Args:
        most: only so many, see `Keypoints.strongest`; 0 for all.

    OpenCV's default doubles the photo with its outer borders unmoved, which places every keypoint 0.25 px too far right
    and down; `enable_precise_upscale` keeps pixel centres where they are.

    Raises:
        InputError: the photo or mask cannot be decoded.
    """
    photo = view.photo.load()
    size = (view.camera.width, view.camera.height)
    shrink = min(1.0, (options.max_megapixels * 1e6 / (size[0] * size[1])) ** 0.5)
    reduced = (max(1, round(size[0] * shrink)), max(1, round(size[1] * shrink)))
    grey = cv2.cvtColor(photo, cv2.COLOR_RGB2GRAY)
    if reduced != size:
        grey = cv2.resize(grey, reduced, interpolation=cv2.INTER_AREA)
    # Without a mask OpenCV can choose the strongest itself, and then computes no descriptors of the others.
    sift = cv2.SIFT.create(
        most if view.mask is None else 0, contrastThreshold=options.contrast, enable_precise_upscale=True
    )
    found, descriptors = sift.detectAndCompute(grey, None)  # pyright: ignore[reportArgumentType, reportCallIssue]
    if len(found) == 0:
        return Keypoints(
            np.zeros((0, 2)), np.zeros(0), np.zeros((0, 128), np.uint8), np.zeros((0, 3), np.uint8), np.zeros(0)
        )
    raw = np.array([(*point.pt, point.size / 2, point.angle, point.response) for point in found])
    photo_from_reduced = resizing(reduced, size)
    pixels = raw[:, :2] @ photo_from_reduced[:2, :2].T + photo_from_reduced[:2, 2]
    scale = raw[:, 2] / shrink
    kept = np.lexsort((raw[:, 3], scale, pixels[:, 0], pixels[:, 1]))
    column, row = np.clip(np.round(pixels).astype(int), 0, np.array(size) - 1).T
    if view.mask is not None:
        # Pixels beyond the photo's border are not excluded; a mask that excludes nothing has no distances.
        counts = view.mask.load()
        clear = np.full(counts.shape, np.inf) if counts.all() else cv2.distanceTransform(
            counts.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE
        )  # fmt: skip
        kept = kept[(clear[row, column] > 2 * scale)[kept]]
    keypoints = Keypoints(
        pixels[kept], scale[kept], _root_sift(descriptors[kept]), photo[row[kept], column[kept]], raw[kept, 4]
    )
    return keypoints.strongest(most) if most else keypoints


def relative_sigma(scale: np.ndarray) -> np.ndarray:
    """(n,) float: standard deviations of keypoints' coordinates relative to the finest keypoints', from their scales, px."""
    return np.sqrt(1 + (scale / BLUNT_SCALE) ** 2)


def _root_sift(descriptors: np.ndarray) -> np.ndarray:
    """(n, 128) uint8: the square roots of SIFT descriptors (n, 128) divided by their sums."""
    total = np.maximum(descriptors.sum(axis=1, dtype=np.float64, keepdims=True), 1e-12)
    return np.clip(np.round(DESCRIPTOR_LENGTH * np.sqrt(descriptors / total)), 0, 255).astype(np.uint8)
