"""Parts of the start mesh against independent oracles: walks along lines of sight, cuts, surfaces of known shape and genus."""

from itertools import pairwise, product

import numpy as np
import pytest
from scipy.spatial import ConvexHull, Delaunay

from fairing.geometry.closest_point import SurfaceTree
from fairing.geometry.decimate import decimate
from fairing.geometry.mesh_check import inspect_mesh
from fairing.geometry.normals import unit_normals
from fairing.mesh import Mesh
from fairing.scene import View
from fairing.triangulation import TriangulationOptions, start_mesh
from fairing.triangulation.cut_surface import cut_surface, split_at_vertices
from fairing.triangulation.minimum_cut import minimum_cut
from fairing.triangulation.seen_surface import Fate, seen_surface
from fairing.triangulation.sight_lines import BEHIND, sight_costs
from fairing.triangulation.tetrahedra import CORNERS, Tetrahedra, tetrahedra
from tests.bodies import AROUND, faces_of_sight, points_of
from tests.terrain_scene import BLANK, pinhole, seen_points


def euler_characteristic(faces: np.ndarray) -> int:
    edges = np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    return len(np.unique(faces)) - len(edges) + len(faces)


def assert_manifold(faces: np.ndarray, closed: bool) -> None:
    """Every edge has two faces of opposite directions, or one at a border; the faces at a vertex are one fan."""
    half = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    assert len(np.unique(half, axis=0)) == len(half)
    if closed:
        assert {tuple(edge) for edge in half.tolist()} == {tuple(edge) for edge in half[:, ::-1].tolist()}
    again, former = split_at_vertices(faces)
    assert len(former) == len(np.unique(faces))
    assert len(again) == len(faces)


