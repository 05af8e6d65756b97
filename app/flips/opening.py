"""Opens a flip record with the photos it was made from."""

from pathlib import Path

from app.files.scene_source import SceneSource
from app.flips.server import FlipApp
from app.viser_bridge.server import ViewerServer
from fairing.io import PhotoChoice
from fairing.scene import Scene
from fairing.triangulation import FlipTrace


def open_flips(server: ViewerServer, record: Path, scene: str | None, photos: PhotoChoice) -> FlipApp:
    """Serve a flip record.

    Args:
        scene: where its photos are; None: where the record was made.

    Raises:
        InputError: the record or its photos cannot be read.
    """
    trace = FlipTrace.load(record)
    source = SceneSource.of_replay(trace.header, record, scene, None, photos)
    capture = source.load_capture()
    views, points = capture.views, capture.sparse_points
    name = Path(source.scene).name
    return FlipApp(server, Scene.build(name, trace.vertices, trace.faces_at(0), views, sparse_points=points), trace)
