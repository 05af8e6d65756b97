"""Image-consistent triangulation (Morris and Kanade, CVPR 2000): from sparse points to a start mesh.

What belongs here: the initial mesh (`points`, `initial_mesh`), edge flips (`quads`, `inconsistency`, `flips`), their record
(`record`), and the whole (`run`, `options`).

May import: the data modules of `fairing`, `fairing.util`, `fairing.geometry`, `fairing.cells` and `fairing.solve`.

Offers: the names in `__all__`, imported on first use; `triangulate` is the entry point.
"""

from typing import TYPE_CHECKING

from fairing.util.on_demand import on_demand

if TYPE_CHECKING:
    from fairing.triangulation.flips import EdgeFlipper, FlipSummary
    from fairing.triangulation.initial_mesh import StartMesh, start_mesh
    from fairing.triangulation.options import TriangulationOptions
    from fairing.triangulation.quads import Verdict
    from fairing.triangulation.record import FlipRecord, FlipTrace, is_flip_record
    from fairing.triangulation.run import Triangulation, flip_progress, triangulate

__all__ = [
    "EdgeFlipper",
    "FlipRecord",
    "FlipSummary",
    "FlipTrace",
    "StartMesh",
    "Triangulation",
    "TriangulationOptions",
    "Verdict",
    "flip_progress",
    "is_flip_record",
    "start_mesh",
    "triangulate",
]

__getattr__ = on_demand(
    __name__,
    {
        "EdgeFlipper": "fairing.triangulation.flips",
        "FlipRecord": "fairing.triangulation.record",
        "FlipSummary": "fairing.triangulation.flips",
        "FlipTrace": "fairing.triangulation.record",
        "StartMesh": "fairing.triangulation.initial_mesh",
        "Triangulation": "fairing.triangulation.run",
        "TriangulationOptions": "fairing.triangulation.options",
        "Verdict": "fairing.triangulation.quads",
        "flip_progress": "fairing.triangulation.run",
        "is_flip_record": "fairing.triangulation.record",
        "start_mesh": "fairing.triangulation.initial_mesh",
        "triangulate": "fairing.triangulation.run",
    },
)
