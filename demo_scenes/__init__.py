"""Scenes with exact truth, photographed by a ray caster: the ground the engine is tested, tuned and taught on."""

import importlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from fairing.errors import InputError
from fairing.util.on_demand import on_demand

if TYPE_CHECKING:
    from demo_scenes.cube import cube_scene
    from demo_scenes.photography import Photography, Progress
    from fairing.scene import Scene

__all__ = ["DEMOS", "Demo", "Photography", "Progress", "cube_scene", "load_demo"]


@dataclass(frozen=True)
class Demo:
    """A scene that comes with the package.

    Attributes:
        name: what the user types.
        description: one line.
    """

    name: str
    description: str

    def build(self, *args: Any, **scene_options: Any) -> "Scene":
        """Makes the scene of a `Photography` and a progress callback; further keywords are the scene's own."""
        # The module of a scene is imported when it is wanted: a list of them should not have to wait for any.
        return getattr(importlib.import_module(f"demo_scenes.{self.name}"), f"{self.name}_scene")(
            *args, **scene_options
        )


DEMOS: dict[str, Demo] = {
    demo.name: demo
    for demo in [
        Demo("cube", "three textured faces of a cube, their common corner off by 12 % of the edge; 12 photos"),
        Demo(
            "facade",
            "a stepped facade with gable, porch and apse, all vertices off their corners; 22 photos",
        ),
        Demo("archway", "archways and balcony edges, the mesh spanned between noisy points; 10 photos"),
        Demo("dome", "a curved surface under dense mosaic, radially disturbed; 16 photos"),
    ]
}


def load_demo(
    name: str, photography: "Photography | None" = None, progress: "Progress | None" = None, **scene_options: Any
) -> "Scene":
    """The demo scene of that name; its photos are taken on first use (some seconds) and cached.

    Args:
        progress: called with a fraction 0 to 1 and a line that says what is going on.
        scene_options: the scene's own keywords, such as the cube's `displacement`.

    Raises:
        InputError: there is no such scene.
    """
    if name not in DEMOS:
        raise InputError(f"demo {name}: expected one of {', '.join(DEMOS)}")
    from demo_scenes.photography import Photography

    return DEMOS[name].build(photography or Photography(), progress, **scene_options)


__getattr__ = on_demand(
    __name__,
    {
        "Photography": "demo_scenes.photography",
        "Progress": "demo_scenes.photography",
        "cube_scene": "demo_scenes.cube",
    },
)
