"""Photos as the page shows them: masks, and the model beside the photo."""

from pathlib import Path

import numpy as np
from PIL import Image

from app.pictures.predictor import SEAM, Prediction
from app.pictures.shown_photo import MASKED_BRIGHTNESS, shown_photo
from fairing.camera import Camera
from fairing.photo import ArrayPhoto, Mask
from fairing.scene import View


def grey_view(mask: Path | None) -> View:
    camera = Camera(np.array([[100.0, 0, 20, 0], [0, 100, 10, 0], [0, 0, 1, 0]]), 40, 20)
    photo = ArrayPhoto(np.full((20, 40, 3), 200, dtype=np.uint8))
    return View("a", camera, photo, None if mask is None else Mask(mask))


def test_what_a_mask_leaves_out_is_dark_and_the_rest_is_the_photo(tmp_path):
    counts = np.full((20, 40), 255, dtype=np.uint8)
    counts[:, :15] = 0
    Image.fromarray(counts).save(tmp_path / "mask.png")
    shown = shown_photo(grey_view(tmp_path / "mask.png"))
    assert (shown[:, 15:] == 200).all()
    assert (shown[:, :15] < 200 * (MASKED_BRIGHTNESS + 0.3)).all()
    assert np.array_equal(shown_photo(grey_view(None)), grey_view(None).photo.load())


def test_a_swipe_shows_the_photo_on_the_left_and_the_prediction_on_the_right():
    photo = np.full((20, 400, 3), 50, dtype=np.uint8)
    known = np.ones((20, 400), dtype=bool)
    known[:5] = False
    found = Prediction(0, np.zeros((1, 3)), np.full((20, 400, 3), 150, dtype=np.float32), known)
    shown = found.beside(photo, 0.25)
    assert (shown[:, :299] == 50).all()
    assert (shown[:, 299:301] == SEAM).all()
    assert (shown[5:, 301:] == 150).all()
    assert (shown[:5, 301:] == 50).all(), "where nothing is predicted the photo stays"