@pytest.mark.parametrize(
    ("kind", "genus", "tolerance"), [("sphere", 0, 0.02), ("box", 0, 0.05), ("torus", 1, 0.03)], ids=str
)
def test_a_body_seen_from_all_sides_is_closed_and_has_its_genus(kind, genus, tolerance):
    points, normals = points_of(kind, 3000, np.random.default_rng(1))
    sees = faces_of_sight(points, normals)
    mesh = start_mesh(AROUND, seen_points(points, sees, AROUND), TriangulationOptions())
    facts = inspect_mesh(Mesh(mesh.vertices, mesh.faces))
    assert facts.warnings() == ()
    assert facts.n_components == 1
    assert len(facts.boundary_vertices) == 0
    assert_manifold(mesh.faces, closed=True)
    assert euler_characteristic(mesh.faces) == 2 - 2 * genus
    assert len(mesh.vertices) < 1200
    far = SurfaceTree(Mesh(mesh.vertices, mesh.faces)).distance(points)
    assert np.quantile(far, 0.99) < tolerance
    # Outward: the volume is positive.
    corners = mesh.vertices[mesh.faces]
    volume = (corners[:, 0] * np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert volume == pytest.approx({"sphere": 4 / 3 * np.pi, "box": 8, "torus": 2 * np.pi**2 * 0.16}[kind], rel=0.03)


def at_box(mesh: Tetrahedra) -> np.ndarray:
    """(T,) bool: tetrahedra with a corner of the box."""
    return (mesh.corners >= mesh.n_points).any(axis=1)


def slow_costs(mesh: Tetrahedra, point: int, view: int, sigma: float) -> tuple[np.ndarray, np.ndarray]:
    """The costs of one line of sight by looking up which tetrahedron holds its places, with bisection in between."""
    lookup = Delaunay(mesh.places)
    assert np.array_equal(np.sort(lookup.simplices, axis=1), np.sort(mesh.corners, axis=1))
    crossing, inside = np.zeros(mesh.corners.shape), np.zeros(len(mesh.corners))
    origin, sight = mesh.places[point], mesh.cameras[view] - mesh.places[point]
    length = float(np.linalg.norm(sight))

    def at(distance: float) -> int:
        return int(lookup.find_simplex(origin + distance / length * sight))

    def cross(low: float, high: float) -> None:
        """Record the crossings between two distances."""
        one, two = at(low), at(high)
        if one == two:
            return
        if high - low > 1e-10:
            middle = (low + high) / 2
            cross(low, middle)
            cross(middle, high)
            return
        assert two in mesh.neighbours[one], "two facets at once"
        # The camera's side is outside, the other inside.
        crossing[two, list(mesh.neighbours[two]).index(one)] += 1 - np.exp(-0.5 * (low / sigma) ** 2)

    for low, high in ((1e-9, length), (-BEHIND * sigma, -1e-9)):
        steps = np.linspace(low, high, 4000)
        for start, end in pairwise(steps):
            cross(start, end)
    inside[at(-BEHIND * sigma)] += 1
    return crossing, inside


def test_a_line_of_sight_crosses_the_facets_that_a_slow_walk_finds():
    rng = np.random.default_rng(3)
    cameras = np.array([[0.2, 0.4, 6.0], [4.0, 0.5, 0.3], [0.05, 0.1, 0.2]])  # the last one among the points
    mesh = tetrahedra(rng.uniform(-1, 1, (60, 3)), cameras)
    sigma = np.full(60, 0.05)
    lines = [(0, 0), (7, 1), (21, 2), (40, 0), (41, 2)]
    for point, view in lines:
        crossing, inside, _ = sight_costs(mesh, np.array([point]), np.array([view]), sigma)
        slow_crossing, slow_inside = slow_costs(mesh, point, view, 0.05)
        assert (slow_crossing > 0).sum() > 1
        assert np.allclose(crossing, slow_crossing, atol=1e-6)
        assert np.array_equal(inside, slow_inside)
    total = sight_costs(mesh, *(np.array(column) for column in zip(*lines, strict=True)), sigma)
    alone = [sight_costs(mesh, np.array([p]), np.array([v]), sigma) for p, v in lines]
    assert np.allclose(total[0], sum(costs.crossing for costs in alone))


def test_the_places_of_a_grid_are_tetrahedra_without_gaps():
    points = np.array(list(product(range(4), repeat=3)), float)
    mesh = tetrahedra(points, np.array([[1.5, 1.5, 30.0]]))
    corners = mesh.places[mesh.corners]
    volume = (
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) * (corners[:, 3] - corners[:, 0])
    ).sum(1) / 6
    assert (volume > 0).all()
    assert volume.sum() == pytest.approx(ConvexHull(mesh.places).volume)
    t, k = np.nonzero(mesh.neighbours >= 0)
    shared = np.sort(mesh.corners[t[:, None], CORNERS[k]], axis=1)
    beyond = mesh.corners[mesh.neighbours[t, k]]
    assert (shared[:, :, None] == beyond[:, None]).any(axis=2).all()


def test_facets_are_judged_by_the_angles_of_their_circumspheres():
    mesh = tetrahedra(np.random.default_rng(5).uniform(-1, 1, (30, 3)), np.array([[0.0, 0, 9]]))
    quality = mesh.facet_quality()
    for t in np.flatnonzero(~at_box(mesh))[:10]:
        for k in range(4):
            cosines = []
            for tetrahedron in (t, mesh.neighbours[t, k]):
                p = mesh.places[mesh.corners[tetrahedron]]
                center = np.linalg.solve(2 * (p[1:] - p[0]), (p[1:] ** 2 - p[0] ** 2).sum(axis=1))
                facet = mesh.places[mesh.corners[t, CORNERS[k]]]
                normal = np.cross(facet[1] - facet[0], facet[2] - facet[0])
                apex = next(x for x in p if not (x == facet).all(axis=1).any())
                normal *= -np.sign(normal @ (apex - facet[0])) / np.linalg.norm(normal)
                cosines.append((facet[0] - center) @ normal / np.linalg.norm(facet[0] - center))
            assert quality[t, k] == pytest.approx(1 - min(cosines), abs=1e-6)


