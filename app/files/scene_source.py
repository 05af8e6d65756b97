"""Scene sources: a demo's name or paths as typed, recorded in a run so that its scene can be opened again."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from demo_scenes import DEMOS, load_demo
from fairing.errors import InputError
from fairing.io import PhotoChoice
from fairing.io.photo_choice import check_format

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
        choice: photos left out, masks (an absolute path), weights, scale and format.
    """

    scene: str
    mesh: str | None = None
    choice: PhotoChoice = _ALL_PHOTOS

    @classmethod
    def typed(cls, scene: str, mesh: Path | None, choice: PhotoChoice = _ALL_PHOTOS) -> "SceneSource":
        """From the command line. A demo's name takes precedence over a folder of that name (`./cube` is the folder)."""
        if scene in DEMOS:
            if mesh is not None:
                raise InputError(f"--mesh {mesh}: the demo {scene} has its own mesh; leave --mesh out")
            if choice != _ALL_PHOTOS:
                raise InputError(
                    f"the demo {scene} takes all its photos; leave --leave-out, --masks, --photo-weights, "
                    "--photo-scale and --format out"
                )
            return cls(scene)
        if not Path(scene).exists():
            raise InputError(f"{scene}: expected a demo ({', '.join(DEMOS)}) or a path, found no such file or folder")
        if choice.masks is not None:
            choice = replace(choice, masks=choice.masks.resolve())
        return cls(str(Path(scene).resolve()), None if mesh is None else str(mesh.resolve()), choice)

    @classmethod
    def of_run(cls, header: dict[str, Any], where: Path) -> "SceneSource":
        """From the header of a trace.

        Raises:
            InputError: the header does not name its scene, or an entry has another type.
        """
        from fairing.io.json_file import Item  # imported on first use: the page is served before the engine is loaded

        found = header.get(_KEY)
        if not isinstance(found, dict) or not isinstance(found.get("scene"), str):
            raise InputError(f"{where}: does not name the scene it was recorded on; give it with --scene")
        source = Item(found, f"{where}: {_KEY}")
        photos = Item(found.get("photos") or {}, f"{where}: {_KEY}.photos")

        def texts(key: str) -> tuple[str, ...]:
            return tuple(item.text() for item in photos[key]) if key in photos else ()

        def path(item: Item, key: str) -> str | None:
            return item[key].text() if key in item and item[key].value is not None else None

        masks = path(photos, "masks")
        choice = PhotoChoice(
            texts("leave_out"),
            None if masks is None else Path(masks),
            texts("weights"),
            photos["scale"].number() if "scale" in photos else 1.0,
            check_format(path(photos, "format"), where),
        )
        return cls(source["scene"].text(), path(source, "mesh"), choice)

    @classmethod
    def of_replay(
        cls, header: dict[str, Any], where: Path, scene: str | None, mesh: Path | None, choice: PhotoChoice
    ) -> "SceneSource":
        """From a recorded run and the command line; what the command line leaves out is taken from the run.

        Raises:
            InputError: neither the run nor the command line names a scene; or see `typed`.
        """
        recorded = None if scene is not None and _KEY not in header else cls.of_run(header, where)
        if recorded is None or scene in DEMOS:
            return cls.typed(scene or "", mesh, choice)
        choice = recorded.choice if choice == _ALL_PHOTOS else choice
        if scene is None and mesh is None and recorded.mesh is not None:
            mesh = Path(recorded.mesh)
        return cls.typed(scene or recorded.scene, mesh, choice)

    def note_in(self, header: dict[str, Any]) -> None:
        """Record the source in the header of a trace."""
        masks = self.choice.masks
        photos = {
            "leave_out": list(self.choice.leave_out),
            "masks": None if masks is None else str(masks),
            "weights": list(self.choice.photo_weights),
            "scale": self.choice.photo_scale,
        }
        if self.choice.format is not None:
            photos["format"] = self.choice.format
        header[_KEY] = {"scene": self.scene, "mesh": self.mesh, "photos": photos}

    def load(self, progress: Callable[[float, str], None] | None = None) -> "Scene":
        """The scene; sparse points are triangulated where there is no mesh.

        Args:
            progress: called with the fraction done and a line while photos are rendered or points triangulated.

        Raises:
            InputError: the scene cannot be used.
        """
        if self.scene in DEMOS:
            return load_demo(self.scene, progress=progress)
        tell = progress or (lambda fraction, line: None)

        from fairing.io import load_scene  # imported on first use: the page is served before the engine is loaded
        from fairing.triangulation import flip_progress, triangulate

        def without_mesh(name: str, capture: "Capture") -> "Scene":
            def show(flips: int, open_edges: int, _: float) -> None:
                tell(flip_progress(flips, open_edges), f"triangulating sparse points: {flips} flips")

            return triangulate(name, capture.views, capture.sparse_points, on_progress=show).result()

        return load_scene(self.scene, self.mesh, self.choice, without_mesh)
