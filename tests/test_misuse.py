"""A library of another version is not reported as a damaged file; a damaged file is not reported as a fault of the program."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image

from fairing.lens import Lens
from fairing.photo import FilePhoto
from fairing.util.npz import read_npz


def test_a_call_that_opencv_refuses_is_no_damaged_photo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    Image.fromarray(np.zeros((48, 64, 3), np.uint8)).save(tmp_path / "a.png")
    K = np.array([[60.0, 0, 32], [0, 60, 24], [0, 0, 1]])
    photo = FilePhoto(tmp_path / "a.png", Lens(K, np.array([0.01]), 64, 48))

    def refuse(*_: Any, **__: Any) -> None:
        raise cv2.error("'criteria' is an invalid keyword argument")

    monkeypatch.setattr(cv2, "remap", refuse)
    with pytest.raises(cv2.error, match="criteria"):
        photo.load()


def test_a_missing_function_of_numpy_is_no_damaged_archive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    np.savez(tmp_path / "a.npz", a=np.zeros(3))
    monkeypatch.delattr(np.lib.format, "read_magic")
    with (tmp_path / "a.npz").open("rb") as file, pytest.raises(AttributeError, match="read_magic"):
        read_npz(file)