def test_the_cut_of_a_small_graph_costs_as_little_as_the_best_of_all():
    rng = np.random.default_rng(2)
    for _ in range(20):
        n = 9
        ends = np.array([(a, b) for a in range(n) for b in range(n) if a != b and rng.random() < 0.4])
        costs, to_sink = rng.integers(0, 20, len(ends)).astype(float), rng.integers(0, 25, n) * (rng.random(n) < 0.5)
        is_source = np.arange(n) < 2

        def cost(on_source_side, ends=ends, costs=costs, to_sink=to_sink):
            cut = on_source_side[ends[:, 0]] & ~on_source_side[ends[:, 1]]
            return costs[cut].sum() + to_sink[on_source_side].sum()

        choices = [np.array([True, True, *rest]) for rest in product((False, True), repeat=n - 2)]
        best = min(cost(choice) for choice in choices)
        fewest = min(int(choice.sum()) for choice in choices if cost(choice) == best)
        found = minimum_cut(n, ends, costs, is_source, to_sink.astype(float))
        assert found[:2].all()
        assert cost(found) == best
        assert found.sum() == fewest


@pytest.mark.parametrize("share", [0.1, 0.3, 0.5])
def test_the_surface_of_any_division_is_a_manifold(share):
    rng = np.random.default_rng(4)
    mesh = tetrahedra(rng.uniform(-1, 1, (120, 3)), np.array([[0.0, 0, 9]]))
    is_outside = at_box(mesh) | (rng.random(len(mesh.corners)) < share)
    faces, point = cut_surface(mesh, is_outside)
    assert_manifold(faces, closed=False)
    half = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    unpaired = {tuple(edge) for edge in half.tolist()} ^ {tuple(edge) for edge in half[:, ::-1].tolist()}
    assert len(unpaired) < 0.05 * len(half)  # edges that the surface passes twice, at vertices that it passes twice
    facets = {tuple(sorted(f)) for f in point[faces].tolist()}
    t, k = np.nonzero(~is_outside[:, None] & is_outside[mesh.neighbours])
    assert facets == {tuple(sorted(f)) for f in mesh.corners[t[:, None], CORNERS[k]].tolist()}
    # Volume of the tetrahedra inside, by Gauss's theorem.
    a, b, c = (mesh.places[point[faces[:, i]]] for i in range(3))
    corners = mesh.places[mesh.corners[~is_outside]]
    inside = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])).sum() / 6
    assert (a * np.cross(b, c)).sum() / 6 == pytest.approx(inside)


def test_what_no_photo_sees_stays_open():
    hull = ConvexHull(points_of("sphere", 800, np.random.default_rng(1))[0])
    vertices, faces = hull.points, hull.simplices.copy()
    outward = (unit_normals(vertices, faces)[0] * vertices[faces[:, 0]]).sum(axis=1) > 0
    faces[~outward] = faces[~outward][:, ::-1]
    front = View("front", pinhole([0, 0, 5], [0, 0, 0]), BLANK)
    kept, former, fates = seen_surface(vertices, faces, [front], 0.05)
    assert (fates == Fate.KEPT).sum() == len(kept)
    assert np.array_equal(former[kept], faces[fates == Fate.KEPT])
    assert_manifold(kept, closed=False)
    # A point of the unit sphere is seen from 5 away where its height is more than a fifth.
    heights = vertices[former][kept].mean(axis=1)[:, 2]
    assert heights.min() > 0.1
    assert (vertices[faces].mean(axis=1)[:, 2] > 0.25).sum() <= len(kept)
    assert len(seen_surface(vertices, faces[:, ::-1], [front], 0.05)[0]) < 0.2 * len(
        kept
    )  # from within no photo sees it
    assert inspect_mesh(Mesh(vertices[former], kept)).n_components == 1


