"""Image-consistent triangulation (Morris and Kanade, CVPR 2000): from sparse points to a start mesh."""

from fairing.triangulation.flips import EdgeFlipper, FlipSummary
from fairing.triangulation.options import TriangulationOptions
from fairing.triangulation.quads import Verdict
from fairing.triangulation.record import FlipRecord, FlipTrace, is_flip_record
from fairing.triangulation.run import Triangulation, flip_progress, triangulate
from fairing.triangulation.start import StartMesh, start_mesh

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
