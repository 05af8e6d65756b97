"""Painted residuals and flows are those of the engine's cells, face by face and photo by photo."""

from dataclasses import replace

import numpy as np
import pytest

from app.layers.flow_arrows import HEAD, displacement_arrows, flow_arrows
from app.page_state.page_state import PageState
from app.page_state.residual_source import flow_scale
from app.pictures.coloring import COLORINGS
from demo_scenes import load_demo
from fairing.errors import Cancelled
from fairing.judge.face_residuals import LEAST_CONFIDENCE, face_residuals
from fairing.judge.flow import face_flow, optical_flow
from fairing.judge.inspect import face_cells
from fairing.run.session import Session
from tests.small_scene import FACES, corner_scene, small_options


@pytest.fixture(scope="module")
def session():
    return Session(corner_scene(), small_options(eigenspace={"dimensions": [1]}))


def test_the_mean_residual_is_that_of_the_cells_by_photo_and_over_all(session: Session):
    session.step()
    for moment in (0, 1):
        found = face_residuals(session, moment)
        over_all = found.mean_residual()
        for face in range(len(FACES)):
            cells = face_cells(session, face, moment)
            if not cells.takes_part:
                assert np.isnan(over_all[face])
                continue
            sizes = [np.abs(cells.residual[k][cells.counts[k]].astype(float)) for k in range(len(cells.views))]
            assert over_all[face] == pytest.approx(np.concatenate(sizes).mean(), rel=1e-9)
            for view, size in zip(cells.views.tolist(), sizes, strict=True):
                assert found.mean_residual(view)[face] == pytest.approx(size.mean(), rel=1e-9)
            for view in set(range(len(session.scene.views))) - set(cells.views.tolist()):
                assert np.isnan(found.mean_residual(view)[face])
        assert np.array_equal(COLORINGS["residual"].values(session, moment), over_all, equal_nan=True)


def test_the_flow_is_the_mean_of_the_flow_field_mapped_onto_the_face_and_into_the_photo(session: Session):
    """The arrow of a face against the dense flow of its cells, which the cells panel draws, and against projection."""
    found, scene = face_residuals(session, 0), session.scene
    known = np.flatnonzero(~np.isnan(found.flow_px))
    assert len(known) > 10
    agreement = []
    for pair in known:
        face, view = int(found.faces[pair]), int(found.views[pair])
        cells = face_cells(session, face, 0)
        slot = cells.views.tolist().index(view)
        field = optical_flow(cells, window=cells.size / 6)
        mean = np.average(field.vectors[slot], axis=0, weights=field.confidence[slot])
        corners = session.trace.start[FACES[face]]
        right, down = corners[0] - corners[2], corners[1] - corners[2]
        mapped = (mean[0] * right + mean[1] * down) / cells.size
        agreement.append((found.flow[pair], mapped))
        assert found.flow[pair] @ found.normals[pair] == pytest.approx(0, abs=1e-12)
        middle, step = corners.mean(axis=0), 0.01
        moved = np.stack([middle - step * found.flow[pair], middle + step * found.flow[pair]])
        before, after = scene.views[view].camera.project(moved)[0]
        assert found.flow_px[pair] == pytest.approx(np.linalg.norm(after - before) / (2 * step), rel=1e-5)
    arrows, means = (np.array(part) for part in zip(*agreement, strict=True))
    cosine = (arrows * means).sum() / np.sqrt((arrows**2).sum() * (means**2).sum())
    assert cosine > 0.9
    assert 0.6 < np.linalg.norm(arrows) / np.linalg.norm(means) < 1.6


@pytest.mark.parametrize("inset", [0.0, 2.0])
def test_a_flow_of_one_cell_pixel_is_the_distance_of_two_samples_on_the_face(inset: float):
    session = Session(corner_scene(), small_options(eigenspace={"dimensions": [1]}, cells={"inset": [inset]}))
    found = face_residuals(session, 0)
    known = np.flatnonzero(~np.isnan(found.flow_px))
    assert len(known) > 10
    for pair in known:
        face = int(found.faces[pair])
        cells, border = face_cells(session, face, 0), float(session.sweep_state(0).context.kernel.face_inset[face])
        assert (border > 0) == (inset > 0)

        def place(row: int, column: int, face=face, size=cells.size, border=border) -> np.ndarray:
            a, b = (border + (1 - 3 * border) * (number + 1 / 3) / size for number in (column, row))
            return np.array([a, b, 1 - a - b]) @ session.trace.start[FACES[face]]

        flow = face_flow(cells)[0][cells.views.tolist().index(int(found.views[pair]))]
        expected = flow[0] * (place(3, 4) - place(3, 3)) + flow[1] * (place(4, 3) - place(3, 3))
        assert found.flow[pair] == pytest.approx(expected, rel=1e-9)


def test_the_flow_of_all_photos_is_their_mean_and_falls_when_the_vertex_reaches_its_place():
    session = Session(corner_scene(), small_options())
    start = face_residuals(session, 0)
    lengths = np.array([start.mean_flow_px(view) for view in range(len(session.scene.views))])
    seen = ~np.isnan(lengths).all(axis=0)
    assert start.mean_flow_px()[seen] == pytest.approx(np.nanmean(lengths[:, seen], axis=0))
    session.run()
    end = face_residuals(session)
    assert np.nanmean(end.mean_residual()) < 0.7 * np.nanmean(start.mean_residual())
    assert np.nanmean(end.mean_flow_px()) < np.nanmean(start.mean_flow_px())


