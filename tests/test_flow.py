"""Flows against exact shifts, finite differences, and each other."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, shift

from fairing.judge.flow import lucas_kanade, model_flow, optical_flow, step_flow
from fairing.judge.inspect import face_cells
from fairing.run.session import Session
from tests.small_scene import FACES, START, VERTICES, corner_scene, small_options


def texture(size: int) -> np.ndarray:
    return 40 * gaussian_filter(np.random.default_rng(0).normal(size=(size, size)), 2.5) / 0.11


@pytest.mark.parametrize("motion", [(0.6, -0.3), (0.0, 0.8), (-0.5, -0.5)])
def test_a_shift_is_found_with_its_direction(motion):
    """target(u + f) = image(u): the target is the image moved by f (column, row)."""
    image = texture(64)
    target = shift(image, (motion[1], motion[0]), order=5, mode="mirror")
    flow, confidence = lucas_kanade(image, target, np.ones(image.shape, bool), 4.0)
    inner = flow[10:-10, 10:-10]
    assert confidence[10:-10, 10:-10].min() > 0.5
    # Slopes are central differences, 5 % too small for waves of a dozen pixels; then the flow is so much too large.
    assert np.abs(inner - motion).max() < 0.1 * np.linalg.norm(motion) + 0.02
    assert np.median(inner, axis=(0, 1)) == pytest.approx(motion, abs=0.05)


def test_along_an_edge_only_the_motion_across_it_is_known():
    x = np.arange(48.0)
    image = np.tile(60 * np.tanh((x - 24) / 3), (48, 1))
    target = np.tile(60 * np.tanh((x - 24.5) / 3), (48, 1))
    flow, confidence = lucas_kanade(image, target, np.ones(image.shape, bool), 3.0)
    assert flow[24, 24] == pytest.approx([0.5, 0], abs=0.05)
    assert confidence.max() < 1e-6


def test_masked_pixels_have_no_influence():
    image = texture(64)
    target = shift(image, (0.2, 0.4), order=5, mode="mirror")
    valid = np.ones(image.shape, bool)
    valid[20:40, 20:40] = False
    spoilt = np.where(valid, target, np.nan)
    flow, confidence = lucas_kanade(image, spoilt, valid, 3.0)
    assert np.isfinite(flow).all()
    assert not flow[20:40, 20:40].any()
    assert not confidence[20:40, 20:40].any()
    assert flow[10, 30] == pytest.approx([0.4, 0.2], abs=0.06)


@pytest.mark.parametrize("inset", [0.0, 2.0])
@pytest.mark.parametrize("warp", ["homography", "affine"])
def test_model_flow_is_what_a_small_displacement_does(warp, inset):
    session = Session(corner_scene(), small_options(cells={"warp": warp, "inset": [inset]}))
    cells = face_cells(session, 1)
    vertices, corner, eta = session.vertices, 2, np.array([1e-5, -2e-5, 1.5e-5])
    flow = model_flow(session.scene, vertices, cells, corner, eta, affine=warp == "affine")
    moved = vertices.copy()
    moved[corner] += eta
    rows, columns = cells.rows_and_columns
    border = float(session.sweep_state(0).context.kernel.face_inset[1])
    assert (border > 0) == (inset > 0)
    spacing = (1 - 3 * border) / cells.size
    ramp = border + spacing * np.stack([columns + 1 / 3, rows + 1 / 3], axis=1)
    bary = np.column_stack([ramp, 1 - ramp.sum(axis=1)])
    for i, view in enumerate(cells.views):
        camera = session.scene.views[view].camera

        def photo_place(positions: np.ndarray, camera=camera) -> np.ndarray:
            corners = positions[FACES[1]]
            return bary @ camera.project(corners)[0] if warp == "affine" else camera.project(bary @ corners)[0]

        before, after = photo_place(vertices), photo_place(moved)
        assert flow.photo_places[i] == pytest.approx(before)
        assert np.abs(flow.photo_vectors[i] - (after - before)).max() < 1e-3 * np.abs(after - before).max()
        # In the cell: the warp of the face as it was takes the new place back to where the old cell shows it.
        at = int(np.argmax(np.abs(after - before).sum(axis=1)))
        x, y = after[at]
        guess = _cell_position(camera, vertices[FACES[1]], np.array([x, y]), warp)
        expected = (guess[:2] - bary[at, :2]) / spacing
        assert flow.vectors[i, at] == pytest.approx(expected, rel=1e-2, abs=1e-7)
        J = camera.J_image_wrt_point(vertices[corner])
        assert flow.vertex_vectors[i] == pytest.approx(J @ eta)


def _cell_position(camera, corners: np.ndarray, uv: np.ndarray, warp: str) -> np.ndarray:
    """Barycentric weights of the point of a face at a pixel."""
    if warp == "affine":
        photo, _ = camera.project(corners)
        return np.linalg.solve(np.vstack([photo.T, np.ones(3)]), [*uv, 1])
    homogeneous = camera.image_from_world[:, :3] @ corners.T + camera.image_from_world[:, 3:]
    weights = np.linalg.solve(homogeneous, [*uv, 1])
    return weights / weights.sum()


def test_the_other_two_corners_and_their_edge_stay():
    session = Session(corner_scene(), small_options())
    cells = face_cells(session, 0)
    flow = model_flow(session.scene, session.vertices, cells, 0, np.array([0.01, 0, 0]))
    far = np.argsort(flow.places[:, 0])[: cells.size]  # column 0: the edge opposite to corner 0
    lengths = np.linalg.norm(flow.vectors, axis=2)
    assert lengths[:, far].max() < 2 / cells.size * lengths.max()
    with pytest.raises(ValueError, match="expected a corner of face 0"):
        model_flow(session.scene, session.vertices, cells, 6, np.zeros(3))


def test_optical_flow_points_against_the_model_flow_of_the_right_correction():
    """The paper's figure 4 (b) and (c)."""
    options = small_options(eigenspace={"dimensions": [1]}, schedule={"blur": [1.2]}, cells={"spacing": [0.5]})
    session = Session(corner_scene((0.02, -0.015, 0.02)), options)
    eta = VERTICES[0] - session.vertices[0]
    cosines = []
    for face in range(6):
        cells = face_cells(session, face)
        model = model_flow(session.scene, session.vertices, cells, 0, eta)
        optical = optical_flow(cells, window=8.0)
        # The mean over views is common to all cells and part of the texture: only differences between views show.
        expected = model.vectors - model.vectors.mean(axis=0)
        trust = optical.confidence[..., None]
        a, b = (trust * expected).ravel(), (trust * optical.vectors).ravel()
        cosines.append(a @ b / np.linalg.norm(a) / np.linalg.norm(b))
    # Found -0.71 on average, -0.59 at worst, with vectors of 0.5 to 1 times the expected length.
    assert np.mean(cosines) < -0.6, cosines
    assert max(cosines) < -0.35, cosines


