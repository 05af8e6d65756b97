"""Image-consistent triangulation: correct flips are made, wrong ones are not, and points become a start mesh."""

import numpy as np
import pytest
from scipy.spatial import Delaunay

from fairing.errors import InputError
from fairing.geometry.mesh_check import inspect_mesh
from fairing.geometry.normals import face_normals
from fairing.mesh import Mesh
from fairing.scene import Scene, View
from fairing.triangulation import (
    EdgeFlipper,
    FlipTrace,
    TriangulationOptions,
    Verdict,
    start_mesh,
    triangulate,
)
from fairing.triangulation.quads import find_quads, judge_shapes
from tests.roof_scene import (
    VERTICES,
    counter_clockwise,
    plane_photos,
    plane_vertices,
    roof_scene,
    views_of,
)
from tests.terrain_scene import BLANK, CAMERAS, VIEWS, pinhole, seen_points, terrain


def edges_of(faces: np.ndarray) -> set[tuple[int, int]]:
    return {(min(a, b), max(a, b)) for f in faces.tolist() for a, b in zip(f, f[1:] + f[:1], strict=True)}


def last_faces(flipper: EdgeFlipper) -> np.ndarray:
    return flipper.trace.faces_at(len(flipper.trace))


@pytest.mark.parametrize("truth", ["AB", "CD"])
@pytest.mark.parametrize("start", ["AB", "CD"])
def test_the_ridge_of_the_photos_is_found(truth, start):
    scene = roof_scene(truth, start)
    flipper = EdgeFlipper(scene)
    summary = flipper.run()
    ridge = {"AB": (0, 1), "CD": (2, 3)}[truth]
    assert ridge in edges_of(last_faces(flipper))
    assert len(flipper.trace) == int(truth != start)
    assert (summary.inconsistent_before, summary.inconsistent_after) == (int(truth != start), 0)
    # Both faces still show their outer side upwards, and the border is what it was.
    assert np.array_equal(counter_clockwise(last_faces(flipper), VERTICES), last_faces(flipper))
    assert edges_of(last_faces(flipper)) - {ridge} == {(0, 2), (0, 3), (1, 2), (1, 3)}


def test_the_final_energy_equals_that_of_a_correct_start():
    wrong, right = EdgeFlipper(roof_scene("AB", "CD")), EdgeFlipper(roof_scene("AB", "AB"))
    found, there = wrong.run(), right.run()
    assert found.energy_before > 100 * found.energy_after
    assert found.energy_after == pytest.approx(there.energy_after, rel=1e-3)
    (flip,) = wrong.trace.flips
    assert flip.common_loss[0] > 0.1 > 0.01 > flip.common_loss[1]
    assert flip.energy == pytest.approx((found.energy_before, found.energy_after), rel=1e-6)
    assert flip.round_energy == (found.energy_before, found.energy_after)
    assert flip.n_views == 8
    assert "8 photos" in flip.reason


@pytest.mark.parametrize("orientation", [1, -1])
def test_an_inverted_mesh_gets_the_same_flips(orientation):
    scene = roof_scene("AB", "CD")
    flipper = EdgeFlipper(Scene.build("roof", VERTICES, scene.mesh.faces[:, ::orientation], scene.views))
    flipper.run()
    assert (0, 1) in edges_of(last_faces(flipper))
    turned = face_normals(VERTICES, last_faces(flipper))
    assert (np.sign(turned[:, 2]) == orientation).all()


def test_a_flat_patch_is_not_changed():
    vertices = plane_vertices()
    faces = counter_clockwise(Delaunay(vertices[:, :2]).simplices, vertices)
    flipper = EdgeFlipper(Scene.build("plane", vertices, faces, views_of(plane_photos())))
    summary = flipper.run()
    assert len(flipper.trace) == 0
    assert summary.verdicts[0][Verdict.NO_GAIN] > 20
    assert summary.energy_after == summary.energy_before


@pytest.fixture(scope="module")
def terrain_scene() -> Scene:
    vertices, views = terrain()
    faces = counter_clockwise(Delaunay(vertices[:, :2]).simplices, vertices)
    return Scene.build("terrain", vertices, faces, views)


