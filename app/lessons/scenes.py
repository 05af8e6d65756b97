"""Demo scenes of the lessons."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

from demo_scenes import Photography, load_demo
from fairing.scene import Scene


@dataclass(frozen=True)
class LessonScene:
    """Attributes:
    title: short description.
    demo: name of the demo scene.
    photography: how its photos are taken; None: as the demo scene has them.
    points_choice: see `Scene.points_choice`.
    """

    title: str
    demo: str
    photography: Photography | None
    points_choice: Literal["automatic", "given"] = "automatic"


LESSON_SCENES: dict[str, LessonScene] = {
    "cube": LessonScene("the demo cube", "cube", Photography()),
    "occluded-cube": LessonScene("the demo cube behind a pole and passers-by", "cube", Photography(occluders=True)),
    "archway": LessonScene("the demo archway", "archway", Photography()),
    "building": LessonScene("a small building with sparse points", "building:20", None, "given"),
}


def load_lesson_scene(name: str, progress: Callable[[float, str], None] | None = None) -> Scene:
    """Load a lesson scene; its name is its key in `LESSON_SCENES`."""
    wanted = LESSON_SCENES[name]
    scene = load_demo(wanted.demo, wanted.photography, progress)
    chosen = wanted.points_choice if wanted.points_choice == "given" else scene.points_choice
    return replace(scene, name=name, points_choice=chosen)


def is_lesson_scene(name: str, scene: Scene) -> bool:
    """Whether a scene is the lesson scene of this name. A capture of the same name is not: it has no exact truth."""
    return scene.name == name and scene.truth is not None
