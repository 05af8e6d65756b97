"""Masks and weights in the engine: what is masked has no say, and a photo counts as much as its weight."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from fairing.cells.visibility import Visibility
from fairing.judge.inspect import face_cells
from fairing.photo import Mask
from fairing.run.session import Session
from fairing.scene import Scene
from tests.small_scene import HEIGHT, WIDTH, corner_scene, photos, small_options

STICKER = np.s_[40:75, 70:100]


def with_mask(scene: Scene, view: int, counts: np.ndarray, folder: Path) -> Scene:
    path = folder / f"{view}.png"
    Image.fromarray(counts.astype(np.uint8) * 255).save(path)
    views = list(scene.views)
    views[view] = replace(views[view], mask=Mask(path))
    return replace(scene, views=tuple(views))


def corner_of(scene: Scene) -> np.ndarray:
    session = Session(scene, small_options())
    session.run()
    return session.vertices


def test_a_masked_sticker_has_no_say(tmp_path: Path):
    spoilt = photos()[2].copy()
    spoilt[STICKER] = 255
    counts = np.ones((HEIGHT, WIDTH), dtype=bool)
    counts[STICKER] = False
    clean = with_mask(corner_scene(), 2, counts, tmp_path)
    masked = with_mask(corner_scene(change={2: spoilt}), 2, counts, tmp_path)
    near, far = (
        np.abs(corner_of(masked) - corner_of(scene)).max() for scene in (clean, corner_scene(change={2: spoilt}))
    )
    # What is left of the sticker is its tail under the blur, beyond two sigma.
    assert near < 0.1 * far


def test_samples_of_a_cell_stay_clear_of_the_mask(tmp_path: Path):
    counts = np.ones((HEIGHT, WIDTH), dtype=bool)
    counts[STICKER] = False
    session = Session(with_mask(corner_scene(), 2, counts, tmp_path), small_options())
    session.step()
    blur = session.options.levels[session.trace.steps[0].position.level].blur
    (y0, y1), (x0, x1) = ((part.start, part.stop - 1) for part in STICKER)
    checked = 0
    for face in range(6):
        cells = face_cells(session, face, 0)
        if 2 not in cells.views.tolist():
            continue
        i = cells.views.tolist().index(2)
        rows, columns = cells.rows_and_columns
        a, b = (columns + 1 / 3) / cells.size, (rows + 1 / 3) / cells.size
        P = session.scene.views[2].camera
        X = session.trace.start[session.scene.mesh.faces[face]]
        uv, _ = P.project(np.outer(a, X[0]) + np.outer(b, X[1]) + np.outer(1 - a - b, X[2]))
        outside = np.maximum([x0 - uv[:, 0], y0 - uv[:, 1]], [uv[:, 0] - x1, uv[:, 1] - y1])
        distance = np.hypot(*np.maximum(outside, 0))
        used = cells.counts[i, : len(rows)] > 0
        checked += used.any() and not used.all()
        # Depth edges and masks are judged at half the photo's resolution.
        assert distance[used].min() > 2 * blur - 1
    assert checked


def test_a_photo_masked_as_a_whole_is_as_one_left_out(tmp_path: Path):
    scene = corner_scene()
    masked = with_mask(scene, 2, np.zeros((HEIGHT, WIDTH), dtype=bool), tmp_path)
    session, without = (
        Session(masked, small_options()),
        Session(replace(scene, views=scene.views[:2] + scene.views[3:]), small_options()),
    )
    session.step()
    without.step()
    assert (session.sweep_state(0).context.reasons[:, 2] == Visibility.HIDDEN).all()
    np.testing.assert_array_equal(session.vertices, without.vertices)


def test_energy_of_a_photo_grows_with_its_weight():
    scene = corner_scene()
    weighted = replace(scene, views=(replace(scene.views[0], weight=3.0), *scene.views[1:]))
    one, other = (face_cells(Session(s, small_options()), 0, 0) for s in (scene, weighted))
    factor = np.where(one.views == 0, 3.0, 1.0)
    np.testing.assert_allclose(other.view_energy, factor * one.view_energy, rtol=1e-12)


def test_equal_weights_change_nothing_but_the_energy_s_scale():
    scene = corner_scene()
    doubled = replace(scene, views=tuple(replace(view, weight=2.0) for view in scene.views))
    np.testing.assert_allclose(corner_of(doubled), corner_of(scene), rtol=0, atol=1e-9)
