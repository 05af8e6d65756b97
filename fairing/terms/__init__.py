"""Terms: what vertices are measured against besides the photos of their faces. One file a term, with its equation.

`points` (sparse points at the faces that their photos see, by `point_rays`), `closest_points`, `image_edges`, `axes` of a
building. Each gives rows or anchors of `fairing.optimize` for given associations. `names` lists the terms of all stages, also
the photos; `point_judge` decides by points that no fit uses.

Imports the data modules of `fairing`, `fairing.optimize`, `fairing.geometry`, `fairing.features` and `fairing.creases`.
"""