@pytest.mark.slow
def test_energy_never_rises_and_no_fold_is_made(terrain_scene):
    flipper = EdgeFlipper(terrain_scene)
    summary = flipper.run()
    trace = flipper.trace
    assert len(trace) >= 3
    energies = sorted({flip.round: flip.round_energy for flip in trace.flips}.items())
    assert [number for number, _ in energies] == list(range(summary.rounds))
    assert energies[0][1][0] == summary.energy_before
    assert energies[-1][1][1] == summary.energy_after
    for (_, (before, after)), following in zip(energies, [*energies[1:], None], strict=True):
        assert after < before
        assert following is None or following[1][0] == after
    assert all(flip.energy[1] < flip.energy[0] for flip in trace.flips)
    assert all(flip.common_loss[1] < flip.common_loss[0] for flip in trace.flips)
    for moment in range(len(trace) + 1):
        facts = inspect_mesh(Mesh(trace.vertices, trace.faces_at(moment)))
        assert len(facts.crowded_edges) + len(facts.misoriented_edges) + len(facts.degenerate_faces) == 0
        assert len(facts.repeated_faces) == 0
    assert np.array_equal(np.unique(trace.faces_at(len(trace))), np.unique(trace.faces_at(0)))
    assert (summary.inconsistent_after or 0) < summary.inconsistent_before


def test_after_the_run_no_flip_lowers_the_energy(terrain_scene):
    flipper = EdgeFlipper(terrain_scene)
    flipper.run()
    again = EdgeFlipper(Scene.build("terrain", terrain_scene.mesh.vertices, last_faces(flipper), terrain_scene.views))
    # The pixels of a typical face are counted anew, which changes the energy's unit but no comparison.
    assert again.run().inconsistent_before == 0


def test_flips_do_not_depend_on_the_number_of_threads(terrain_scene, tmp_path):
    records = []
    for threads in (1, 3):
        flipper = EdgeFlipper(terrain_scene, TriangulationOptions(threads=threads))
        flipper.trace.attach(tmp_path / f"{threads}.flips")
        flipper.run()
        flipper.trace.detach()
        records.append((tmp_path / f"{threads}.flips").read_bytes())
    assert records[0] == records[1]


def test_the_record_replays_to_the_same_mesh(terrain_scene, tmp_path):
    path = tmp_path / "run.flips"
    done = triangulate(
        "terrain", terrain_scene.views, None, mesh=(terrain_scene.mesh.vertices, terrain_scene.mesh.faces),
        record_to=path, header={"source": "here"},
    )  # fmt: skip
    loaded = FlipTrace.load(path)
    assert loaded.header["source"] == "here"
    assert loaded.header["options"]["gain"] == 0.05
    assert np.array_equal(loaded.vertices, terrain_scene.mesh.vertices)
    assert np.array_equal(loaded.faces_at(0), terrain_scene.mesh.faces)
    assert np.array_equal(loaded.faces_at(len(loaded)), done.faces)
    for mine, theirs in zip(loaded.flips, done.trace.flips, strict=True):
        assert mine.reason == theirs.reason
        assert mine.energy == theirs.energy
        assert mine.round_energy == theirs.round_energy
    for moment, flip in enumerate(loaded.flips):
        before, after = edges_of(loaded.faces_at(moment)), edges_of(loaded.faces_at(moment + 1))
        assert before - after == {tuple(sorted(flip.edge.tolist()))}
        assert after - before == {tuple(sorted(flip.opposite.tolist()))}
    with pytest.raises(IndexError, match="moments 0 to"):
        loaded.faces_at(len(loaded) + 1)

    path.write_bytes(path.read_bytes()[:-7])  # the machine crashed while it wrote the last flip
    assert np.array_equal(FlipTrace.load(path).faces_at(len(loaded) - 1), loaded.faces_at(len(loaded) - 1))
    assert len(FlipTrace.load(path)) == len(loaded) - 1
    path.write_bytes(b"solid nonsense")
    with pytest.raises(InputError, match="expected an EigenFairing record of flips"):
        FlipTrace.load(path)


def test_a_stopped_run_keeps_its_flips(terrain_scene):
    flipper = EdgeFlipper(terrain_scene)
    summary = flipper.run(should_stop=lambda: len(flipper.trace) > 0)
    assert summary.stop_reason == "stopped on request"
    assert summary.inconsistent_after is None
    assert len(flipper.trace) > 0
    assert summary.energy_after < summary.energy_before


