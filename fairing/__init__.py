"""EigenFairing: 3D model fairing using image coherence (Mishra, Amidi, Kanade, BMVC 2004).

```python
from fairing import fair, load_scene

session = fair(load_scene("my/capture", mesh="start.ply"))
positions = session.scene.unweld(session.vertices)
```

Run: `load_scene` reads a capture or opens a demo scene, `fair` runs to the end, `Session` runs step by step,
`FairingOptions` with its `LevelOptions` and `PRESETS` control it, `triangulate` makes a start mesh, `face_cells` (`FaceCells`)
shows what a run compares, `texel_residuals` (`TexelResiduals`) where in the faces the photos disagree. `session_of_meshes`
shows the meshes of another program as a run, and `compare_meshes` (`MeshFigures`) judges meshes of any origin by the same photos.
`rasterize` finds the face that each pixel of a photo shows.

Scenes: `Scene`, `View`, `Camera`, `Mesh`, `SparsePoints`, `Truth`, and photos in memory or in files, `ArrayPhoto` and
`FilePhoto`, with a `Mask` each.

Files: `read_mesh`, `write_mesh`, and `PhotoChoice`, the part of a capture's photos that is used.

Records: `Trace` of `StepRecord`s, each with its `StepReason`; `FlipTrace`, the record of `triangulate`.

Terms: of one's own, `OwnTerm` and its `Residuals`, with the losses `Huber` and `GemanMcClure`; pass them to `fair` or `Session`,
like a `Norm` of one's own for the residuals of photos, and a plan of `PlanStage`s.

Errors: `InputError`, one line about what cannot be used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
