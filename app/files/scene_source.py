"""Scene sources: a demo's name or paths as typed, recorded in a run so that its scene can be opened again."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.files.run_files import POINTS
from demo_scenes import DEMO_NAMES, find_demo, is_demo, load_demo
from fairing.errors import InputError
from fairing.io import PhotoChoice
from fairing.io.photo_choice import check_format
from fairing.io.points_choice import PointsChoice, check_points_choice
from fairing.util.cache_folder import cache_folder

if TYPE_CHECKING:
    from fairing.io.capture import Capture
    from fairing.scene import Scene, SparsePoints

Progress = Callable[[float, str], None]
FINDING_POINTS = "finding points"  # lines of progress begin with it while points are found in the photos

_KEY = "source"
_ALL_PHOTOS = PhotoChoice()


@dataclass(frozen=True)
class SceneSource:
    """A demo's name or a path, and the mesh beside it.

    Attributes:
        scene: name of a demo, else an absolute path.
        mesh: absolute path of a mesh file, or None for the scene's own.
        choice: photos left out, masks (an absolute path), weights, scale and format.
        points: sparse points. "automatic" is "given" for a demo that finds none in its photos.
        points_file: file of a run with the points it was recorded with; where it exists they are not found again.
    """

    scene: str
    mesh: str | None = None
    choice: PhotoChoice = _ALL_PHOTOS
    points: PointsChoice = "given"
    points_file: Path | None = None

    @classmethod
    def typed(
        cls, scene: str, mesh: Path | None, choice: PhotoChoice = _ALL_PHOTOS, points: PointsChoice = "given"
    ) -> "SceneSource":
        """From the command line. A demo's name takes precedence over a folder of that name (`./cube` is the folder)."""
        if is_demo(scene):
            demo = find_demo(scene)
            name = demo.name
            if mesh is not None:
                raise InputError(f"--mesh {mesh}: the demo {scene} has its own mesh; leave --mesh out")
            if choice != _ALL_PHOTOS:
                raise InputError(
                    f"the demo {scene} takes all its photos; leave --leave-out, --masks, --photo-weights, "
                    "--photo-scale and --format out"
                )
            return cls(name, points="given" if points == "automatic" and not demo.finds_points else points)
        if not Path(scene).exists():
            raise InputError(f"{scene}: expected a demo ({DEMO_NAMES}) or a path, found no such file or folder")
        if choice.masks is not None:
            choice = replace(choice, masks=choice.masks.resolve())
        return cls(str(Path(scene).resolve()), None if mesh is None else str(mesh.resolve()), choice, points)

    @property
    def title(self) -> str:
        """Short name: of the demo, or of the file or folder."""
        return self.scene if is_demo(self.scene) else Path(self.scene).name

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
        points = check_points_choice(path(source, "points") or "given", where)
        file = where.with_suffix(POINTS)
        return cls(source["scene"].text(), path(source, "mesh"), choice, points, file if file.exists() else None)

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
            return cls.typed(scene or "", mesh, choice)
        if scene is not None and is_demo(scene):
            return cls.typed(scene, mesh, choice, recorded.points)._with_points_of(recorded)
        choice = recorded.choice if choice == _ALL_PHOTOS else choice
        if scene is None and mesh is None and recorded.mesh is not None:
            mesh = Path(recorded.mesh)
        return cls.typed(scene or recorded.scene, mesh, choice, recorded.points)._with_points_of(recorded)

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

    def resolved(self, points: "SparsePoints | None") -> "SceneSource":
        """With the choice that gives the points of the loaded scene again."""
        return replace(self, points="none" if points is None else points.origin)

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
        header[_KEY] = {"scene": self.scene, "mesh": self.mesh, "photos": photos, "points": self.points}

    def load(self, progress: Progress | None = None, skip_points: Callable[[], bool] = lambda: False) -> "Scene":
        """The scene; sparse points are triangulated where there is no mesh.

        Args:
            progress: called with the fraction done and a line while photos are rendered, points found or triangulated.
            skip_points: polled while points are found in the photos; where it returns True, the scene has the given ones.

        Raises:
            InputError: the scene cannot be used.
        """
        tell = progress or (lambda fraction, line: None)
        if is_demo(self.scene):
            scene = load_demo(self.scene, progress=progress)
            capture = self._with_chosen_points(_capture_of(scene), len(scene.mesh.vertices), tell, skip_points)
            return replace(scene, sparse_points=capture.sparse_points, warnings=capture.warnings)

        from fairing.io import load_scene  # imported on first use: the page is served before the engine is loaded
        from fairing.triangulation import flip_progress, triangulate

        def without_mesh(name: str, capture: "Capture") -> "Scene":
            def show(flips: int, open_edges: int, _: float) -> None:
                tell(flip_progress(flips, open_edges), f"triangulating sparse points: {flips} flips")

            return triangulate(name, capture.views, capture.sparse_points, on_progress=show).result()

        def choose(capture: "Capture", n_vertices: int | None) -> "Capture":
            return self._with_chosen_points(capture, n_vertices, tell, skip_points)

        return load_scene(self.scene, self.mesh, self.choice, without_mesh, choose)

    def load_capture(self, progress: Progress | None = None) -> "Capture":
        """The photos, cameras and sparse points, without a mesh. Arguments and exceptions as of `load`."""
        from fairing.io import read_capture

        tell = progress or (lambda fraction, line: None)
        if is_demo(self.scene):
            capture = _capture_of(load_demo(self.scene, progress=progress))
        else:
            capture = read_capture(self.scene, self.choice)
        return self._with_chosen_points(capture, None, tell)

    def _with_chosen_points(
        self,
        capture: "Capture",
        n_vertices: int | None,
        progress: Progress,
        skip: Callable[[], bool] = lambda: False,
    ) -> "Capture":
        if self.points in ("own", "both") and self.points_file is not None and self.points_file.exists():
            from fairing.io.points_file import read_points

            points = read_points(self.points_file, len(capture.views))
            return capture._replace(sparse_points=replace(points, origin=self.points))
        if self.points == "given":
            return capture
        from fairing.io.scene_points import choose_points

        return choose_points(capture, n_vertices, self.points, self._points_cache(), progress, skip)

    def _points_cache(self) -> Path:
        """File in the user's cache folder for the points found in these photos."""
        photos = hashlib.sha256(repr((self.scene, self.choice)).encode()).hexdigest()[:16]
        return cache_folder() / "points" / f"{Path(self.scene).name.replace(':', '-')}-{photos}.npz"


def write_points_of_run(points: "SparsePoints | None", record: Path) -> None:
    """Write points found in the photos beside the trace or record of flips of a run; given points are not written.

    Raises:
        InputError: the file cannot be written.
    """
    if points is None or points.origin == "given":
        return
    from fairing.io.points_file import write_points

    write_points(record.with_suffix(POINTS), points)


def _capture_of(scene: "Scene") -> "Capture":
    from fairing.io.capture import Capture

    return Capture(scene.views, scene.sparse_points, scene.warnings)
