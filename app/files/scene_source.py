"""Where a scene comes from: what the user typed, kept in a run so that it can be found again."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from demo_scenes import DEMO_NAMES, find_demo, is_demo, load_demo
from fairing.errors import InputError
from fairing.io import PhotoChoice

if TYPE_CHECKING:
    from fairing.io.capture import Capture
    from fairing.scene import Scene

_KEY = "source"
_ALL_PHOTOS = PhotoChoice()


@dataclass(frozen=True)
class SceneSource:
    """A demo's name or a path, and the mesh beside it.

    Attributes:
        scene: name of a demo, else an absolute path.
        mesh: absolute path of a mesh file, or None for the scene's own.
        choice: photos left out, masks (an absolute path) and weights.
    """

    scene: str
    mesh: str | None = None
    choice: PhotoChoice = _ALL_PHOTOS

    @classmethod
    def typed(cls, scene: str, mesh: Path | None, choice: PhotoChoice = _ALL_PHOTOS) -> "SceneSource":
        """From the command line. A demo's name wins over a folder of that name (`./cube` is the folder)."""
        if is_demo(scene):
            name = find_demo(scene).name
            if mesh is not None:
                raise InputError(f"--mesh {mesh}: the demo {scene} has its own mesh; leave --mesh out")
            if choice != _ALL_PHOTOS:
                raise InputError(
                    f"the demo {scene} takes all its photos; leave --leave-out, --masks, --photo-weights and "
                    "--photo-scale out"
                )
            return cls(name)
        if not Path(scene).exists():
            raise InputError(f"{scene}: expected a demo ({DEMO_NAMES}) or a path, found no such file or folder")
        if choice.masks is not None:
            choice = replace(choice, masks=choice.masks.resolve())
        return cls(str(Path(scene).resolve()), None if mesh is None else str(mesh.resolve()), choice)

    @classmethod
    def of_run(cls, header: dict[str, Any], where: Path) -> "SceneSource":
        """From the header of a trace.

        Raises:
            InputError: it was recorded by a program that did not say.
        """
        found = header.get(_KEY)
        if not isinstance(found, dict) or not isinstance(found.get("scene"), str):
            raise InputError(f"{where}: does not say which scene it was recorded on; give it with --scene")
        photos = found.get("photos") or {}
        masks = photos.get("masks")
        choice = PhotoChoice(
            tuple(photos.get("leave_out", ())),
            None if masks is None else Path(masks),
            tuple(photos.get("weights", ())),
            photos.get("scale", 1.0),
        )
        return cls(found["scene"], found.get("mesh"), choice)

    @classmethod
    def of_replay(
        cls, header: dict[str, Any], where: Path, scene: str | None, mesh: Path | None, choice: PhotoChoice
    ) -> "SceneSource":
        """Of a recorded run, with what is said anew: what is not, counts as it was recorded.

        Raises:
            InputError: neither the run nor the command line says which scene; or see `typed`.
        """
        recorded = None if scene is not None and _KEY not in header else cls.of_run(header, where)
        if recorded is None or (scene is not None and is_demo(scene)):
            return cls.typed(scene or "", mesh, choice)
        choice = recorded.choice if choice == _ALL_PHOTOS else choice
        if scene is None and mesh is None and recorded.mesh is not None:
            mesh = Path(recorded.mesh)
        return cls.typed(scene or recorded.scene, mesh, choice)

    def note_in(self, header: dict[str, Any]) -> None:
        """Write it into the header of a trace."""
        masks = self.choice.masks
        photos = {
            "leave_out": list(self.choice.leave_out),
            "masks": None if masks is None else str(masks),
            "weights": list(self.choice.photo_weights),
            "scale": self.choice.photo_scale,
        }
        header[_KEY] = {"scene": self.scene, "mesh": self.mesh, "photos": photos}

    def load(self, progress: Callable[[float, str], None] | None = None) -> "Scene":
        """The scene; `progress` is told a fraction and a line while a demo's photos are taken, or sparse points
        triangulated for want of a mesh.

        Raises:
            InputError: whatever is wrong with it.
        """
        if is_demo(self.scene):
            return load_demo(self.scene, progress=progress)
        tell = progress or (lambda fraction, line: None)

        from fairing.io import load_scene  # not at the top: the page is served before the engine is there
        from fairing.triangulation import flip_progress, triangulate

        def without_mesh(name: str, capture: "Capture") -> "Scene":
            def show(flips: int, open_edges: int, _: float) -> None:
                tell(flip_progress(flips, open_edges), f"triangulating sparse points: {flips} flips")

            return triangulate(name, capture.views, capture.sparse_points, on_progress=show).result()

        return load_scene(self.scene, self.mesh, self.choice, without_mesh)
