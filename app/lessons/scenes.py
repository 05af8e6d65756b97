"""Demo scenes of the lessons."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from demo_scenes import Photography, load_demo
from fairing.camera import Camera
from fairing.scene import Scene, View


@dataclass(frozen=True)
class LessonScene:
    """Attributes:
    title: short description.
    demo: name of the demo scene.
    photography: how its photos are taken; None: as the demo scene has them.
    points_choice: see `Scene.points_choice`.
    turned: px at the focal length: standard deviation of random turns of the cameras about each of their axes.
    """

    title: str
    demo: str
    photography: Photography | None
    points_choice: Literal["automatic", "given"] = "automatic"
    turned: float = 0.0


LESSON_SCENES: dict[str, LessonScene] = {
    "cube": LessonScene("the demo cube", "cube", Photography()),
    "occluded-cube": LessonScene("the demo cube behind a pole and passers-by", "cube", Photography(occluders=True)),
    "turned-cube": LessonScene("the demo cube with wrong cameras", "cube", Photography(), turned=0.5),
    "archway": LessonScene("the demo archway", "archway", Photography()),
    "building": LessonScene("a small building with sparse points", "building:20", None, "given"),
}


def load_lesson_scene(name: str, progress: Callable[[float, str], None] | None = None) -> Scene:
    """Load a lesson scene; its name is its key in `LESSON_SCENES`."""
    wanted = LESSON_SCENES[name]
    scene = load_demo(wanted.demo, wanted.photography, progress)
    chosen = wanted.points_choice if wanted.points_choice == "given" else scene.points_choice
    return replace(scene, name=name, points_choice=chosen, views=_turned(scene.views, wanted.turned))


def _turned(views: tuple[View, ...], px: float) -> tuple[View, ...]:
    """The views with their cameras turned about their centres, see `LessonScene.turned`."""
    rng, result = np.random.default_rng(1), []
    for view in views:
        camera = view.camera
        turn = Rotation.from_rotvec(rng.normal(size=3) * px / camera.K[0, 0]).as_matrix()
        R = turn @ camera.camera_from_world[:, :3]
        wrong = Camera.from_krt(camera.K, R, -R @ camera.center, camera.width, camera.height)
        result.append(replace(view, camera=wrong) if px else view)
    return tuple(result)


def is_lesson_scene(name: str, scene: Scene) -> bool:
    """Whether a scene is the lesson scene of this name. A capture of the same name is not: it has no exact truth."""
    return scene.name == name and scene.truth is not None
