"""Small inputs of the kinds that people have: their cameras are those of the COLMAP model they were made from."""

from pathlib import Path

import numpy as np
import pytest

from fairing.io import read_capture

FILES = Path(__file__).parents[2] / "shared" / "files"
pytestmark = pytest.mark.skipif(not FILES.is_dir(), reason=f"{FILES} is not there")


def cameras_of(name: str) -> dict[str, np.ndarray]:
    views = read_capture(FILES / name).views
    return {Path(view.name).stem: view.camera.image_from_world for view in views}


@pytest.mark.parametrize("name", ["exif", "scene.nvm", "opensfm", "metashape"])
def test_cameras_are_those_of_the_colmap_model(name: str):
    expected, found = cameras_of("colmap"), cameras_of(name)
    assert expected.keys() == found.keys()
    for stem, P in expected.items():
        np.testing.assert_allclose(found[stem], P, rtol=0, atol=1e-9)


def test_the_named_transform_brings_the_cameras_world_back():
    expected, found = cameras_of("colmap"), cameras_of("applied")
    frame = read_capture(FILES / "applied").frames[0]
    transform = np.vstack([np.column_stack([frame.linear, frame.shift]), (0, 0, 0, 1)])
    for stem, P in expected.items():
        np.testing.assert_allclose(found[stem] @ transform, P, rtol=0, atol=1e-9)
