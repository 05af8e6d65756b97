"""Photo background: every photo lies where a centred window camera draws the points that the photo shows."""

import numpy as np
import pytest

from app.viser_bridge.photo_background import fit_photo, photo_background
from fairing.camera import Camera


def camera(fx: float, fy: float, cx: float, cy: float, skew: float = 0.0) -> Camera:
    return Camera.from_krt(np.array([[fx, skew, cx], [0, fy, cy], [0, 0, 1]]), np.eye(3), np.zeros(3), 640, 480)


CAMERAS = {
    "centred": camera(700, 700, 319.5, 239.5),
    "off centre": camera(700, 700, 250.0, 300.0),
    "unequal focal lengths": camera(700, 640, 319.5, 239.5),
    "skew and off centre": camera(650, 700, 400.0, 200.0, 12.0),
}


@pytest.mark.parametrize("name", CAMERAS)
@pytest.mark.parametrize("window", [(800, 450), (400, 900)])
def test_points_are_drawn_on_their_pixels_and_the_whole_photo_is_in_the_window(name, window):
    view = CAMERAS[name]
    fit = fit_photo(view, *window)
    points = np.array([[0.1, -0.2, 2.0], [-0.5, 0.3, 2.5], [0.4, 0.4, 3.0], [0.0, 0.0, 1.0]])
    focal = window[1] / 2 / np.tan(fit.fov / 2)
    drawn = focal * points[:, :2] / points[:, 2:] + np.array(window) / 2 - 0.5
    in_photo = np.column_stack([drawn, np.ones(len(drawn))]) @ fit.photo_from_window.T
    assert np.allclose(in_photo, view.project(points)[0], atol=1e-9)
    corners = np.array([[-0.5, -0.5], [639.5, -0.5], [-0.5, 479.5], [639.5, 479.5]])
    in_window = (corners - fit.photo_from_window[:, 2]) @ np.linalg.inv(fit.photo_from_window[:, :2]).T
    assert (in_window >= -0.5 - 1e-6).all()
    assert (in_window <= np.array(window) - 0.5 + 1e-6).all()


def test_the_photo_is_surrounded_by_the_color_of_the_theme():
    view = CAMERAS["centred"]
    photo = np.full((480, 640, 3), 200, dtype=np.uint8)
    picture = photo_background(photo, fit_photo(view, 400, 900), 400, 900, (10, 20, 30))
    assert (picture[5] == (10, 20, 30)).all()
    assert (picture[450, 20:-20] == 200).all()