def test_flow_vectors_have_the_requested_spacing():
    session = Session(corner_scene(START), small_options(cells={"color": True}))
    cells = face_cells(session, 0)
    flow = optical_flow(cells, spacing=4)
    assert (flow.places % 4 == 0).all()
    assert flow.vectors.shape == (len(cells.views), len(flow.places), 2)
    assert len(flow.places) == pytest.approx(cells.size**2 / 32, rel=0.3)


def test_the_flow_of_a_step_is_the_sum_over_the_corners_it_moved():
    session = Session(corner_scene(), small_options())
    cells, before = face_cells(session, 1), session.vertices
    after = before.copy()
    after[[0, 3]] += [[1e-3, 0, 2e-3], [0, -1e-3, 1e-3]]
    after[6] += 1  # no corner of face 1
    parts = [model_flow(session.scene, before, cells, v, after[v] - before[v]) for v in (0, 3)]
    flow = step_flow(session.scene, before, after, cells)
    assert flow is not None
    assert flow.vectors == pytest.approx(parts[0].vectors + parts[1].vectors)
    assert step_flow(session.scene, before, before, cells) is None
    sparse = step_flow(session.scene, before, after, cells, spacing=5)
    assert sparse is not None
    chosen = (flow.places % 5 == 0).all(axis=1)
    assert sparse.vectors == pytest.approx(flow.vectors[:, chosen])
    assert np.array_equal(sparse.places, optical_flow(cells, spacing=5).places)


def test_a_reduced_optical_flow_is_nearly_the_full_one():
    options = small_options(schedule={"blur": [2.0]}, cells={"spacing": [0.3]})
    session = Session(corner_scene((0.02, -0.015, 0.02)), options)
    cells = face_cells(session, 0)
    full, reduced = (optical_flow(cells, window=8.0, spacing=8, reduction=r) for r in (1, 2))
    assert np.array_equal(full.places[: len(reduced.places)], reduced.places)
    trust = np.minimum(full.confidence, reduced.confidence)[..., None]
    a, b = (trust * full.vectors).ravel(), (trust * reduced.vectors).ravel()
    assert a @ b / np.linalg.norm(a) / np.linalg.norm(b) > 0.95
    # Central differences over wider pixels are smaller, so the flow is longer: found 1.26 times.
    assert np.linalg.norm(b) == pytest.approx(np.linalg.norm(a), rel=0.35)
