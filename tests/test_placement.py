"""Place of the mesh: what the photos of the sparse points confirm, the frames that are named, and what is applied or refused."""

import json
from dataclasses import replace
from itertools import permutations, product
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.cli.main import run
from app.files.check_page import check_page
from app.files.scene_source import SceneSource
from fairing.camera import Camera
from fairing.check.scene_check import check_scene
from fairing.errors import InputError
from fairing.io import PhotoChoice, load_scene
from fairing.io.convert import write_capture
from fairing.io.in_view import check_mesh_in_view
from fairing.io.load import read_capture
from fairing.io.mesh_place import in_frame_of_mesh
from fairing.placement.frames import MeshFrame, axes_text, parse_axes
from fairing.placement.judge import Placement, judge_placement
from fairing.run.session import Session
from fairing.scene import Scene, SparsePoints
from tests.small_scene import VERTICES, corner_scene, observed, on_the_faces, small_options, sparse_points, write_corner

SHIFT = (3.4, -1.7, 2.1)
"""The corner's world: at the origin, exchanged axes would go unnoticed."""


def scene_with_points(displacement: tuple[float, float, float] = (0.06, -0.04, 0.05), scale: float = 1.0) -> Scene:
    """The corner with 150 given points on its true faces."""
    scene = corner_scene(displacement, scale=scale, shift=SHIFT)
    return observed(scene, scale * on_the_faces(150) + SHIFT, "given")


def with_mesh(scene: Scene, vertices: np.ndarray) -> Scene:
    moved = Scene.build(scene.name, vertices, scene.mesh.faces, scene.views)
    return replace(moved, sparse_points=scene.sparse_points)


def axes(*rows: tuple[int, float]) -> np.ndarray:
    linear = np.zeros((3, 3))
    for i, (axis, sign) in enumerate(rows):
        linear[i, axis] = sign
    return linear


FRAMES = {
    "y and z negated": axes((0, 1), (1, -1), (2, -1)),
    "y up among z up": axes((0, 1), (2, -1), (1, 1)),
    "z up among y up": axes((0, 1), (2, 1), (1, -1)),
    "cyclic": axes((1, 1), (2, 1), (0, 1)),
    "mirrored": axes((0, -1), (1, 1), (2, 1)),
    "y and z swapped": axes((0, 1), (2, 1), (1, 1)),
}
"""World from mesh."""


@pytest.mark.parametrize("what", FRAMES)
def test_the_axes_of_a_mesh_in_another_frame_are_named(what: str):
    scene, linear = scene_with_points((0.02, -0.01, 0.02)), FRAMES[what]
    placement = judge_placement(with_mesh(scene, scene.mesh.vertices @ linear))
    assert placement.verdict == "elsewhere"
    assert placement.better is not None
    np.testing.assert_array_equal(placement.better.linear, linear)
    assert not placement.better.shift.any()
    if np.linalg.det(linear) > 0:
        assert f"--mesh-axes={axes_text(linear)}" in placement.line
    else:
        assert "flip" in placement.line
    assert "\n" not in placement.line


@pytest.mark.parametrize("factor", [1000, 0.001, 1 / 0.0254])
def test_a_mesh_in_another_unit_is_named(factor: float):
    scene = scene_with_points()
    placement = judge_placement(with_mesh(scene, scene.mesh.vertices * factor))
    assert placement.verdict == "elsewhere"
    assert placement.better is not None
    assert placement.better.scale == pytest.approx(1 / factor)
    assert f"--mesh-scale={1 / factor:.6g}" in placement.line


def test_axes_and_unit_together_are_named():
    scene = scene_with_points()
    placement = judge_placement(with_mesh(scene, 1000 * scene.mesh.vertices @ FRAMES["y up among z up"]))
    assert "--mesh-axes=x,-z,y --mesh-scale=0.001" in placement.line


