"""Table of refined intrinsics: its values, the photos of each camera, and what it leaves out."""

import re
from dataclasses import replace

import numpy as np

from app.panels.lens_table import lens_table
from fairing.camera import Camera
from fairing.cameras.corrected_scene import views_with
from fairing.lens import Lens
from fairing.scene import View
from tests.small_scene import HEIGHT, WIDTH, corner_scene


def rows(markup: str) -> list[list[str]]:
    """The text of the cells of each row."""
    cells = (re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row) for row in markup.split("<tr>")[1:])
    return [[re.sub("<[^>]*>", "", cell).replace("\u2212", "-") for cell in row] for row in cells]


def scaled(view: View, factor: float) -> Camera:
    K = view.camera.K @ np.diag([factor, factor, 1.0])
    return Camera(K @ view.camera.camera_from_world, WIDTH, HEIGHT)


def test_given_intrinsics_have_no_table():
    views = corner_scene().views
    assert lens_table(views, [view.camera for view in views]) == ""


def test_photos_of_one_camera_share_their_rows():
    views = list(corner_scene().views)
    views[1] = replace(views[1], name="<b>.png")
    given = [view.camera for view in views]
    K = given[0].K.copy()
    K[:2] += [[-1.5, 0, 0.25], [0, -1.5, -0.5]]
    lens = Lens(K, np.array([-0.15, 0.02]), WIDTH, HEIGHT)
    corrected = [lens if v != 1 else None for v in range(len(views))]
    cameras = [camera if v != 1 else scaled(views[1], 1.01) for v, camera in enumerate(given)]
    found = rows(lens_table(views_with(views, cameras, corrected), given))
    f, cx, cy = given[0].K[[0, 0, 1], [0, 2, 2]]
    assert found[0] == ["Lens", "given", "corrected"]
    assert found[1] == [f"{views[0].name} and {len(views) - 2} more"]
    assert found[2][1:] == [f"{f:.2f}", f"{f - 1.5:.2f}"]
    assert found[3][1:] == [f"{cx:.2f}", f"{cx + 0.25:.2f}"]
    assert found[4][1:] == [f"{cy:.2f}", f"{cy - 0.5:.2f}"]
    assert found[5] == ["Radial distortion k1", "0.0000", "-0.1500"]
    assert found[6] == ["Radial distortion k2", "0.0000", "0.0200"]
    assert found[7] == ["&lt;b&gt;.png"]
    assert found[8][1:] == [f"{f:.2f}", f"{1.01 * f:.2f}"]
    assert found[11][1:] == ["0.0000", "0.0000"]
    assert len(found) == 13