def grid_box(n: int) -> tuple[np.ndarray, np.ndarray]:
    """A cube of n x n squares a side."""
    places = np.array([p for p in product(range(n + 1), repeat=3) if {0, n} & set(p)], float)
    number = {tuple(p): i for i, p in enumerate(places.astype(int).tolist())}
    faces = []
    for axis, end in product(range(3), (0, n)):
        for u, v in product(range(n), repeat=2):
            square = [np.insert([u + i, v + j], axis, end) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]
            a, b, c, d = (number[tuple(int(x) for x in corner)] for corner in square)
            if (end > 0) == (axis == 1):
                b, d = d, b
            faces += [[a, b, c], [a, c, d]]
    return places, np.array(faces)


def test_a_decimated_box_keeps_its_corners():
    vertices, faces = grid_box(6)
    assert_manifold(faces, closed=True)
    few, left = decimate(vertices, faces, np.zeros(len(vertices)), 8)
    assert_manifold(left, closed=True)
    assert len(few) == 8
    assert np.allclose(
        np.sort(np.round(few, 4).tolist(), axis=0), np.sort(list(product((0, 6), repeat=3)), axis=0), atol=1e-3
    )
    assert ((unit_normals(few, left)[0] * (few[left].mean(axis=1) - 3)).sum(axis=1) > 2.9).all()


def test_decimation_collapses_short_edges_and_keeps_border_and_shape():
    rng = np.random.default_rng(0)
    x = np.array([(i, j, 0) for i in range(51) for j in range(51)]) / 5
    inner = ((x[:, :2] > 0) & (x[:, :2] < 10)).all(axis=1)
    x[inner, :2] += rng.uniform(-0.08, 0.08, (inner.sum(), 2))
    x[:, 2] = np.abs(x[:, 0] - 5)  # a ridge
    flat = Delaunay(x[:, :2]).simplices
    up = unit_normals(x, flat)[0][:, 2] > 0
    faces = np.where(up[:, None], flat, flat[:, ::-1])
    few, left = decimate(x, faces, np.full(len(x), 0.8), len(x))
    assert_manifold(left, closed=False)
    assert 60 < len(few) < 400
    assert (unit_normals(few, left)[0][:, 2] > 0.5).all()
    assert np.abs(few[:, 2] - np.abs(few[:, 0] - 5)).max() < 0.15
    assert SurfaceTree(Mesh(few, left)).distance(x).max() < 0.15
    lengths = np.linalg.norm(few[left] - few[left[:, [1, 2, 0]]], axis=2)
    assert (lengths > 0.8).mean() > 0.95
    limited, _ = decimate(x, faces, np.full(len(x), 0.8), len(x), 30)
    assert len(limited) == 30


def test_the_same_input_gives_the_same_bytes_in_any_order_of_observations():
    points, normals = points_of("torus", 800, np.random.default_rng(6))
    sparse = seen_points(points, faces_of_sight(points, normals), AROUND)
    one = start_mesh(AROUND, sparse, TriangulationOptions(threads=1))
    order = np.random.default_rng(7).permutation(len(sparse.observations))
    mixed = type(sparse)(sparse.positions, sparse.colors, sparse.observations[order], sparse.pixels[order])
    two = start_mesh(AROUND, mixed, TriangulationOptions(threads=3))
    assert one.vertices.tobytes() == two.vertices.tobytes()
    assert one.faces.tobytes() == two.faces.tobytes()


def test_unit_and_origin_of_the_world_do_not_matter():
    points, normals = points_of("box", 900, np.random.default_rng(8))
    sees = faces_of_sight(points, normals)
    here = start_mesh(AROUND, seen_points(points, sees, AROUND), TriangulationOptions())
    scale, origin = 1024.0, np.array([512.0, 64.0, -256.0])
    views = tuple(
        View(view.name, pinhole(scale * view.camera.center + origin, origin, up=(0.3, 0.2, 0.9)), BLANK)
        for view in AROUND
    )
    there = start_mesh(views, seen_points(scale * points + origin, sees, views), TriangulationOptions())
    assert len(there.faces) == pytest.approx(len(here.faces), rel=0.02)
    back = Mesh((there.vertices - origin) / scale, there.faces)
    assert SurfaceTree(back).distance(here.vertices).max() < 0.05