@pytest.mark.parametrize("share", [0.2, 0.5])
@pytest.mark.parametrize("axis", range(3))
def test_a_moved_mesh_is_found_where_it_belongs(axis: int, share: float):
    scene = scene_with_points((0, 0, 0))
    shift = share * scene.mesh.diagonal * np.eye(3)[axis]
    placement = judge_placement(with_mesh(scene, scene.mesh.vertices + shift))
    assert placement.verdict == "elsewhere"
    assert placement.better is not None
    # The last step of the search is half a percent of the diagonal.
    np.testing.assert_allclose(placement.better.shift, -shift, atol=0.01 * scene.mesh.diagonal)


@pytest.mark.slow
def test_a_mesh_far_from_all_points_is_found_where_it_belongs():
    scene = scene_with_points()
    shift = np.array([500_000.0, 4_650_000.0, 80.0])
    placement = judge_placement(with_mesh(scene, scene.mesh.vertices + shift))
    assert placement.better is not None
    np.testing.assert_allclose(placement.better.shift, -shift, atol=0.02 * scene.mesh.diagonal)


def test_a_mesh_that_no_tried_frame_explains_lies_elsewhere_too():
    scene = scene_with_points()
    turn = Rotation.from_rotvec([0.5, -0.8, 0.6]).as_matrix()
    middle = scene.mesh.vertices.mean(axis=0)
    placement = judge_placement(with_mesh(scene, 1.3 * (scene.mesh.vertices - middle) @ turn + middle))
    assert placement.verdict == "elsewhere"
    assert placement.better is None
    assert "bring the mesh into the cameras' world" in placement.line


@pytest.mark.parametrize("error", [0.0, 0.05, 0.1])
def test_a_rough_start_is_confirmed(error: float):
    """Up to a tenth of the edge in a random direction at every vertex: 6 % of the diagonal."""
    scene = scene_with_points((0, 0, 0))
    directions = np.random.default_rng(2).normal(size=scene.mesh.vertices.shape)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    placement = judge_placement(with_mesh(scene, scene.mesh.vertices + error * directions))
    assert placement.verdict == "confirmed", placement.line
    assert placement.support.near > 0.8 * placement.support.judged


@pytest.mark.slow
def test_a_start_that_is_off_as_a_whole_by_less_than_a_tenth_is_confirmed():
    """The fit to the points reaches that far."""
    scene = scene_with_points((0, 0, 0))
    for direction in np.eye(3):
        shift = 0.07 * scene.mesh.diagonal * direction
        assert judge_placement(with_mesh(scene, scene.mesh.vertices + shift)).verdict == "confirmed"


@pytest.mark.slow
def test_a_mesh_of_a_part_of_the_scene_is_confirmed():
    scene = scene_with_points()
    for face in range(len(scene.mesh.faces)):
        part = Scene.build("part", scene.mesh.vertices, scene.mesh.faces[[face]], scene.views)
        placement = judge_placement(replace(part, sparse_points=scene.sparse_points))
        assert placement.verdict == "confirmed", (face, placement.line)
        assert placement.support.judged < 0.5 * placement.points


