"""The record of how points became a start mesh."""

import json
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import maximum_flow

from fairing.errors import InputError
from fairing.triangulation import Fate, FlipTrace, initial_mesh
from fairing.triangulation.carving_file import carving_arrays, carving_names, read_carving
from fairing.triangulation.sight_lines import sight_costs
from fairing.triangulation.tetrahedra import facet_neighbours, tetrahedra
from tests.bodies import carved


@pytest.fixture(scope="module")
def trace():
    return carved()


@pytest.fixture(scope="module")
def carving(trace):
    return trace.carving


def test_a_record_holds_its_carving(trace, tmp_path: Path):
    trace.attach(tmp_path / "a.flips")
    trace.detach()
    loaded = FlipTrace.load(str(tmp_path / "a.flips")).carving
    assert loaded is not None
    before, after = carving_arrays(trace.carving), carving_arrays(loaded)
    for name, array in before.items():
        np.testing.assert_array_equal(after[name], array, err_msg=name)
    assert carving_names(loaded) == carving_names(trace.carving)
    np.testing.assert_array_equal(loaded.mesh.neighbours, trace.carving.mesh.neighbours)
    for field in fields(loaded):
        assert getattr(loaded, field.name) is not None
    np.testing.assert_allclose(loaded.all_votes.crossing, trace.carving.all_votes.crossing)


def test_a_record_that_ends_before_its_carving_still_has_the_mesh(trace, tmp_path: Path):
    path = tmp_path / "a.flips"
    trace.attach(path)
    trace.detach()
    path.write_bytes(path.read_bytes()[:-100])
    loaded = FlipTrace.load(path)
    assert loaded.carving is None
    np.testing.assert_array_equal(loaded.faces_at(0), trace.faces_at(0))


def test_tetrahedra_beyond_facets_are_those_that_delaunay_found():
    mesh = tetrahedra(np.random.default_rng(1).uniform(-1, 1, (200, 3)), np.array([[0.0, 0, 9]]))
    np.testing.assert_array_equal(facet_neighbours(mesh.corners), mesh.neighbours)
    with pytest.raises(ValueError, match="at most two"):
        facet_neighbours(np.array([[0, 1, 2, 3], [0, 1, 2, 4], [0, 1, 2, 5]]))


def test_the_cut_costs_as_much_as_the_largest_flow(carving):
    """Ford and Fulkerson: the least cut equals the largest flow, found here in whole numbers without the code under test."""
    mesh, votes, scale = carving.mesh, carving.all_votes, 1e4
    t, k = np.nonzero(mesh.neighbours >= 0)
    n = len(mesh.corners)
    node = np.arange(n)
    node[mesh.of_cameras] = n  # the source
    capacity = votes.crossing + carving.facet_costs
    tails = np.concatenate([node[t], node])
    heads = np.concatenate([node[mesh.neighbours[t, k]], np.full(n, n + 1)])
    costs = np.rint(scale * np.concatenate([capacity[t, k], votes.inside])).astype(np.int64)
    used = (tails != heads) & (costs > 0)
    tails, heads, costs = (values[used].astype(np.int32) for values in (tails, heads, costs))
    graph = coo_array((costs, (tails, heads)), shape=(n + 2, n + 2)).tocsr()
    flow = maximum_flow(graph, n, n + 1).flow_value / scale
    assert sum(carving.cut_value) == pytest.approx(flow, rel=0.005)
    assert flow > 1


def test_votes_of_photos_add_up(carving):
    n = len(carving.photos)
    parts = [carving.votes(range(0, 9)), carving.votes(range(9, n))]
    for part, total in zip(zip(*parts, strict=True), carving.all_votes, strict=True):
        np.testing.assert_allclose(sum(part), total, atol=1e-9)
    assert not any(array.any() for array in carving.votes(range(0)))


def test_no_line_of_sight_passes_through_a_sphere():
    sphere = carved("sphere", 300).carving
    assert sphere is not None
    middles = sphere.places[sphere.mesh.corners].mean(axis=1)
    deep = (np.linalg.norm(middles, axis=1) < 0.8) & ~sphere.at_box
    assert deep.sum() > 20
    assert not sphere.all_votes.passing[deep].any()
    assert not sphere.is_outside[deep].any()


def test_lines_through_a_tetrahedron_are_those_that_a_walk_meets_there(carving):
    one = np.full(carving.mesh.n_points, carving.sigma)
    walked = np.zeros((len(carving.lines), len(carving.is_outside)), dtype=bool)
    some = range(0, len(carving.lines), 7)
    for line in some:
        walked[line] = sight_costs(carving.mesh, carving.lines[[line], 0], carving.lines[[line], 1], one).passing > 0
    busiest = np.argsort(-walked.sum(axis=0))[:20]
    everything = range(len(carving.photos))
    for t in busiest.tolist():
        found = np.intersect1d(carving.lines_through(t, everything), some)
        np.testing.assert_array_equal(found, np.flatnonzero(walked[:, t]))
    few = carving.lines_through(int(busiest[0]), range(2, 5))
    assert set(carving.lines[few, 1].tolist()) <= {2, 3, 4}


def test_facets_and_meshes_lead_from_the_cut_to_the_start_mesh(trace, carving):
    seen_vertices, seen_faces = carving.decimated[0]
    assert len(seen_faces) == (carving.fates == Fate.KEPT).sum()
    counts = [len(vertices) for vertices, _ in carving.decimated]
    assert counts == sorted(counts, reverse=True)
    assert len(seen_vertices) == counts[0] > counts[-1] >= len(trace.vertices)


def test_of_too_many_points_no_carving_is_recorded(monkeypatch):
    monkeypatch.setattr(initial_mesh, "MOST_POINTS", 600)
    assert carved().carving is None


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"corners": lambda a: a + len(a)}, "corners: expected ids"),
        ({"corners": lambda a: np.tile(a[:1], (len(a), 1))}, "at most two tetrahedra"),
        ({"lines": lambda a: a + 10_000}, "lines: expected ids"),
        ({"is_outside": lambda a: a[:-1]}, "is_outside: expected"),
        ({"fates": lambda a: a[:-1]}, "fates: expected one of each"),
        ({"fates": lambda a: a + 9}, "fates: expected ids"),
        ({"sizes": lambda a: a + 1}, "sizes: expected"),
        ({"faces": lambda a: a + 10_000}, "mesh: face 0 uses"),
        ({"scales": lambda a: -a}, "scales: expected"),
        ({"places": lambda a: a * np.nan}, "places: expected finite"),
        ({"colors": lambda a: a[:-1]}, "colors: expected one"),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else value,
)
def test_a_crafted_carving_is_refused(carving, change, said):
    arrays = carving_arrays(carving)
    arrays |= {name: made(arrays[name]) for name, made in change.items()}
    with pytest.raises(ValueError, match=said):
        read_carving(carving_names(carving), arrays)


@pytest.mark.parametrize(
    "names", ["", "[]", json.dumps({"photos": ["a"], "left_out": {}}), '{"photos": 3, "left_out": 4}']
)
def test_crafted_names_are_refused(carving, names):
    with pytest.raises(InputError, match="expected"):
        read_carving(names, carving_arrays(carving))
