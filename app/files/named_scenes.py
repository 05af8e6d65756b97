"""Scenes by name: the demo scenes, and those of installed packages (entry points of the group `fairing.scenes`)."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import demo_scenes

if TYPE_CHECKING:
    from fairing.io.named_scenes import SceneModule
    from fairing.scene import Scene


def is_named(name: str) -> bool:
    """Whether there is a scene of that name."""
    return demo_scenes.is_demo(name) or any(module.is_demo(name) for module in _others())


def full_name(name: str) -> str:
    """The name of a scene as runs record it.

    Raises:
        InputError: the name is that of a family of scenes, and what follows it makes no sense.
    """
    return demo_scenes.find_demo(name).name if demo_scenes.is_demo(name) else name


def load_named(name: str, progress: Callable[[float, str], None] | None = None) -> "Scene":
    """The scene of that name; `progress` is called with the finished part, 0 to 1, and a line.

    Raises:
        InputError: there is no scene of that name.
    """
    if not demo_scenes.is_demo(name):
        for module in _others():
            if module.is_demo(name):
                return module.load_demo(name, progress=progress)
    return demo_scenes.load_demo(name, progress=progress)


def scene_names() -> str:
    """All names, for messages."""
    return ", ".join([demo_scenes.DEMO_NAMES, *other_names()])


def other_names() -> list[str]:
    """The names that installed packages offer, a line for each package."""
    return [module.DEMO_NAMES for module in _others()]


def _others() -> "list[SceneModule]":
    from fairing.util.plugins import offered  # imported on first use: the page is served before the engine is loaded

    return [module for module in offered("fairing.scenes").values() if module is not demo_scenes]
