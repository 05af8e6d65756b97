"""Cells: the samples of each face in each photo that the engine compares.

What belongs here: which photo shows which face (`visibility`, `depth_map`, `sample_masks`), how finely each face is sampled
(`layout`), which photo pixels the samples read (`scale_space`, `point_spread`, `pair_photos`), the choice of the first level
by the faces' size (`level_choice`), and `context`, which combines them.

May import: the data modules of `fairing`, `fairing.util`, `fairing.geometry`, `fairing.kernels` and `fairing.norms`.

Offers: `build_context` and `CellContext`, the fixed data of one level; `ScaleSpace`, the blurred photos; `Visibility`, the
reason why a photo shows a face or does not; `footprints` and `mesh_orientation`; `DepthMap`; `first_level`.
"""