def test_points_of_ground_and_background_do_not_count():
    """Ten times as many as on the mesh, on a wall behind it and on the ground beside it, where the mesh does not hide them."""
    scene = scene_with_points()
    rng, count = np.random.default_rng(1), 3000
    around = np.array(SHIFT) + rng.uniform(-3, 3, (count, 3)) * [1, 1, 0] + [0, 0, -0.3]
    around[: count // 2] = np.array(SHIFT) + rng.uniform(-3, 3, (count // 2, 3)) * [0, 1, 1] + [-2, 0, 0]
    inside = corner_sight_is_free(scene, around)
    given = scene.sparse_points
    assert given is not None
    observations = np.argwhere(inside) + np.array([len(given.positions), 0])
    pixels = np.zeros((len(observations), 2))
    points = SparsePoints(
        np.concatenate([given.positions, around]),
        np.zeros((len(given.positions) + count, 3), np.uint8),
        np.concatenate([given.observations, observations]),
        np.concatenate([given.pixels, pixels]),
    )
    placement = judge_placement(replace(scene, sparse_points=points))
    assert placement.verdict == "confirmed", placement.line


def corner_sight_is_free(scene: Scene, points: np.ndarray) -> np.ndarray:
    """(p, V) bool: whether the cube does not hide a point, by sampling the line of sight."""
    low, high = VERTICES.min(axis=0) + SHIFT, VERTICES.max(axis=0) + SHIFT
    along = np.linspace(0, 1, 200)[:, None, None]
    free = []
    for view in scene.views:
        line = view.camera.center + along * (points - view.camera.center)
        free.append(~((line > low - 0.1) & (line < high + 0.1)).all(axis=2).any(axis=0))
    return np.stack(free, axis=1)


def test_without_enough_observed_points_nothing_is_judged():
    scene = corner_scene(shift=SHIFT)
    far = np.full((100, 3), 50.0)
    for points in (None, sparse_points(far)):
        assert judge_placement(replace(scene, sparse_points=points)).verdict == "unknown"
    assert judge_placement(observed(scene, far[:10])).verdict == "unknown"


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1e3, 1e6])
def test_the_judgement_does_not_depend_on_the_unit_of_the_world(scale: float):
    shift = scale * np.array(SHIFT)

    def judged(scale: float, offset: float) -> Placement:
        scene = corner_scene(scale=scale, shift=tuple(scale * np.array(SHIFT)))
        scene = observed(scene, scale * (on_the_faces(150) + SHIFT), "given")
        return judge_placement(with_mesh(scene, scene.mesh.vertices + offset * scale))

    assert shift.all()
    for offset, verdict in ((0.0, "confirmed"), (0.5, "elsewhere")):
        found, same = judged(scale, offset), judged(1.0, offset)
        assert found.verdict == same.verdict == verdict
        # The ray caster is of single precision: rays along an edge may pass on either side.
        np.testing.assert_allclose(found.support, same.support, atol=3)


@pytest.mark.slow
def test_a_run_refuses_a_mesh_that_lies_elsewhere():
    scene = scene_with_points()
    session = Session(with_mesh(scene, scene.mesh.vertices @ FRAMES["y and z negated"]), small_options())
    with pytest.raises(InputError, match=r"scene corner: the mesh lies elsewhere.*--mesh-axes=x,-y,-z"):
        session.run()
    assert len(session.trace) == 0
    Session(scene, small_options()).make_plan()


def test_the_check_calls_it_unusable_and_says_why():
    scene = scene_with_points((0.02, -0.01, 0.02))
    good = check_scene(scene)
    assert good.verdict != "unusable"
    assert good.as_dict()["placement"]["verdict"] == "confirmed"
    check = check_scene(with_mesh(scene, scene.mesh.vertices + np.array([0.5, 0, 0])))
    assert check.verdict == "unusable"
    assert any("lies elsewhere" in hint for hint in check.hints)
    found = json.loads(json.dumps(check.as_dict()["placement"]))
    assert found["verdict"] == "elsewhere"
    assert found["better"]["shift"] == pytest.approx([-0.5, 0, 0], abs=0.02)
    page = check_page(scene, check, [np.zeros((2, 2, 3), np.uint8)] * 8, ["x.png"] * 8)
    assert f"{check.placement.support.near} of {check.placement.support.judged}" in page


def test_a_one_sided_capture_whose_mesh_lies_behind_its_cameras_has_no_mirrored_camera():
    scene = scene_with_points()
    eye = np.mean([view.camera.center for view in scene.views], axis=0)
    behind = with_mesh(scene, 2 * eye - scene.mesh.vertices)
    with pytest.raises(InputError) as error:
        check_mesh_in_view(behind)
    assert "mirrored" not in str(error.value)
    assert "the mesh" in str(error.value)
    with pytest.raises(InputError) as error:
        check_mesh_in_view(replace(behind, sparse_points=None))
    assert "camera of photo" not in str(error.value)


