"""Demo scenes: the ray caster against slow geometry, exact truth, starts as promised, and the cache."""

import os
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

import demo_scenes.photography
from demo_scenes import DEMOS, Photography, load_demo
from demo_scenes.cube import DEFAULT_DISPLACEMENT, FACES, VERTICES, cube_cameras, cube_stage
from demo_scenes.dome import sphere_cap
from demo_scenes.lighting import light_lattice
from demo_scenes.noise import seeded
from demo_scenes.photography import looking_at, take_photos
from demo_scenes.planar import triangulate
from demo_scenes.raycast import SHININESS, photograph
from demo_scenes.surface import PaintedSurface, Stage
from fairing.camera import Camera
from fairing.errors import InputError
from fairing.geometry.normals import unit_normals
from fairing.geometry.rasterize import rasterize
from fairing.scene import Scene

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def cache_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("EIGENFAIRING_CACHE", str(tmp_path))
    return tmp_path


@pytest.fixture
def geometry_of(monkeypatch):
    """Scenes without the cost of their photos, which are black."""
    monkeypatch.setattr(
        demo_scenes.photography, "cached_photos", lambda scene, options, shape, make: np.zeros(shape, np.uint8)
    )
    return load_demo


def small_camera(camera: Camera, factor: float = 0.25) -> Camera:
    shift = (factor - 1) / 2
    finer = np.array([[factor, 0, shift], [0, factor, shift], [0, 0, 1]])
    return Camera(finer @ camera.image_from_world, round(camera.width * factor), round(camera.height * factor))


def small_cube(gloss: float = 0.0) -> Stage:
    rng = seeded(5)
    sides = [rng.integers(20, 230, (40, 40, 3)).astype(np.uint8) for _ in range(3)]
    return replace(cube_stage(sides, Photography()), gloss=gloss)


def slow_color(stage: Stage, camera: Camera, u: float, v: float) -> np.ndarray | None:
    """Colour on the ray through (u, v): each face's plane in turn, no shortcut; None where it meets no face."""
    surface = stage.surface
    M = camera.image_from_world[:, :3]
    ray = np.linalg.solve(M, [u, v, 1.0])
    best, color = np.inf, None
    for f, corners in enumerate(surface.vertices[surface.faces]):
        A = np.column_stack([ray, corners[0] - corners[1], corners[0] - corners[2]])
        distance, b, c = np.linalg.solve(A, corners[0] - camera.center)
        if not (0 < distance < best and b >= 0 and c >= 0 and b + c <= 1):
            continue
        best = distance
        x, y = np.array([1 - b - c, b, c]) @ surface.texel[f]
        texture = surface.textures[surface.texture_of_face[f]].astype(float)
        rows, columns = np.arange(len(texture)), np.arange(texture.shape[1])
        weight_y, weight_x = np.maximum(1 - np.abs(rows - y), 0), np.maximum(1 - np.abs(columns - x), 0)
        albedo = np.einsum("y,x,yxc->c", weight_y, weight_x, texture)
        normal = surface.normals[f, 0]
        sun = max(normal @ stage.sun_direction, 0)
        eye = -ray / np.linalg.norm(ray) + stage.sun_direction
        glint = stage.gloss * sun * max(normal @ eye / np.linalg.norm(eye), 0) ** SHININESS
        color = albedo * (sun * stage.sun_color + stage.sky_color) + glint
    return color


@pytest.mark.parametrize("gloss", [0.0, 60.0])
def test_photo_agrees_with_a_slow_ray_tracer(gloss):
    stage, camera, samples = small_cube(gloss), small_camera(cube_cameras()[7]), 3
    photo = photograph(stage, light_lattice(stage), camera, samples)
    inside = camera.project(VERTICES)[0]
    low, high = inside.min(axis=0), inside.max(axis=0)
    compared = 0
    for u, v in np.rint(seeded(1).uniform(low, high, (40, 2))).astype(int):
        offsets = (np.arange(samples) + 0.5) / samples - 0.5
        rays = [slow_color(stage, camera, u + dx, v + dy) for dy in offsets for dx in offsets]
        colors = [ray for ray in rays if ray is not None]
        if len(colors) < len(rays):
            continue
        compared += 1
        np.testing.assert_allclose(photo[v, u], np.mean(colors, axis=0), atol=1e-6)
    assert compared > 15, compared


