"""What `--lesson` opens."""

from collections.abc import Callable

from app.files.scene_source import SceneSource
from app.lessons.lesson import ANY_SCENE
from app.lessons.reader import load_lesson
from app.lessons.scenes import LESSON_SCENES, load_lesson_scene
from fairing.errors import InputError
from fairing.scene import Scene

Progress = Callable[[float, str], None]


def scene_of_lesson(name: str, source: SceneSource) -> Callable[[Progress], Scene]:
    """What loads the scene that a lesson plays on: the source's own for a lesson on any scene.

    Raises:
        InputError: there is no such lesson, or the source is another scene than the lesson's.
    """
    wanted = load_lesson(name).scene
    if wanted == ANY_SCENE:
        return source.load
    scene = LESSON_SCENES[wanted]
    if source.scene != scene.demo:
        raise InputError(f"lesson {name}: plays on {scene.title}; leave {source.scene} out")
    return lambda progress: load_lesson_scene(wanted, progress)