def test_one_mirrored_camera_among_good_ones_is_still_named():
    scene = scene_with_points()
    flip = np.array([[1, 0, 0], [0, -1, 119], [0, 0, 1.0]])
    first = scene.views[0]
    mirrored = replace(first, camera=Camera(flip @ first.camera.image_from_world, 160, 120))
    with pytest.raises(InputError, match=r"camera of photo photo0: .*mirrored"):
        check_mesh_in_view(replace(scene, views=(mirrored, *scene.views[1:])))


# ---------------------------------------------------------------------- frames that the files name


def write_transforms(folder: Path, world: MeshFrame, **keys: object) -> None:
    """The corner's photos with nerfstudio's cameras, in the world that `world` makes of the mesh's frame."""
    frames = []
    for view in corner_scene().views:
        Rt = view.camera.camera_from_world
        R = world.linear / world.scale @ Rt[:, :3].T @ np.diag([1.0, -1.0, -1.0])
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = R, world.linear @ view.camera.center + world.shift
        frames.append({"file_path": f"images/{view.name}.png", "transform_matrix": pose.tolist()})
    K = corner_scene().views[0].camera.K
    lens = {"fl_x": K[0, 0], "fl_y": K[1, 1], "cx": K[0, 2] + 0.5, "cy": K[1, 2] + 0.5, "w": 160, "h": 120}
    (folder / "transforms.json").write_text(json.dumps(lens | keys | {"frames": frames}))


