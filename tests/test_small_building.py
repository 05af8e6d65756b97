"""The engine on a small building whose start is several pixels off: whole runs on few pixels."""

from dataclasses import replace

import pytest

from demo_scenes.building.scene import scene_of_plan
from fairing import fair
from fairing.run.session import Session
from fairing.scene import Scene
from tests.family import at_truth, errors_of
from tests.small_building import small_building


@pytest.fixture(scope="module")
def scene() -> Scene:
    return replace(scene_of_plan("building small", small_building()), points_choice="given")


ERRORS = ("median", "rms", "surface median", "surface rms")


def assert_better(scene: Scene, session: Session, **bounds: float) -> None:
    """No error is larger than at the start, and none above its bound, in % of the diagonal."""
    start, end = errors_of(scene, scene.mesh.vertices), errors_of(scene, session.vertices)
    assert all(end[key] <= start[key] for key in ERRORS), (start, end)
    assert all(end[key.replace("_", " ")] < bound for key, bound in bounds.items()), end


# Start: determined median 0.515 % of the diagonal, rms 0.546, surface median 0.187, rms 0.279. The bounds leave a fifth of
# the measured figures as room.


@pytest.mark.slow
def test_a_building_several_pixels_off_is_improved_by_default(scene):
    """Measured: 0.071, 0.165, 0.024, 0.135 in 7 s of processor time; the run takes the start for noise."""
    assert_better(scene, fair(scene), median=0.09, rms=0.21, surface_median=0.03, surface_rms=0.17)


@pytest.mark.slow
def test_a_building_at_its_true_place_stays_there(scene):
    end = errors_of(scene, fair(at_truth(scene)).vertices)
    assert end["rms"] < 0.05, end
