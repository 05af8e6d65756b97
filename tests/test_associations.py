"""Associations of the terms, against slow searches and against the truth."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from app.layers.associations import axis_lines, edge_lines, point_lines, seen_lines
from app.page_state.page_state import ASSOCIATIONS, LAYERS, PageState
from app.palette import AXIS_COLORS, LOCKED
from app.panels.legend import association_lines
from demo_scenes.building.scene import scene_of_plan
from fairing.judge.associations import axis_edges, image_edges, point_feet, seen_faces
from fairing.judge.inspect import face_cells
from fairing.run.session import Session
from fairing.terms.image_edges import SEARCHES
from tests.small_building import small_building
from tests.small_scene import VERTICES, corner_scene, observed, on_the_faces, small_options, sparse_points

pytestmark = pytest.mark.compiled


def distance_from_line(points: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    along = (second - first) / np.linalg.norm(second - first)
    offset = points - first
    return np.abs(offset[:, 0] * along[1] - offset[:, 1] * along[0])


def test_a_photo_sees_the_faces_whose_cells_are_taken_from_it():
    session = Session(corner_scene(), small_options())
    session.step()
    seen = seen_faces(session, 1)
    for face in range(6):
        assert np.flatnonzero(seen[face]).tolist() == sorted(face_cells(session, face, 1).views.tolist())
    lines, _ = seen_lines(seen[:, 0], session.scene.mesh, session.vertices)
    sides = {
        frozenset(pair)
        for face in session.scene.mesh.faces[seen[:, 0]]
        for pair in zip(face, np.roll(face, 1), strict=True)
    }
    assert len(lines) == len(sides), "an edge between two faces is drawn once"


def test_image_edges_lie_on_the_true_crease_where_the_mesh_is_off_it(monkeypatch: pytest.MonkeyPatch):
    session = Session(corner_scene((0.03, -0.03, 0.02)), small_options())
    widest = replace(session.sweep_state(0), edge_search=SEARCHES[0])  # as a start begins that is far off
    monkeypatch.setattr(session, "sweep_state", lambda moment: widest)
    off, found_off, weights = [], [], []
    for view, camera in enumerate(v.camera for v in session.scene.views):
        edges = image_edges(session, 0, view)
        true_px, _ = camera.project(VERTICES)
        found = edges.crease, edges.crease_px, edges.edge_px, edges.weights
        for pair, crease, edge, weight in zip(*found, strict=True):
            if 0 in pair:  # the others are the outline of the mesh, or are not displaced
                first, second = true_px[pair]
                off += distance_from_line(crease[None], first, second).tolist()
                found_off += distance_from_line(edge[None], first, second).tolist()
                weights.append(weight)
    is_off = np.array(off) > 0.7  # px
    assert is_off.sum() >= 5
    # Some are other edges nearby; those of the crease have most of the weight.
    assert np.average(np.array(found_off)[is_off] < 0.3, weights=np.array(weights)[is_off]) > 0.5


def test_lines_of_image_edges_lead_to_them_in_the_photo_and_rejected_ones_are_grey():
    session = Session(corner_scene(), small_options())
    camera, edges = session.scene.views[0].camera, image_edges(session, 0, 0)
    lines, colors = edge_lines(edges, camera, session.vertices)
    ticks, bars = np.split(lines, 2)
    # To second order of offsets of a few pixels.
    assert np.abs(camera.project(ticks[:, 1])[0] - edges.edge_px).max() < 0.1
    middles = camera.project(bars.mean(axis=1))[0]
    assert np.abs(middles - edges.edge_px).max() < 0.1
    grey = (colors == LOCKED).all(axis=1)
    assert (grey == np.tile(edges.rejected, 2)).all()
    offset_px = np.linalg.norm(edges.edge_px - edges.crease_px, axis=1)
    assert offset_px[~edges.rejected].max() < offset_px[edges.rejected].min()


def test_edges_of_a_building_follow_its_axes_and_a_corner_without_a_frame_has_none():
    scene = scene_of_plan("building small", small_building())
    assert scene.truth is not None
    session = Session(replace(scene, mesh=scene.mesh.moved(scene.truth.vertices)))
    found = axis_edges(session, 0)
    assert found.axes @ found.axes.T == pytest.approx(np.eye(3), abs=1e-6)
    assert set(found.axis.tolist()) == {0, 1, 2}
    vertices = session.vertices
    along = vertices[found.edges[:, 1]] - vertices[found.edges[:, 0]]
    cosine = np.abs((along * found.axes[found.axis]).sum(axis=1)) / np.linalg.norm(along, axis=1)
    assert (cosine > np.cos(np.radians(8.0))).all()
    lines, colors = axis_lines(found, vertices)
    assert (lines[:, 1] - lines[:, 0] == along).all()
    assert {tuple(color) for color in colors.tolist()} == set(AXIS_COLORS)
    assert len(axis_edges(Session(corner_scene(), small_options()), 0).edges) == 0


def test_points_are_at_the_closest_point_of_their_face_and_far_ones_are_rejected():
    scene = corner_scene()
    far = np.array([[3.0, 3.0, 3.0], [-2.0, 0.5, 0.5]])
    session = Session(
        replace(scene, sparse_points=sparse_points(np.vstack([on_the_faces(120), far, far]))), small_options()
    )
    found = point_feet(session, 0)
    mesh = trimesh.Trimesh(session.vertices, session.scene.mesh.faces, process=False)
    feet, distance, _ = trimesh.proximity.closest_point_naive(mesh, found.positions)
    assert found.feet == pytest.approx(feet, abs=1e-9)
    is_far = np.abs(found.positions).max(axis=1) > 1.5
    assert is_far.any()
    assert (found.weights[is_far] == 0).all()
    assert found.rejected[is_far].all()
    near = distance < np.median(distance[~is_far])
    assert (found.weights[near] == 1).all()
    assert not found.rejected[near].any()
    lines, colors = point_lines(found)
    assert ((colors == LOCKED).all(axis=1) == found.rejected).all()
    assert (lines[:, 0] == found.positions).all()


def test_points_that_their_photos_do_not_show_on_the_mesh_take_no_part():
    ground = np.array([[4.0, 4.0, -3.0]])  # no ray to it meets the corner
    session = Session(observed(corner_scene(), np.vstack([on_the_faces(60), ground])), small_options())
    found = point_feet(session, 0)
    assert len(found.positions)
    assert np.abs(found.positions - ground).max(axis=1).min() > 1


def test_a_scene_without_points_has_no_feet():
    assert len(point_feet(Session(corner_scene(), small_options()), 0).positions) == 0


def test_associations_are_hidden_at_first_and_the_legend_counts_them():
    page_state = PageState.of_mesh(7)
    assert set(LAYERS) >= ASSOCIATIONS
    assert not any(page_state.shows(layer) for layer in ASSOCIATIONS)
    session = Session(corner_scene(), small_options())
    session.step()
    nothing = dict.fromkeys(ASSOCIATIONS)
    assert association_lines(nothing, None) == []
    edges, seen = image_edges(session, 1, 0), seen_faces(session, 1)
    names = [name for name, _ in association_lines(nothing | {"image edges": edges, "seen": seen}, 0)]
    assert f"{int((~edges.rejected).sum())} image edges" in names
    assert f"{int(seen[:, 0].sum())} faces seen by this photo" in names
