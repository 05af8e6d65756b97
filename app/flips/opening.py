"""Opens a flip record with the photos it was made from."""

from dataclasses import replace
from pathlib import Path

from app.files.scene_source import SceneSource
from app.flips.server import FlipApp
from app.viser_bridge.server import ViewerServer
from fairing.io import PhotoChoice
from fairing.run.trace_header import with_recorded_cameras
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
    given = replace(source, cameras="given").load_capture()  # the record has the corrected ones
    name = Path(source.scene).name
    start = Scene.build(name, trace.vertices, trace.faces_at(0), given.views, sparse_points=given.sparse_points)
    return FlipApp(server, with_recorded_cameras(start, trace.header), trace)
