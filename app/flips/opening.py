"""Opening a record of flips with the photos it was made from."""

from pathlib import Path

import viser

from app.files.scene_source import SceneSource
from app.flips.page import FlipApp
from demo_scenes import is_demo, load_demo
from fairing.io import PhotoChoice, read_capture
from fairing.scene import Scene
from fairing.triangulation import FlipTrace


def open_flips(server: viser.ViserServer, record: Path, scene: str | None, photos: PhotoChoice) -> FlipApp:
    """The page of a record.

    Args:
        scene: where its photos are; None: where the record says.

    Raises:
        InputError: the record or its photos cannot be read.
    """
    trace = FlipTrace.load(record)
    source = SceneSource.of_replay(trace.header, record, scene, None, photos)
    if is_demo(source.scene):
        demo = load_demo(source.scene)
        views, points = demo.views, demo.sparse_points
    else:
        capture = read_capture(source.scene, source.choice)
        views, points = capture.views, capture.sparse_points
    name = Path(source.scene).name
    return FlipApp(server, Scene.build(name, trace.vertices, trace.faces_at(0), views, sparse_points=points), trace)
