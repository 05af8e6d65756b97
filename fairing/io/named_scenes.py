"""Scenes that installed packages offer by name, such as the demo scenes.

A package offers scenes by an entry point of the group `fairing.scenes` that names a module, see `SceneModule`.
"""

from collections.abc import Callable
from typing import Protocol

from fairing.scene import Scene
from fairing.util.plugins import offered

GROUP = "fairing.scenes"


class SceneModule(Protocol):
    """A module that offers scenes by name."""

    @property
    def DEMO_NAMES(self) -> str:
        """The names, for messages."""
        ...

    def is_demo(self, name: str) -> bool:
        """Whether the module offers a scene of that name."""
        ...

    def load_demo(self, name: str, *, progress: Callable[[float, str], None] | None = None) -> Scene:
        """The scene of that name; `progress` is called with the finished part, 0 to 1, and a line.

        Raises:
            InputError: the name is that of a family of scenes, and what follows it makes no sense.
        """
        ...


def scene_modules() -> list[SceneModule]:
    """The modules of the installed packages that offer scenes."""
    return list(offered(GROUP).values())


def module_of_scene(name: str) -> SceneModule | None:
    """The module that offers the scene of that name; None if no package does."""
    return next((module for module in scene_modules() if module.is_demo(name)), None)


def scene_names() -> str:
    """The names of all scenes on offer, for messages; empty if there are none."""
    return ", ".join(module.DEMO_NAMES for module in scene_modules())
