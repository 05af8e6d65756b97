"""EigenFairing: 3D model fairing using image coherence (Mishra, Amidi, Kanade, BMVC 2004).

```python
from fairing import fair, load_scene

session = fair(load_scene("my/capture", mesh="start.ply"))
positions = session.scene.unweld(session.vertices)
```
"""

from typing import TYPE_CHECKING

from fairing.util.on_demand import on_demand

if TYPE_CHECKING:
    from fairing.api import fair
    from fairing.camera import Camera
    from fairing.errors import InputError
    from fairing.io import PhotoChoice, load_scene, read_mesh, write_mesh
    from fairing.judge.inspect import FaceCells, face_cells
    from fairing.mesh import Mesh
    from fairing.options import PRESETS, FairingOptions
    from fairing.photo import ArrayPhoto, FilePhoto
    from fairing.run.session import Session
    from fairing.scene import Scene, SparsePoints, Truth, View
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

__getattr__ = on_demand(
    __name__,
    {
        "PRESETS": "fairing.options",
        "ArrayPhoto": "fairing.photo",
        "Camera": "fairing.camera",
        "FaceCells": "fairing.judge.inspect",
        "FairingOptions": "fairing.options",
        "FilePhoto": "fairing.photo",
        "FlipTrace": "fairing.triangulation",
        "InputError": "fairing.errors",
        "Mesh": "fairing.mesh",
        "PhotoChoice": "fairing.io",
        "Scene": "fairing.scene",
        "Session": "fairing.run.session",
        "SparsePoints": "fairing.scene",
        "StepReason": "fairing.trace",
        "StepRecord": "fairing.trace",
        "Trace": "fairing.trace",
        "Truth": "fairing.scene",
        "View": "fairing.scene",
        "face_cells": "fairing.judge.inspect",
        "fair": "fairing.api",
        "load_scene": "fairing.io",
        "read_mesh": "fairing.io",
        "triangulate": "fairing.triangulation",
        "write_mesh": "fairing.io",
    },
)