def shape_verdict(vertices, faces) -> Verdict:
    faces = np.array(faces)
    quads = find_quads(faces)
    assert len(quads.edge) == 1
    return Verdict(judge_shapes(quads, faces, np.array(vertices, float))[0])


def test_a_convex_quad_may_be_flipped_and_an_arrowhead_may_not():
    square = [[0, 0, 0], [1, 1, 0], [0, 1, 0], [1, 0, 0]]
    assert shape_verdict(square, [[0, 1, 2], [1, 0, 3]]) == Verdict.FLIPPED
    kite = [[0, 0, 0], [0.7, 0.7, 0], [0, 1, 0], [1, 0, 0]]
    assert shape_verdict(kite, [[0, 1, 2], [1, 0, 3]]) == Verdict.FLIPPED
    dart = [[0, 0, 0], [0.3, 0.3, 0], [0, 1, 0], [1, 0, 0]]
    assert shape_verdict(dart, [[0, 1, 2], [1, 0, 3]]) == Verdict.FOLD


def test_a_flip_may_not_collapse_a_face():
    needle = [[0, 0, 0], [1, 0, 0], [0.01, 0.5, 0], [0.01, -0.5, 0]]
    assert shape_verdict(needle, [[0, 1, 2], [1, 0, 3]]) == Verdict.THIN
    # In place of a face that is still thinner it may become as thin.
    flat = [[0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.5, -0.00001, 0]]
    assert shape_verdict(flat, [[0, 1, 2], [1, 0, 3]]) == Verdict.FLIPPED


def test_an_edge_of_a_tetrahedron_cannot_be_flipped():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    quads = find_quads(faces)
    assert len(quads.edge) == 6
    assert (judge_shapes(quads, faces, vertices) == Verdict.TWICE).all()


def test_only_edges_of_two_consistently_oriented_faces_are_considered():
    assert len(find_quads(np.array([[0, 1, 2], [1, 0, 3]])).edge) == 1
    turned = find_quads(np.array([[0, 1, 2], [0, 1, 3]]))
    assert (len(turned.edge), turned.n_other) == (0, 5)
    crowded = find_quads(np.array([[0, 1, 2], [1, 0, 3], [1, 0, 4]]))
    assert len(crowded.edge) == 0


def wall(count: int = 300, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1.5, 1.5, (count, 3))
    points[:, 2] = 0.2 * points[:, 0]
    return points


def test_points_become_a_sound_mesh_that_faces_the_photos():
    mesh = start_mesh(VIEWS, seen_points(wall()), TriangulationOptions())
    facts = inspect_mesh(Mesh(mesh.vertices, mesh.faces))
    assert facts.warnings() == ()
    assert facts.n_components == 1
    normals = face_normals(mesh.vertices, mesh.faces)
    assert ((CAMERAS[0].center - mesh.vertices[mesh.faces[:, 0]]) * normals).sum(axis=1).min() > 0
    assert np.abs(mesh.vertices[:, 2] - 0.2 * mesh.vertices[:, 0]).max() < 1e-6
    assert mesh.n_points + sum(mesh.left_out.values()) == 300


def test_vertices_are_thinned_to_the_spacing():
    counts = []
    for spacing in (8, 16, 32):
        mesh = start_mesh(VIEWS, seen_points(wall(1500)), TriangulationOptions(spacing=spacing))
        pixels = CAMERAS[0].project(mesh.vertices)[0]
        lengths = np.linalg.norm(pixels[mesh.faces] - pixels[mesh.faces[:, [1, 2, 0]]], axis=2)
        assert np.quantile(lengths, 0.05) > 0.5 * spacing
        counts.append(len(mesh.vertices))
    assert counts[0] > counts[1] > counts[2] > 3


@pytest.mark.parametrize("most", [12, 40])
def test_the_number_of_vertices_is_limited(most):
    mesh = start_mesh(VIEWS, seen_points(wall()), TriangulationOptions(max_vertices=most))
    assert 3 < len(mesh.vertices) <= most
    assert np.ptp(mesh.vertices[:, 0]) > 1.5  # still spread over the wall