def test_silhouette_has_the_area_and_centroid_of_the_projected_cube():
    white = [np.full((2, 2, 3), 200, np.uint8)] * 3
    stage = replace(
        cube_stage(white, Photography()),
        sun_color=np.zeros(3),
        sky_color=np.ones(3),
        background=np.zeros((2, 3)),
    )
    for camera in (small_camera(camera, 0.5) for camera in cube_cameras()[::5]):
        coverage = photograph(stage, light_lattice(stage), camera, 8)[..., 0] / 200
        hexagon = camera.project(VERTICES[1:])[0]
        x, y = hexagon.T
        x1, y1 = np.roll(x, -1), np.roll(y, -1)
        cross = x * y1 - x1 * y
        area = abs(cross.sum()) / 2
        centroid = np.array([((x + x1) * cross).sum(), ((y + y1) * cross).sum()]) / (3 * cross.sum())
        v, u = np.mgrid[0 : camera.height, 0 : camera.width]
        found = np.array([(coverage * u).sum(), (coverage * v).sum()]) / coverage.sum()
        # 8 x 8 samples a pixel place the border to about 1/100 px on average.
        assert abs(coverage.sum() - area) < 1e-3 * area, (coverage.sum(), area)
        assert np.abs(found - centroid).max() < 0.01, (found, centroid)


IDEAL = Photography()


def shoot(photography: Photography = IDEAL, calls: list | None = None, **stage_options) -> np.ndarray:
    cameras = [small_camera(camera) for camera in cube_cameras()[:4]]

    def build() -> Stage:
        if calls is not None:
            calls.append(1)
        return replace(small_cube(), **stage_options)

    views = take_photos("small", cameras, build, VERTICES, photography, 2, None)
    return np.array([view.photo.load() for view in views])


def test_photos_do_not_depend_on_the_number_of_threads(monkeypatch, tmp_path):
    options = Photography(noise=2, exposure=0.1, occluders=True)
    photos = []
    for threads in (1, 2, 5):
        monkeypatch.setattr(os, "cpu_count", lambda threads=threads: threads)
        monkeypatch.setenv("EIGENFAIRING_CACHE", str(tmp_path / str(threads)))
        photos.append(shoot(options))
    assert all(other.tobytes() == photos[0].tobytes() for other in photos)


