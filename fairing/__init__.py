"""EigenFairing: 3D model fairing using image coherence (Mishra, Amidi, Kanade, BMVC 2004).

from fairing import fair, load_scene

session = fair(load_scene("my/capture", mesh="start.ply"))
positions = session.scene.unweld(session.vertices)
"""

from fairing.api import fair
from fairing.camera import Camera
from fairing.errors import InputError
from fairing.inspect import FaceCells, face_cells
from fairing.io import PhotoChoice, load_scene, read_mesh, write_mesh
from fairing.mesh import Mesh
from fairing.options import PRESETS, FairingOptions
from fairing.photo import ArrayPhoto, FilePhoto
from fairing.scene import Scene, SparsePoints, Truth, View
from fairing.session import Session
from fairing.trace import StepReason, StepRecord, Trace
from fairing.triangulation import FlipTrace, triangulate

__all__ = [
    "PRESETS",
    "ArrayPhoto",
    "Camera",
    "FaceCells",
    "FairingOptions",
    "FilePhoto",
    "FlipTrace",
    "InputError",
    "Mesh",
    "PhotoChoice",
    "Scene",
    "Session",
    "SparsePoints",
    "StepReason",
    "StepRecord",
    "Trace",
    "Truth",
    "View",
    "face_cells",
    "fair",
    "load_scene",
    "read_mesh",
    "triangulate",
    "write_mesh",
]