def test_outliers_are_left_out_and_reported():
    positions = wall()
    sees = np.ones((5, 300), bool)
    sees[2:, :20] = False  # too few photos
    positions[20] = [0, 0, 3.5]  # far before its neighbours in every photo that sees it
    positions[21] = [40, 0, -90]
    points = seen_points(positions, sees)
    points.pixels[points.observations[:, 0] == 22] += 30  # wrongly matched
    mesh = start_mesh(VIEWS, points, TriangulationOptions())
    assert mesh.left_out["seen by fewer than 3 photos"] == 20
    assert mesh.left_out["reprojection error too large"] == 1
    assert mesh.left_out["far from all others"] == 2
    assert np.abs(mesh.vertices[:, 2] - 0.2 * mesh.vertices[:, 0]).max() < 1e-6


def test_a_point_that_others_are_seen_through_is_no_surface():
    positions = np.vstack([wall(), [[0.1 * k, 0.1, 1.0] for k in range(-3, 4)]])  # in the air, but not alone
    points = seen_points(positions)
    mesh = start_mesh(VIEWS, points, TriangulationOptions())
    assert mesh.vertices[:, 2].max() < 0.5


def test_a_depth_discontinuity_is_not_bridged():
    positions = np.vstack([wall(200, 1) * [0.45, 1, 0] - [0.8, 0, 0], wall(200, 2) * [0.45, 1, 0] + [0.75, 0, -4]])
    mesh = start_mesh(VIEWS, seen_points(positions), TriangulationOptions())
    in_front = mesh.vertices[mesh.faces][:, :, 2] > -2
    assert (in_front.all(axis=1) | ~in_front.any(axis=1)).all()
    assert inspect_mesh(Mesh(mesh.vertices, mesh.faces)).n_components == 2


def test_both_sides_of_a_slab_become_surface():
    back = tuple(
        View(f"back{i}", pinhole([x, y, -6], [0, 0, 0]), BLANK) for i, (x, y) in enumerate(((0, 0.1), (1, 1), (-1, 1)))
    )
    positions = np.vstack([wall(200, 1), wall(120, 2) - [0, 0, 1]])
    sees = np.zeros((8, 320), bool)
    sees[:5, :200] = True
    sees[5:, 200:] = True
    mesh = start_mesh(VIEWS + back, seen_points(positions, sees, VIEWS + back), TriangulationOptions())
    normals = face_normals(mesh.vertices, mesh.faces)
    height = (mesh.vertices[:, 2] - 0.2 * mesh.vertices[:, 0])[mesh.faces]
    for place, side in ((0, 1), (-1, -1)):
        there = np.abs(height - place).max(axis=1) < 0.1
        assert (side * normals[there, 2] > 0).all()
        assert np.abs(normals[there, 2]).sum() / 2 > 7  # of 9


def test_errors_are_one_line():
    def message(points, **options) -> str:
        with pytest.raises(InputError) as caught:
            triangulate("capture", VIEWS, points, TriangulationOptions(**options))
        assert "\n" not in str(caught.value)
        return str(caught.value)

    assert "expected sparse points to triangulate, found none; give a mesh" in message(None)
    assert "at least 3 sparse points, found 2" in message(seen_points(wall(2)))
    assert "found 0 of 30" in message(seen_points(wall(30), np.arange(5)[:, None].repeat(30, 1) < 2))
    in_a_line = np.linspace(-1, 1, 30)[:, None] * [1, 0.5, 0.0]
    assert "span a surface" in message(seen_points(in_a_line))
    assert "max-vertices: expected at least 3, found 2" in message(seen_points(wall()), max_vertices=2)
    assert "gain: expected at least 0, found -1" in message(seen_points(wall()), gain=-1)


def test_a_given_mesh_keeps_its_vertices_and_order():
    scene = roof_scene("AB", "CD")
    vertices = np.vstack([VERTICES[::-1], VERTICES[:1]])  # A is there twice, D comes first
    faces = np.array([3, 2, 1, 0])[scene.mesh.faces]
    faces[0] = np.where(faces[0] == 3, 4, faces[0])
    done = triangulate("roof", scene.views, None, mesh=(vertices, faces))
    written, found = done.mesh()
    assert np.array_equal(written, vertices)
    assert {tuple(sorted(f)) for f in np.where(found == 4, 3, found).tolist()} == {(1, 2, 3), (0, 2, 3)}
    assert done.report()["inconsistent_edges"] == {"before": 1, "after": 0}
    assert done.report()["points_left_out"] is None
    assert np.array_equal(done.result().mesh.faces, done.faces)
    assert (done.result().original_faces == found).all()