def test_photos_come_from_the_cache_until_it_is_damaged(cache_folder):
    calls: list[int] = []
    first = shoot(calls=calls)
    assert shoot(calls=calls).tobytes() == first.tobytes()
    assert len(calls) == 1
    [file] = cache_folder.glob("*.npz")
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 0xFF
    for damaged in (bytes(content), content[: len(content) // 3], b""):
        file.write_bytes(damaged)
        assert shoot(calls=calls).tobytes() == first.tobytes()
        assert file.stat().st_size == len(content)
    assert len(calls) == 4
    assert [path.name for path in cache_folder.iterdir()] == [file.name]


def test_a_cache_that_cannot_be_written_is_done_without(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("EIGENFAIRING_CACHE", str(tmp_path / "file"))
    assert shoot().any()


def test_options_change_the_photos_as_promised():
    clean = shoot().astype(float)
    noisy = shoot(Photography(noise=3)) - clean
    inner = (clean > 15) & (clean < 240)
    assert abs(noisy[inner].std() - np.sqrt(9 + 1 / 6)) < 0.1, noisy[inner].std()
    gains = [
        np.median((photo / c)[(c > 60) & (c < 200)])
        for photo, c in zip(shoot(Photography(exposure=0.15)), clean, strict=True)
    ]
    assert np.ptp(gains) > 0.03
    assert 0.84 < min(gains) <= max(gains) < 1.16, gains
    hidden = np.abs(shoot(Photography(occluders=True)) - clean).max(axis=-1) > 8
    assert 0.01 < hidden.mean() < 0.3, hidden.mean()


def test_light_is_dark_under_a_roof_and_bright_above():
    square = np.array([[-1, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]], float)
    vertices = np.vstack([4 * square, square + np.array([0, 1, 0])])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    gray = np.full((2, 2, 3), 100, np.uint8)
    surface = PaintedSurface.flat(vertices, faces, np.zeros(4, int), np.zeros((4, 3, 2)), [gray])
    up = np.array([0, 1.0, 0])
    stage = Stage(surface, up, np.ones(3), np.ones(3), np.zeros((2, 3)), up, light_steps=16)
    light = light_lattice(stage)
    middle, corner = light[0, 0, 8], light[0, 0, 0]  # half-way along the edge from (-4, -4) to (4, 4), and its start
    assert middle[0] == 0
    assert corner[0] == 1
    assert middle[1] < 0.85 * corner[1]
    assert (light[2:, 1:8, 1:8, 0] == 1).all()


@pytest.mark.parametrize("name", list(DEMOS))
def test_meshes_are_two_manifold_without_cracks(geometry_of, name):
    mesh = geometry_of(name).mesh
    directed = Counter((face[k], face[(k + 1) % 3]) for face in mesh.faces.tolist() for k in range(3))
    assert max(directed.values()) == 1, "two faces run along an edge in the same direction"
    truth = geometry_of(name).truth.vertices
    for a, b in (edge for edge in directed if edge[::-1] not in directed):
        along = truth[b] - truth[a]
        t = (truth - truth[a]) @ along / (along @ along)
        off = np.linalg.norm(truth - truth[a] - t[:, None] * along, axis=1)
        assert not ((off < 1e-6) & (t > 1e-6) & (t < 1 - 1e-6)).any(), f"a vertex lies on border edge {a}-{b}"


@pytest.mark.parametrize(
    ("name", "low", "high"), [("facade", 0.007, 0.01), ("archway", 0.003, 0.005), ("dome", 0.004, 0.005)]
)
def test_start_is_as_wrong_as_promised_and_turns_no_face(geometry_of, name, low, high):
    scene: Scene = geometry_of(name)
    truth = scene.truth.vertices
    diagonal = np.linalg.norm(np.ptp(truth, axis=0))
    error = np.linalg.norm(scene.mesh.vertices - truth, axis=1) / diagonal
    assert low - 1e-9 <= error.min() <= error.max() <= high + 1e-9, (error.min(), error.max())
    true, start = (unit_normals(places, scene.mesh.faces)[0] for places in (truth, scene.mesh.vertices))
    cosines = (true * start).sum(axis=1)
    assert cosines.min() > 0.5, cosines.min()
    assert (geometry_of(name, start_seed=1).mesh.vertices == scene.mesh.vertices).all()
    assert (geometry_of(name, start_seed=2).mesh.vertices != scene.mesh.vertices).any()


def test_facade_start_lies_on_the_true_surface(geometry_of):
    scene = geometry_of("facade")
    truth = scene.truth.surface
    corners = truth.vertices[truth.faces]
    normals, _ = unit_normals(truth.vertices, truth.faces)
    inward = np.cross(normals[:, None], np.roll(corners, -1, axis=1) - corners)
    for vertex in scene.mesh.vertices:
        in_plane = np.abs(((vertex - corners[:, 0]) * normals).sum(axis=1)) < 1e-6
        inside = ((inward * (vertex - corners)).sum(axis=2) > -1e-6).all(axis=1)
        assert (in_plane & inside).any(), vertex


@pytest.mark.parametrize("name", ["facade", "archway"])
def test_all_outward_faces_are_seen_by_three_photos(geometry_of, name):
    scene = geometry_of(name)
    truth = scene.truth.surface
    seen = np.zeros(len(truth.faces), int)
    for view in scene.views:
        face_id, _ = rasterize(truth.vertices, truth.faces, view.camera)
        seen += np.bincount(face_id[face_id >= 0], minlength=len(truth.faces)) >= 20
    hidden = seen < 3
    assert hidden.mean() < 0.08, hidden.sum()
    used = np.unique(truth.faces[~hidden])
    assert len(used) >= len(truth.vertices) - 6, len(truth.vertices) - len(used)


def test_truth_says_what_photos_can_determine(geometry_of):
    cube = geometry_of("cube").truth
    assert [len(normals) for normals in cube.normals] == [3, 2, 1, 2, 1, 2, 1]
    facade = geometry_of("facade")
    counts = Counter(len(normals) for normals in facade.truth.normals)
    assert counts.keys() == {1, 2, 3}
    for normals in facade.truth.normals:
        assert np.linalg.svd(normals, compute_uv=False).min() > 0.05


def test_only_corner_a_of_the_cube_is_displaced(geometry_of):
    there = geometry_of("cube", displacement=np.array([0.1, 0, 0])).mesh.vertices
    assert (there[1:] == VERTICES[1:]).all()
    np.testing.assert_allclose(there[0] - VERTICES[0], [0.1, 0, 0], atol=1e-15)
    assert 0.10 < np.linalg.norm(DEFAULT_DISPLACEMENT) < 0.15
    assert all(0 in face for face in FACES)
    for view in geometry_of("cube").views:
        uv, _ = view.camera.project(VERTICES)
        edges = np.linalg.norm(uv[[1, 3, 5]] - uv[0], axis=1)
        assert 100 < edges.min() < edges.max() < 185, edges


def test_sparse_points_reproject_to_their_observations(geometry_of):
    scene = geometry_of("archway")
    points = scene.sparse_points
    assert len(points.positions) > 200
    assert np.bincount(points.observations[:, 0]).min() >= 3
    errors = []
    for k, view in enumerate(scene.views):
        of_view = points.observations[:, 1] == k
        uv, _ = view.camera.project(points.positions[points.observations[of_view, 0]])
        errors.append(uv - points.pixels[of_view])
    rms = np.sqrt((np.concatenate(errors) ** 2).mean())
    # 0.3 px in the photo, and 0.04 % of a 12 m diagonal at about 70 px a metre.
    assert 0.3 < rms < 0.6, rms


def test_triangulation_is_delaunay_and_covers_the_polygon():
    outer = np.array([[0, 0], [4, 0], [8, 0], [8, 5], [4, 6], [0, 5]], float)
    hole = np.array([[2, 2], [2, 3], [5, 3.5], [5, 2]], float)
    extra = np.array([[6.5, 3.0], [1, 4]])
    points = np.vstack([outer, hole, extra])
    triangles = triangulate([outer, hole], extra)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    doubled = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    assert (doubled > 0).all()
    assert doubled.sum() / 2 == pytest.approx(44 - 3.75)
    assert set(np.unique(triangles)) == set(range(len(points)))


def test_dome_mesh_has_even_triangles_on_the_sphere():
    dome = sphere_cap(8)
    assert np.abs(np.linalg.norm(dome.vertices, axis=1) - 1).max() < 1e-12
    assert (unit_normals(dome.vertices, dome.faces)[0] * dome.vertices[dome.faces[:, 0]]).sum(axis=1).min() > 0.9
    lengths = np.linalg.norm(dome.vertices[dome.edges[:, 0]] - dome.vertices[dome.edges[:, 1]], axis=1)
    assert lengths.max() < 2 * lengths.min()


def test_looking_at_puts_the_target_in_the_middle_with_up_upwards():
    camera = looking_at(np.array([3.0, 2, 8]), np.array([0, 1.0, 0]), np.array([0, 1.0, 0]), 500, 301, 201)
    (center, above), _ = camera.project(np.array([[0, 1.0, 0], [0, 1.5, 0]]))
    np.testing.assert_allclose(center, [150, 100], atol=1e-9)
    assert above[1] < 99
    assert abs(above[0] - 150) < 1e-9


def test_unknown_demo_is_named():
    with pytest.raises(InputError, match="demo castle: expected one of cube, facade"):
        load_demo("castle")


def test_lambertian_photos_agree_on_the_colour_of_a_point(cache_folder):
    stage = small_cube()
    light = light_lattice(stage)
    points = VERTICES[0] - 0.5 * np.array([[1, 1, 0], [1, 0, 1], [0, 1, 1]]) + 0.01
    views = [small_camera(camera, 2.0) for camera in cube_cameras()[::4]]
    blurred = [np.full((4, 4, 3), level, np.uint8) for level in (60, 120, 180)]
    plain = replace(stage, surface=replace(stage.surface, textures=tuple(blurred)))
    colors = []
    for camera in views:
        uv = np.rint(camera.project(points)[0]).astype(int)
        colors.append(photograph(plain, light, camera, 2)[uv[:, 1], uv[:, 0]])
    np.testing.assert_allclose(colors, np.broadcast_to(colors[0], np.shape(colors)), rtol=1e-12)
