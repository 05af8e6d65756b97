"""Terms of the geometric stages: what vertices are measured against besides photos. One file a term, with its equation.

`points` (sparse points at the faces that their photos see, by `point_rays`), `closest_points`, `axes` of a building; `point_judge`
decides by points that no fit uses. Each gives rows or anchors of `fairing.optimize` for given associations. `names` lists the
terms of all stages, also those by photos.

Imports the data modules of `fairing`, `fairing.optimize`, `fairing.geometry` and `fairing.features`.
"""
