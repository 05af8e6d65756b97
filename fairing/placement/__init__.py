"""Placement: whether the mesh lies where the photos see the scene, and in which frame it would.

What belongs here: judges of the mesh as a whole, before a run moves a vertex. Sparse points decide (`sightings`, `judge`);
other axes, units (`frames`) and places (`displacement`) are tried where they contradict the mesh. Where there are no points,
the photos compare frames that the capture's own files name (`photo_agreement`).

May import: the data modules of `fairing` and `fairing.geometry`.

Offers: `judge_placement` and `Placement`; `MeshFrame`; `better_frame_by_photos`.
"""