def test_arrows_start_at_the_faces_and_are_as_long_as_asked(session: Session):
    found = face_residuals(session, 0)
    view = int(found.views[0])
    arrows, pairs = flow_arrows(found, view, 10.0)
    assert (found.views[pairs] == view).all()
    assert arrows.shape == (len(pairs), 3, 2, 3)
    shaft = arrows[:, 0, 1] - arrows[:, 0, 0]
    assert shaft == pytest.approx(10 * found.flow[pairs])
    heads = np.linalg.norm(arrows[:, 1:, 1] - arrows[:, 1:, 0], axis=-1)
    assert heads == pytest.approx(np.linalg.norm(shaft, axis=1)[:, None] * HEAD * np.hypot(1, 0.5) * np.ones((1, 2)))
    assert 0 < LEAST_CONFIDENCE < 1


@pytest.mark.parametrize("factor", [1e-6, 1.0, 1e3])
def test_arrows_of_automatic_length_fit_the_faces_whatever_the_flow(session: Session, factor: float):
    found = face_residuals(session, 0)
    found, mesh, state = replace(found, flow=factor * found.flow), session.scene.mesh, PageState()
    edge = np.median(np.linalg.norm(np.diff(mesh.vertices[mesh.edges], axis=1), axis=2))
    for view in (None, int(found.views[0])):
        state.residual_view = view
        scale = flow_scale(found, state, mesh, mesh.vertices)
        shown = ~np.isnan(found.flow_px) & (True if view is None else found.views == view)
        longest = np.quantile(np.linalg.norm(found.flow[shown], axis=1), 0.9)
        assert scale >= 1
        assert scale == 1 or 0.2 * edge < scale * longest <= 0.61 * edge
    state.flow_scale = 30
    assert flow_scale(found, state, mesh, mesh.vertices) == 30
    assert flow_scale(None, PageState(), mesh, mesh.vertices) == 1


def test_flows_of_all_photos_become_one_arrow_a_face_to_where_the_rays_meet(session: Session):
    """Every photo sees the true face where its ray meets the wrong one; the flow leads from there to where all rays meet."""
    found, scene = face_residuals(session, 0), session.scene
    centers = np.array([view.camera.center for view in scene.views])
    true = 1e-3 * np.cos(found.faces)[:, None] * found.normals
    rays = found.places + true - centers[found.views]
    reach = np.einsum("qc,qc->q", found.places - centers[found.views], found.normals)
    seen_at = centers[found.views] + (reach / np.einsum("qc,qc->q", rays, found.normals))[:, None] * rays
    one_more = 1e-3 * np.cross(found.normals, [[0.3, 0.5, 0.8]])  # what all photos share says nothing of the face
    flow = one_more - (seen_at - found.places)
    arrows, pairs = displacement_arrows(replace(found, flow=flow, flow_px=np.ones(len(flow))), centers, 10.0)
    assert sorted(found.faces[pairs]) == np.unique(found.faces).tolist(), "one arrow a face"
    shaft = arrows[:, 0, 1] - arrows[:, 0, 0]
    assert np.linalg.norm(np.cross(shaft, found.normals[pairs]), axis=1).max() < 1e-12
    share = (shaft * true[pairs]).sum(axis=1) / (10 * (true[pairs] ** 2).sum(axis=1))
    assert (share > 0.5).all()
    assert (share < 1).all()
    heads = np.linalg.norm(arrows[:, 1:, 1] - arrows[:, 1:, 0], axis=-1)
    assert heads == pytest.approx(np.linalg.norm(shaft, axis=1)[:, None] * HEAD * np.hypot(1, 0.5) * np.ones((1, 2)))


@pytest.mark.slow
def test_on_the_facade_the_arrows_point_to_the_truth():
    scene = load_demo("facade")
    found = face_residuals(Session(replace(scene, points_choice="none")), 0)
    assert scene.truth is not None
    assert scene.truth.vertices is not None
    way = (scene.truth.vertices - scene.mesh.vertices)[scene.mesh.faces].mean(axis=1)
    arrows, pairs = displacement_arrows(found, np.array([view.camera.center for view in scene.views]), 1.0)
    normals = found.normals[pairs]
    found_way, true_way = (
        np.einsum("ac,ac->a", part, normals) for part in (arrows[:, 0, 1] - arrows[:, 0, 0], way[found.faces[pairs]])
    )
    wrong = np.abs(true_way) > 1e-3 * scene.mesh.diagonal
    agreeing = (np.sign(found_way) == np.sign(true_way))[wrong].mean()
    assert agreeing > 0.8, f"{agreeing:.2f} of {wrong.sum()} faces"


def test_it_stops_when_it_is_cancelled(session: Session):
    session.cancel_requested = lambda: True
    with pytest.raises(Cancelled):
        face_residuals(session, 0)
    session.cancel_requested = lambda: False


def test_it_reports_face_by_face_what_it_does(session: Session):
    seen: list[tuple[str, int, int]] = []

    def look() -> bool:
        seen.extend((work.text, work.done, work.count) for work in session.work.current)
        return False

    session.cancel_requested = look
    face_residuals(session, 0)
    session.cancel_requested = lambda: False
    assert [entry for entry in seen if "flow" in entry[0]] == [
        ("measuring flow", k, len(FACES)) for k in range(len(FACES))
    ]
    assert session.work.current == ()
