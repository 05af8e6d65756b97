"""Place of the mesh: a capture brought into the frame of its mesh, which is also the frame of what a run writes."""

from dataclasses import replace

from fairing.io.capture import Capture
from fairing.mesh import Mesh
from fairing.placement.frames import MeshFrame


def in_frame(capture: Capture, frame: MeshFrame) -> Capture:
    """The capture with cameras and sparse points in the frame of the mesh.

    Raises:
        InputError: the frame is mirrored.
    """
    views = tuple(replace(view, camera=frame.camera(view.camera)) for view in capture.views)
    sparse = capture.sparse_points
    if sparse is not None:
        sparse = replace(sparse, positions=frame.mesh_from_world(sparse.positions))
    return capture._replace(views=views, sparse_points=sparse, frames=())


def in_frame_of_mesh(capture: Capture, mesh: Mesh) -> Capture:
    """The capture in the frame that its own files name, with a warning, where the mesh lies there and not where it is.

    Its sparse points decide; without enough of them the photos do. The mesh stays as it is, and what is written of it is in
    its own frame.

    Raises:
        InputError: a photo cannot be decoded.
    """
    frames = [frame for frame in capture.frames if not frame.is_mirrored]
    if not frames:
        return capture
    # Imported on first use, with their libraries: the page is served before the engine is loaded.
    from fairing.placement.judge import has_judges, judge_mesh
    from fairing.placement.photo_agreement import better_frame_by_photos

    if capture.sparse_points is not None and has_judges(capture.sparse_points):
        placement = judge_mesh(mesh, capture.sparse_points, [view.camera for view in capture.views], frames)
        chosen, judges = placement.better, "sparse points"
    else:
        chosen, judges = better_frame_by_photos(mesh, capture.views, frames), "photos"
    if chosen is None or chosen not in frames:
        return capture
    warning = (
        f"the mesh lies elsewhere than the cameras: the {judges} confirm it {chosen.name}, so the cameras were brought there; "
        "results are in the mesh's own frame"
    )
    moved = in_frame(capture, chosen)
    return moved._replace(warnings=(*moved.warnings, warning))
