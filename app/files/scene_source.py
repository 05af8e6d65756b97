"""Scene sources: a demo's name or paths as typed, recorded in a run so that its scene can be opened again."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.files.named_scenes import full_name, is_named, load_named, scene_names
from app.files.run_files import POINTS
from fairing.errors import InputError
from fairing.io import PhotoChoice
from fairing.io.photo_choice import check_format
from fairing.io.points_choice import PointsChoice, check_around, check_cameras_choice, check_points_choice

if TYPE_CHECKING:
    from fairing.io.chosen_inputs import ChosenInputs
    from fairing.scene import Around, BoxCorners, CamerasChoice, Scene, SparsePoints, View

Progress = Callable[[float, str], None]

_KEY = "source"
_ALL_PHOTOS = PhotoChoice()


@dataclass(frozen=True)
class SceneSource:
    """A demo's name or a path, and the mesh beside it.

    Attributes:
        scene: name of a demo, else an absolute path.
        mesh: absolute path of a mesh file, or None for the scene's own.
        choice: photos left out, masks (an absolute path), weights, scale and format.
        points: sparse points. A demo has a choice of its own in place of "automatic".
        points_file: file of a run with the points it was recorded with; where it exists they are not found again.
        cameras: of a new run, and of the triangulation of a recorded run; the trace has those of the run.
        around, box: points that are triangulated without a mesh.
    """

    scene: str
    mesh: str | None = None
    choice: PhotoChoice = _ALL_PHOTOS
    points: PointsChoice = "given"
    points_file: Path | None = None
    cameras: "CamerasChoice" = "given"
    around: "Around" = "automatic"
    box: "BoxCorners | None" = None

    @classmethod
    def typed(
        cls,
        scene: str,
        mesh: Path | None,
        choice: PhotoChoice = _ALL_PHOTOS,
        points: PointsChoice = "given",
        cameras: "CamerasChoice" = "given",
        around: "Around" = "automatic",
        box: "BoxCorners | None" = None,
    ) -> "SceneSource":
        """From the command line. A folder of a demo's name is the folder if it holds a capture."""
        if box is not None:
            from fairing.triangulation.points_in_box import check_corners

            check_corners(box, around)
        if is_named(scene) and not _holds_capture(scene):
            return replace(cls._demo(scene, mesh, choice, points), cameras=cameras, around=around, box=box)
        if not Path(scene).exists():
            raise InputError(f"{scene}: expected a demo ({scene_names()}) or a path, found no such file or folder")
        if choice.masks is not None:
            choice = replace(choice, masks=choice.masks.resolve())
        mesh_path = None if mesh is None else str(mesh.resolve())
        return cls(str(Path(scene).resolve()), mesh_path, choice, points, cameras=cameras, around=around, box=box)

    @classmethod
    def _demo(cls, scene: str, mesh: Path | None, choice: PhotoChoice, points: PointsChoice) -> "SceneSource":
        name = full_name(scene)
        if mesh is not None:
            raise InputError(f"--mesh {mesh}: the demo {scene} has its own mesh; leave --mesh out")
        if choice != _ALL_PHOTOS:
            raise InputError(
                f"the demo {scene} takes all its photos; leave --leave-out, --masks, --photo-weights, "
                "--photo-scale, --mesh-axes, --mesh-scale and --format out"
            )
        return cls(name, points=points)

    @property
    def title(self) -> str:
        """Short name: of the demo, or of the file or folder."""
        return self.scene if is_named(self.scene) else Path(self.scene).name

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
            format=check_format(path(photos, "format"), where),
            mesh_axes=path(photos, "mesh_axes") or PhotoChoice.mesh_axes,
            mesh_scale=photos["mesh_scale"].number() if "mesh_scale" in photos else PhotoChoice.mesh_scale,
        )
        points = check_points_choice(path(source, "points") or "given", where)
        around = check_around(path(source, "around") or "everything", where)  # older runs triangulated all points
        file = where.with_suffix(POINTS)
        points_file = file if file.exists() else None
        box = tuple(source["box"].numbers(6).tolist()) if "box" in source else None
        cameras = check_cameras_choice(path(source, "cameras") or "given", where)
        return cls(source["scene"].text(), path(source, "mesh"), choice, points, points_file, cameras, around, box)

    @classmethod
    def of_replay(
        cls, header: dict[str, Any], where: Path, scene: str | None, mesh: Path | None, choice: PhotoChoice
    ) -> "SceneSource":
        """From a recorded run and the command line; what the command line leaves out is taken from the run.

        Raises:
            InputError: neither the run nor the command line names a scene; or see `typed`.
        """
        recorded = None if scene is not None and _KEY not in header else cls.of_run(header, where)
        if recorded is None:
            return cls.typed(scene or "", mesh, choice, "automatic")  # `Session` uses the given ones if the run did
        if scene is None and is_named(recorded.scene):  # also where the run is opened beside a folder of that name
            return cls._demo(recorded.scene, mesh, choice, recorded.points)._with_points_of(recorded)
        if scene is not None and is_named(scene) and not _holds_capture(scene):
            return cls._demo(scene, mesh, choice, recorded.points)._with_points_of(recorded)
        choice = recorded.choice if choice == _ALL_PHOTOS else choice
        if scene is None and mesh is None and recorded.mesh is not None:
            mesh = Path(recorded.mesh)
        typed = cls.typed(
            scene or recorded.scene, mesh, choice, recorded.points, recorded.cameras, recorded.around, recorded.box
        )
        return typed._with_points_of(recorded)

    def resumed(self, header: dict[str, Any], where: Path) -> "SceneSource":
        """With the points of the recorded run to continue, unless others are chosen or the run does not note its scene."""
        if _KEY not in header:
            return self
        recorded = SceneSource.of_run(header, where)
        if self.points not in ("automatic", recorded.points):
            return self
        return replace(self, points=recorded.points)._with_points_of(recorded)

    def _with_points_of(self, recorded: "SceneSource") -> "SceneSource":
        """With the recorded points, unless photos are chosen anew: observations refer to photos by index."""
        return replace(self, points_file=recorded.points_file if self.choice == recorded.choice else None)

    def resolved(self, points: "SparsePoints | None", is_refined: bool) -> "SceneSource":
        """With the choices that give the points and cameras of the loaded scene again.

        Args:
            is_refined: whether its cameras were refined, with whatever result.
        """
        cameras = self.cameras if is_refined else "given"
        return replace(self, points="none" if points is None else points.origin, cameras=cameras)

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
        for name in ("mesh_axes", "mesh_scale"):
            if getattr(self.choice, name) != getattr(_ALL_PHOTOS, name):
                photos[name] = getattr(self.choice, name)
        header[_KEY] = {"scene": self.scene, "mesh": self.mesh, "photos": photos, "points": self.points}
        if self.mesh is None and self.around != "everything":
            header[_KEY]["around"] = self.around
        if self.mesh is None and self.box is not None:
            header[_KEY]["box"] = list(self.box)
        if self.mesh is None and self.cameras != "given":
            header[_KEY]["cameras"] = self.cameras

    def load(self, progress: Progress | None = None, skip_points: Callable[[], bool] = lambda: False) -> "Scene":
        """The scene; its run finds the sparse points, see `Session.choose_inputs`. Without a mesh they are triangulated here.

        Args:
            progress: called with the fraction done and a line while photos are rendered, points found or triangulated.
            skip_points: polled while points are found in the photos; where it returns True, the scene has the given ones.

        Raises:
            InputError: the scene cannot be used.
        """
        from fairing.io import load_scene  # imported on first use: the page is served before the engine is loaded

        tell, recorded = progress or (lambda fraction, line: None), self._recorded_points()
        if is_named(self.scene):
            if self.around == "object":
                raise InputError(f"--around object: the demo {self.scene} has its own mesh; leave --around out")
            if self.box is not None:
                raise InputError(f"--box: the demo {self.scene} has its own mesh; leave --box out")
            scene = load_named(self.scene, progress)
            cameras_choice = "given" if self.cameras == "automatic" else self.cameras
            scene = replace(scene, points_choice=self._choice(scene), cameras_choice=cameras_choice)
            if recorded is not None:
                scene = replace(scene, sparse_points=self._read_points(recorded, scene.views), points_choice="given")
            return scene
        scene = load_scene(
            self.scene,
            self.mesh,
            self.choice,
            self.points,
            self.cameras,
            self.around,
            recorded,
            self.box,
            tell,
            skip_points,
        )
        if recorded is None or scene.sparse_points is None:
            return scene
        return replace(scene, sparse_points=replace(scene.sparse_points, origin=self.points))

    def load_capture(self, progress: Progress | None = None) -> "ChosenInputs":
        """The photos with the chosen cameras and sparse points, without a mesh. Arguments and exceptions as of `load`."""
        from fairing.io import load_capture
        from fairing.io.chosen_inputs import inputs_of_demo

        tell, recorded = progress or (lambda fraction, line: None), self._recorded_points()
        points = "none" if recorded is not None else self.points
        if is_named(self.scene):
            inputs = inputs_of_demo(load_named(self.scene, progress), points, self.cameras, tell)
        else:
            inputs = load_capture(self.scene, self.choice, points, self.cameras, tell)
        return inputs if recorded is None else replace(inputs, sparse_points=self._read_points(recorded, inputs.views))

    def _choice(self, demo: "Scene") -> PointsChoice:
        return demo.points_choice if self.points == "automatic" else self.points

    def _recorded_points(self) -> Path | None:
        """The file of the points of a recorded run; None where they are given, or there is no file."""
        file = self.points_file if self.points in ("own", "both") else None
        return file if file is not None and file.exists() else None

    def _read_points(self, file: Path, views: "Sequence[View]") -> "SparsePoints":
        from fairing.io.points_file import read_points

        return replace(read_points(file, len(views)), origin=self.points)


def write_points_of_run(points: "SparsePoints | None", record: Path) -> None:
    """Write points found in the photos beside the trace or record of flips of a run; given points are not written.

    Raises:
        InputError: the file cannot be written.
    """
    if points is None or points.origin == "given":
        return
    from fairing.io.points_file import write_points

    write_points(record.with_suffix(POINTS), points)


def _holds_capture(path: str) -> bool:
    """Whether there is a folder or file with cameras in some format."""
    if not os.path.exists(path):
        return False
    from fairing.io.load import is_capture  # imported on first use: the page is served before the engine is loaded

    return is_capture(Path(path))
