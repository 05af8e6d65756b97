"""The unit and the origin of the world: results are the same relative to the diagonal, from a millionth to a million."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from demo_scenes.building.scene import scene_of_plan
from fairing import fair
from fairing.check.scene_check import check_scene
from fairing.features import find_points
from fairing.geometry.closest_point import SurfaceTree
from fairing.geometry.triangles import barycentric, closest_on_triangles
from fairing.mesh import Mesh
from fairing.registration.alignment import Match, Similarity, refine_by_closest_points, register_matches
from fairing.registration.scan_points import critical_points
from fairing.scene import Scene
from fairing.solve.point_split import observed_fitting_points
from fairing.terms.point_rays import points_on_surface
from fairing.trace import Trace
from fairing.triangulation import triangulate
from tests.other_frames import in_frame
from tests.small_building import small_building
from tests.small_scene import FACES, VERTICES, corner_scene, observed, on_the_faces
from tests.terrain_scene import seen_points, terrain

SCALES = (1e-6, 1e-3, 1e3, 1e6)
UTM = (500_000.0, 4_650_000.0, 100.0)
"""Metres: an origin as of projected coordinates."""


# ---------------------------------------------------------------------- runs


@pytest.fixture(scope="module")
def corner() -> Scene:
    """With points that every photo shows: the start is fitted to them, its creases are aligned in the last level."""
    return replace(observed(corner_scene(), on_the_faces()), truth=None)


@pytest.fixture(scope="module")
def end(corner) -> np.ndarray:
    return fair(corner).vertices


@pytest.mark.parametrize("scale", SCALES)
def test_a_run_ends_at_the_same_place_in_any_unit(corner, end, scale):
    """Measured: up to 2.4e-6 of the diagonal. Vertices rest when a step moves them by less than 0.001 px, 1e-5 of it."""
    other = fair(in_frame(corner, scale)).vertices / scale
    assert np.abs(other - end).max() < 1e-5 * corner.mesh.diagonal


@pytest.mark.parametrize("exponent", [-20, 10])
def test_a_power_of_two_rounds_nothing(corner, end, exponent):
    """Only the camera matrices are rounded, since they are normalized: measured 8e-15 of the diagonal."""
    other = np.ldexp(fair(in_frame(corner, 2.0**exponent)).vertices, -exponent)
    assert np.abs(other - end).max() < 1e-10 * corner.mesh.diagonal


def test_a_run_ends_at_the_same_place_in_projected_coordinates(corner, end, tmp_path):
    """Coordinates of 4.65e6 resolve 1e-9, less than the cells do. The record holds them in full."""
    session = fair(in_frame(corner, shift=UTM))
    assert np.abs(session.vertices - UTM - end).max() < 1e-5 * corner.mesh.diagonal
    session.trace.attach(tmp_path / "run.trace")
    session.trace.detach()
    again = Trace.load(tmp_path / "run.trace")
    np.testing.assert_array_equal(again.vertices_at(len(again)), session.vertices)


@pytest.fixture(scope="module")
def building() -> Scene:
    return replace(scene_of_plan("building small", small_building()), truth=None)


@pytest.fixture(scope="module")
def end_of_building(building) -> np.ndarray:
    return fair(building).vertices


@pytest.mark.slow
@pytest.mark.parametrize("scale", [2.0**-20, 2.0**20])
def test_a_building_with_a_manhattan_frame_ends_at_the_same_place_in_any_unit(building, end_of_building, scale):
    """Powers of two round nothing but the normalized camera matrices: measured 3e-15 of the diagonal. Other scales round
    differently, which single vertices that the photos hardly determine magnify to half a percent of the diagonal."""
    other = fair(in_frame(building, scale)).vertices / scale
    assert np.abs(other - end_of_building).max() < 1e-10 * building.mesh.diagonal


# ---------------------------------------------------------------------- geometry


@pytest.mark.parametrize("scale", [*SCALES, 1e-80, 1e90])
def test_closest_points_and_barycentric_coordinates_have_no_unit(scale):
    rng = np.random.default_rng(0)
    triangles, points = rng.normal(size=(5000, 3, 3)), 1.5 * rng.normal(size=(5000, 3))
    triangles[::10, 2] = triangles[::10, 0] + 1e-3 * (triangles[::10, 2] - triangles[::10, 0])  # needles
    plain, scaled = closest_on_triangles(triangles, points), closest_on_triangles(scale * triangles, scale * points)
    # Rounding of the coordinates, 1e-16, is magnified by the needles' ratio of 1e3, squared.
    np.testing.assert_allclose(scaled / scale, plain, atol=1e-9)
    np.testing.assert_allclose(
        barycentric(scale * triangles, scale * points), barycentric(triangles, points), rtol=1e-8, atol=1e-8
    )


def test_closest_points_are_those_of_a_dense_sample():
    rng = np.random.default_rng(1)
    triangles, points = rng.normal(size=(40, 3, 3)), 1.5 * rng.normal(size=(40, 3))
    u, v = (w.ravel() for w in np.meshgrid(*2 * [np.linspace(0, 1, 201)]))
    weights = np.column_stack([1 - u - v, u, v])[u + v <= 1 + 1e-12]
    sample = np.einsum("wk,tkx->twx", weights, triangles)
    best = np.linalg.norm(sample - points[:, None], axis=2).min(axis=1)
    found = closest_on_triangles(triangles, points)
    distance = np.linalg.norm(found - points, axis=1)
    assert (distance <= best + 1e-12).all()
    assert (best - distance).max() < 0.02  # the spacing of the sample
    on_plane = np.einsum("tk,tkx->tx", barycentric(triangles, found), triangles)
    np.testing.assert_allclose(on_plane, found, atol=1e-9)


def test_of_faces_at_the_closest_point_the_one_that_faces_the_point_most_is_found():
    """Beside the edges and corners of a box faces are equally near: rounding decides nothing, whatever the frame and the order."""
    rng = np.random.default_rng(3)
    box = trimesh.creation.box((2.0, 1.0, 0.7))
    points = 3 * rng.uniform(-1, 1, size=(2000, 3))
    distance = np.linalg.norm(
        closest_on_triangles(np.repeat(box.triangles, len(points), axis=0), np.tile(points, (12, 1)))
        - np.tile(points, (12, 1)),
        axis=1,
    ).reshape(12, -1)
    height = np.abs(np.einsum("fpk,fk->fp", points - box.triangles[:, :1], box.face_normals))
    facing = np.where(distance < distance.min(axis=0) + 1e-9, height, -1).max(axis=0)
    for unit in (1.0, 1e-3, 7.0):
        turn, order = unit * Rotation.random(random_state=1).as_matrix(), rng.permutation(12)
        found, face = SurfaceTree(Mesh(box.vertices @ turn.T, box.faces[order])).closest(points @ turn.T)
        np.testing.assert_allclose(found / unit, distance.min(axis=0), atol=1e-9)
        np.testing.assert_allclose(height[order[face], np.arange(len(points))], facing, atol=1e-9)


def test_triangles_with_coinciding_corners_count_as_edges():
    rng = np.random.default_rng(2)
    ends, points = rng.normal(size=(500, 2, 3)), rng.normal(size=(500, 3))
    along = ends[:, 1] - ends[:, 0]
    part = np.clip(((points - ends[:, 0]) * along).sum(axis=1) / (along**2).sum(axis=1), 0, 1)
    foot = ends[:, 0] + part[:, None] * along
    for corners in ((0, 0, 1), (0, 1, 0), (0, 1, 1)):
        found = closest_on_triangles(ends[:, corners], points)
        np.testing.assert_allclose(found, foot, atol=1e-12)
    np.testing.assert_array_equal(closest_on_triangles(ends[:, [0, 0, 0]], points), ends[:, 0])
    assert np.isfinite(barycentric(ends[:, [0, 0, 1]], points)).all()


def test_rays_hit_the_same_faces_far_from_the_origin(corner):
    """float32 resolves 0.5 m at 4,650,000 m, more than the whole mesh measures."""
    cameras, points = [view.camera for view in corner.views], observed_fitting_points(corner)
    here = points_on_surface(corner.mesh, cameras, points)
    far = in_frame(corner, 0.1, UTM)
    there = points_on_surface(far.mesh, [view.camera for view in far.views], observed_fitting_points(far))
    assert here.all()
    assert there.all()


# ---------------------------------------------------------------------- other commands


@pytest.mark.parametrize("scale", SCALES)
def test_points_of_the_photos_are_the_same_in_any_unit(scale):
    scene = scene_of_plan("building small", small_building())
    views = scene.views[:5]
    plain, other = find_points(views), find_points(in_frame(replace(scene, views=views, truth=None), scale).views)
    assert len(plain) > 50
    assert len(other) == len(plain)
    # A camera matrix is rounded to 1e-16; rays that meet at 2 degrees magnify that 1e3 times, and so do distances.
    assert np.abs(other.positions / scale - plain.positions).max() < 1e-9 * scene.mesh.diagonal
    np.testing.assert_allclose(other.covariance / scale**2, plain.covariance, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("scale", SCALES)
def test_the_check_is_the_same_in_any_unit(corner, scale):
    plain, other = check_scene(corner), check_scene(in_frame(corner, scale))
    assert (other.verdict, other.reasons, other.hints) == (plain.verdict, plain.reasons, plain.hints)
    np.testing.assert_allclose(other.footprint, plain.footprint, rtol=1e-9)
    assert other.parallax == pytest.approx(plain.parallax, rel=1e-9)


@pytest.mark.parametrize("frame", [(scale, (0.0, 0.0, 0.0)) for scale in SCALES] + [(1.0, UTM)])
def test_a_triangulation_is_the_same_in_any_unit(frame):
    vertices, views = terrain()
    points = seen_points(vertices, views=views)
    scene = Scene.build("terrain", vertices, np.array([[0, 1, 2]]), views, sparse_points=points)
    other = in_frame(scene, *frame)
    one, two = (triangulate("terrain", s.views, s.sparse_points) for s in (scene, other))
    np.testing.assert_array_equal(one.faces, two.faces)


@pytest.mark.parametrize("scan_frame", [(scale, (0.0, 0.0, 0.0)) for scale in SCALES] + [(1.0, UTM)])
@pytest.mark.parametrize("kind", ["two photos", "one photo each"])
def test_matches_register_a_scan_in_any_unit(kind, scan_frame):
    scale, shift = scan_frame
    views, rotation = corner_scene().views, Rotation.from_euler("xyz", [40, -70, 130], degrees=True).as_matrix()
    scan = scale * (VERTICES - 0.3) @ rotation + shift
    seen = {"two photos": (0, 3), "one photo each": (0,)}[kind]
    matches = [
        Match(point, None, tuple((v, views[v].camera.project(vertex)[0]) for v in seen))
        for point, vertex in zip(scan, VERTICES, strict=True)
    ]
    found = register_matches(matches, views)
    assert found.errors.max() < 1e-3
    if kind == "two photos":
        assert np.abs(found.world_from_scan.apply(scan) - VERTICES).max() < 1e-5


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("kind", ["surface", "points"])
def test_closest_points_register_a_scan_in_any_unit(kind, scale):
    targets, cloud = on_the_faces(900), on_the_faces(6000, seed=4)
    off = Similarity(1.03, Rotation.from_rotvec([0.02, -0.03, 0.01]).as_matrix(), np.array([0.02, 0.01, -0.02]))

    def end(unit: float) -> np.ndarray:
        start = Similarity(off.scale / unit, off.rotation, off.translation)
        shape = Mesh(unit * VERTICES, FACES) if kind == "surface" else unit * cloud
        return refine_by_closest_points(shape, start, targets).world_from_scan.apply(unit * VERTICES)

    # Rounds end when the scan moves by 1e-7 of its extent.
    assert np.abs(end(scale) - end(1.0)).max() < 1e-6


@pytest.mark.parametrize("scale", SCALES)
def test_the_chosen_points_of_a_scan_are_the_same_in_any_unit(scale):
    points = np.random.default_rng(6).uniform(0, 1, (3000, 3))
    points[np.arange(3000), np.arange(3000) % 3] = 1
    one, other = critical_points(points, 0.05), critical_points(scale * points, 0.05 * scale)
    np.testing.assert_allclose(other.positions / scale, one.positions, atol=1e-12)


@pytest.mark.parametrize("scale", SCALES)
def test_distances_to_a_surface_have_the_unit_of_the_world(scale):
    scene = corner_scene()
    points = np.random.default_rng(7).normal(size=(500, 3))
    one = SurfaceTree(scene.mesh).closest(points)
    other = SurfaceTree(Mesh(scale * scene.mesh.vertices, scene.mesh.faces)).closest(scale * points)
    np.testing.assert_allclose(other[0] / scale, one[0], rtol=1e-12, atol=1e-15)
