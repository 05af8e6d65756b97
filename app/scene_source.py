"""Where a scene comes from: what the user typed, kept in a run so that it can be found again."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from demo_scenes import DEMOS, load_demo
from fairing.errors import InputError
from fairing.io import load_scene
from fairing.scene import Scene

_KEY = "source"


@dataclass(frozen=True)
class SceneSource:
    """A demo's name or a path, and the mesh beside it.

    Attributes:
        scene: name of a demo, else an absolute path.
        mesh: absolute path of a mesh file, or None for the scene's own.
    """

    scene: str
    mesh: str | None = None

    @classmethod
    def typed(cls, scene: str, mesh: Path | None) -> "SceneSource":
        """From the command line. A demo's name wins over a folder of that name (`./cube` is the folder)."""
        if scene in DEMOS:
            if mesh is not None:
                raise InputError(f"--mesh {mesh}: the demo {scene} has its own mesh; leave --mesh out")
            return cls(scene)
        if not Path(scene).exists():
            raise InputError(f"{scene}: expected a demo ({', '.join(DEMOS)}) or a path, found no such file or folder")
        return cls(str(Path(scene).resolve()), None if mesh is None else str(mesh.resolve()))

    @classmethod
    def of_run(cls, header: dict[str, Any], where: Path) -> "SceneSource":
        """From the header of a trace.

        Raises:
            InputError: it was recorded by a program that did not say.
        """
        found = header.get(_KEY)
        if not isinstance(found, dict) or not isinstance(found.get("scene"), str):
            raise InputError(f"{where}: does not say which scene it was recorded on; give it with --scene")
        return cls(found["scene"], found.get("mesh"))

    def note_in(self, header: dict[str, Any]) -> None:
        """Write it into the header of a trace."""
        header[_KEY] = {"scene": self.scene, "mesh": self.mesh}

    def load(self, progress: Callable[[float, str], None] | None = None) -> Scene:
        """The scene; `progress` is told a fraction and a line while a demo's photos are taken.

        Raises:
            InputError: whatever is wrong with it.
        """
        return load_demo(self.scene, progress=progress) if self.scene in DEMOS else load_scene(self.scene, self.mesh)