TURN = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
OFFSET = np.array([0.3, -0.2, 0.5])
WORLDS: dict[str, tuple[MeshFrame, dict[str, object]]] = {
    "turned": (
        MeshFrame("", TURN, np.zeros(3)), {"applied_transform": np.column_stack([TURN, np.zeros(3)]).tolist()},
    ),
    "turned, moved and scaled": (
        MeshFrame("", 0.4 * TURN, 0.4 * OFFSET),
        {"applied_transform": np.column_stack([TURN, OFFSET]).tolist(), "applied_scale": 0.4},
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", WORLDS)
def test_the_frame_before_applied_transform_is_applied_and_results_stay_in_it(tmp_path: Path, what: str):
    write_corner(tmp_path)
    world, keys = WORLDS[what]
    plain = load_scene(tmp_path, choice=PhotoChoice(format="matrices"))
    write_transforms(tmp_path, world, **keys)
    applied = load_scene(tmp_path, choice=PhotoChoice(format="transforms.json"))
    assert any("in the frame before `applied_transform`" in warning for warning in applied.warnings)
    ends = []
    for scene in (plain, applied):
        session = Session(scene, small_options())
        session.run()
        ends.append(scene.unweld(session.vertices))
    # The cameras differ by rounding of their files.
    assert np.abs(ends[0] - ends[1]).max() < 1e-6 * plain.mesh.diagonal


def test_a_mesh_in_the_world_of_the_cameras_stays_there(tmp_path: Path):
    write_corner(tmp_path)
    keys = WORLDS["turned"][1]
    write_transforms(tmp_path, MeshFrame("", np.eye(3), np.zeros(3)), **keys)
    scene = load_scene(tmp_path, choice=PhotoChoice(format="transforms.json"))
    assert not any("applied_transform" in warning for warning in scene.warnings)
    for ours, view in zip(corner_scene().views, scene.views, strict=True):
        np.testing.assert_allclose(view.camera.center, ours.camera.center, atol=1e-9)


def test_an_applied_transform_that_is_no_similarity_names_no_frame(tmp_path: Path):
    write_corner(tmp_path)
    same = MeshFrame("", np.eye(3), np.zeros(3))
    shear = [[1, 0.5, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]
    huge = [[1e200, 0, 0, 0], [0, 1e200, 0, 0], [0, 0, 1e200, 0]]
    for keys in ({"applied_transform": shear}, {"applied_transform": huge}, {"applied_scale": 0}):
        write_transforms(tmp_path, same, **keys)
        assert read_capture(tmp_path, PhotoChoice(format="transforms.json")).frames == ()
    for wrong in ([[1, 2], [3]], "x", [[1, 0, 0], [0, 1, 0], [0, 0, 1]], None):
        write_transforms(tmp_path, same, applied_transform=wrong)
        with pytest.raises(InputError, match="applied_transform: expected 3x4 numbers"):
            load_scene(tmp_path, choice=PhotoChoice(format="transforms.json"))


def test_given_points_decide_between_the_frames_of_the_files(tmp_path: Path):
    write_corner(tmp_path)
    world, keys = WORLDS["turned, moved and scaled"]
    write_transforms(tmp_path, world, **keys)
    capture = read_capture(tmp_path, PhotoChoice(format="transforms.json"))
    mesh = corner_scene().mesh
    points = observed(corner_scene(), on_the_faces(150), "given").sparse_points
    assert points is not None
    after = replace(points, positions=points.positions @ world.linear.T + world.shift)
    found = in_frame_of_mesh(capture._replace(sparse_points=after), mesh)
    assert found.sparse_points is not None
    np.testing.assert_allclose(found.sparse_points.positions, points.positions, atol=1e-12)
    assert "sparse points confirm it" in found.warnings[-1]


# ---------------------------------------------------------------------- --mesh-axes


def test_axes_are_written_as_they_are_read():
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        linear = axes(*zip(order, signs, strict=True))
        if np.linalg.det(linear) > 0:
            np.testing.assert_array_equal(parse_axes(axes_text(linear)), linear)
        else:
            with pytest.raises(InputError, match="mirrored"):
                parse_axes(axes_text(linear))


@pytest.mark.parametrize("text", ["", "x,y", "x,y,y", "x,y,z,x", "x,--y,-z", "a,b,c", "1,2,3", "x,,z"])
def test_other_axes_are_refused(text: str):
    with pytest.raises(InputError, match=r"--mesh-axes: expected x, y and z"):
        parse_axes(text)


@pytest.mark.parametrize("scale", [0.0, -1.0, float("nan"), 1e300])
def test_an_implausible_unit_is_refused(tmp_path: Path, scale: float):
    write_corner(tmp_path)
    with pytest.raises(InputError, match="--mesh-scale: expected a factor"):
        load_scene(tmp_path, choice=PhotoChoice(mesh_scale=scale))


def test_a_refused_run_writes_no_mesh(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    scene, out = scene_with_points(), tmp_path / "out"
    moved = scene.mesh.vertices + np.array([0, 0, 0.6])
    write_capture(tmp_path / "scene", "colmap", scene.views, scene.sparse_points, (moved, scene.mesh.faces))
    assert run(["fair", str(tmp_path / "scene"), "--out", str(out), "--points", "given"]) == 1
    assert "the mesh lies elsewhere than the photos show: of 300 sparse points" in capsys.readouterr().err
    assert not (out / "mesh.ply").exists()


def test_check_names_the_flags_and_with_them_the_mesh_is_confirmed(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    scene = scene_with_points()
    wrong = 10 * scene.mesh.vertices @ FRAMES["y up among z up"]
    write_capture(tmp_path / "scene", "colmap", scene.views, scene.sparse_points, (wrong, scene.mesh.faces))
    command = ["check", str(tmp_path / "scene"), "--points", "given"]
    assert run(command) == 1
    printed = capsys.readouterr()
    flags = ["--mesh-axes=x,-z,y", "--mesh-scale=0.1"]
    assert " ".join(flags) in (printed.out + printed.err).replace("\n", "")
    assert run([*command, *flags]) == 0
    assert "the photos confirm the place of the mesh" in capsys.readouterr().out


def test_a_run_notes_the_axes_of_its_mesh(tmp_path: Path):
    write_corner(tmp_path)
    choice = PhotoChoice(mesh_axes="x,-z,y", mesh_scale=0.1)
    source = SceneSource.typed(str(tmp_path), None, choice)
    header: dict[str, object] = {}
    source.note_in(header)
    again = SceneSource.of_run(json.loads(json.dumps(header)), tmp_path / "run.trace")
    assert again.choice == choice
