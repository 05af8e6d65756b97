"""The demo scenes by name."""

import importlib
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from fairing.errors import InputError

if TYPE_CHECKING:
    from demo_scenes.photography import Photography, Progress
    from fairing.scene import Scene


@dataclass(frozen=True)
class Demo:
    """A scene that comes with the package.

    Attributes:
        name: what the user types.
        description: one line.
        seed: of a member of the family `building:SEED`; None for the other scenes.
    """

    name: str
    description: str
    seed: int | None = None

    def build(self, *args: Any, **scene_options: Any) -> "Scene":
        """Build the scene from a `Photography` and a progress callback; further keywords are the scene's own."""
        # Modules of scenes are imported on first use, so that listing the scenes is fast.
        module, function = f"demo_scenes.{self.name}", f"{self.name}_scene"
        if self.seed is not None:
            module, function = "demo_scenes.building.scene", "building_scene"
            scene_options = {"seed": self.seed, **scene_options}
        return getattr(importlib.import_module(module), function)(*args, **scene_options)


DEMOS: dict[str, Demo] = {
    demo.name: demo
    for demo in [
        Demo("cube", "three textured faces of a cube, their common corner off by 12 % of the edge; 12 photos"),
        Demo("facade", "a stepped facade with gable, porch and apse, all vertices off their corners; 22 photos"),
        Demo("archway", "archways and balcony edges, the mesh spanned between noisy points; 10 photos"),
        Demo("dome", "a curved surface under dense mosaic, radially disturbed; 16 photos"),
    ]
}
BUILDING = Demo("building:SEED", "a building drawn from any integer, such as building:7; 8 to 30 photos")
_FAMILY = "building:"
DEMO_NAMES = f"{', '.join(DEMOS)}, {BUILDING.name}"


def is_demo(name: str) -> bool:
    """Whether a name is that of a demo scene; `building:` with a bad seed is one, too, and `find_demo` rejects it."""
    return name in DEMOS or name.startswith(_FAMILY)


def find_demo(name: str) -> Demo:
    """The demo scene of that name.

    Raises:
        InputError: there is no such scene.
    """
    if name in DEMOS:
        return DEMOS[name]
    if name.startswith(_FAMILY):
        seed = name.removeprefix(_FAMILY)
        if not re.fullmatch(r"-?[0-9]{1,18}", seed):
            raise InputError(
                f"demo {name}: expected an integer as the seed, such as {_FAMILY}7, found {seed or 'none'}"
            )
        return Demo(f"{_FAMILY}{int(seed)}", BUILDING.description, int(seed))
    raise InputError(f"demo {name}: expected one of {DEMO_NAMES}")


def load_demo(
    name: str, photography: "Photography | None" = None, progress: "Progress | None" = None, **scene_options: Any
) -> "Scene":
    """The demo scene of that name; its photos are rendered on first use (seconds to a minute) and cached.

    Args:
        photography: default: ideal photos; for `building:SEED` what is drawn from the seed.
        progress: called with a fraction 0 to 1 and a line that describes the current work.
        scene_options: the scene's own keywords, such as the cube's `displacement`.

    Raises:
        InputError: there is no such scene.
    """
    return find_demo(name).build(photography, progress, **scene_options)
