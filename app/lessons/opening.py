"""Scene of the command line option `--lesson`."""

from collections.abc import Callable

from app.files.scene_source import SceneSource
from app.lessons.lesson import ANY_SCENE
from app.lessons.reader import load_lesson
from app.lessons.scenes import LESSON_SCENES, load_lesson_scene
from fairing.errors import InputError
from fairing.scene import Scene

Progress = Callable[[float, str], None]


def scene_of_lesson(name: str, source: SceneSource) -> Callable[[Progress], Scene]:
    """A function that loads the scene of a lesson; for a lesson on any scene, that of the source.

    Raises:
        InputError: there is no such lesson, or the source is a different scene than the lesson's.
    """
    wanted = load_lesson(name).scene
    if wanted == ANY_SCENE:
        return source.load
    scene = LESSON_SCENES[wanted]
    if source.scene != scene.demo:
        raise InputError(f"lesson {name}: uses {scene.title}; omit {source.scene}")
    return lambda progress: load_lesson_scene(wanted, progress)
