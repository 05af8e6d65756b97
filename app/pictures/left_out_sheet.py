"""Contact sheet of held-out photos: each photo, and the error of its prediction before and after a run."""

import cv2
import numpy as np
from PIL import Image, ImageDraw

from fairing.judge.left_out import LeftOut, Prediction
from fairing.scene import Scene

TILE = 420  # px: width of a picture
GAP = 6
CAPTION = 20
DIFFERENCE_GAIN = 4.0
BACKGROUND = (24, 26, 29)
TEXT = (222, 225, 229)


class LeftOutSheet:
    """Rows of three pictures: the photo, the prediction error before, the prediction error after."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._rows: list[tuple[int, np.ndarray]] = []

    def add(self, prediction: Prediction) -> None:
        """Add the row of a photo, reduced to the size of the sheet."""
        known = prediction.is_known[..., None]
        errors = [np.where(known, DIFFERENCE_GAIN * np.abs(image - prediction.photo), 0) for image in prediction.images]
        pictures = [prediction.photo, *errors]
        height, width = prediction.photo.shape[:2]
        size = (TILE, max(1, round(height * TILE / width)))
        small = [cv2.resize(np.clip(picture, 0, 255), size, interpolation=cv2.INTER_AREA) for picture in pictures]
        gap = np.full((size[1], GAP, 3), BACKGROUND, dtype=np.float32)
        self._rows.append((prediction.view, np.hstack([small[0], gap, small[1], gap, small[2]]).astype(np.uint8)))

    def picture(self, before: LeftOut, after: LeftOut) -> Image.Image:
        """The sheet: all rows, captioned with PSNR and SSIM before and after."""
        height = CAPTION + sum(row.shape[0] + CAPTION + GAP for _, row in self._rows)
        sheet = Image.new("RGB", (3 * TILE + 4 * GAP, height + GAP), BACKGROUND)
        draw = ImageDraw.Draw(sheet)
        heads = ("photo (left out)", f"error before, x{DIFFERENCE_GAIN:g}", f"error after, x{DIFFERENCE_GAIN:g}")
        for column, head in enumerate(heads):
            draw.text((GAP + column * (TILE + GAP), 5), head, TEXT)
        y = CAPTION
        for i, (view, row) in enumerate(self._rows):
            sheet.paste(Image.fromarray(row), (GAP, y))
            y += row.shape[0]
            share = before.share[i]
            judged = f"{share:.0%} of its pixels evaluated" if np.isfinite(share) else "not evaluated"
            captions = [f"{self._scene.views[view].name}   {judged}"]
            captions += [f"PSNR {one.psnr[i]:.2f} dB   SSIM {one.ssim[i]:.4f}" for one in (before, after)]
            for column, caption in enumerate(captions):
                draw.text((GAP + column * (TILE + GAP), y + 3), caption, TEXT)
            y += CAPTION + GAP
        return sheet
