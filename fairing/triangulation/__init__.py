"""Image-consistent triangulation (Morris and Kanade, CVPR 2000): from sparse points to a start mesh.

What belongs here: the points that become vertices (`object_box`, `points_in_box`), the initial mesh (`points`, `tetrahedra`,
`sight_lines`, `minimum_cut`, `cut_surface`, `seen_surface`, joined in `initial_mesh`), face splits (`subdivision`,
`face_splits`), edge flips (`quads`, `inconsistency`, `flips`), the record of the initial mesh, the splits and the flips
(`carving`, `carving_file`, `split_record`, `record`), and the whole (`run`, `options`).

May import: the data modules of `fairing`, `fairing.util`, `fairing.geometry`, `fairing.cells`, `fairing.solve`, and for face
splits `fairing.features`, `fairing.optimize` and `fairing.terms`.

Offers: the names in `__all__`, imported on first use; `triangulate` is the entry point.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
