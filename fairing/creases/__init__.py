"""Creases: edges of the mesh between faces of different directions, and where the photos show them.

Where faces lie on the right planes, vertices can still slide within them: the texture of a face hardly changes, and samples
near its border are left out. What shows the sliding is where the crease between two faces appears in the photos (model-based
edge tracking: Harris and Stennett 1990, Lowe 1991).

What belongs here: `edges` finds the creases of a mesh, `offsets` measures their distances to image edges in a photo;
`fairing.terms.image_edges` draws the creases there. The modules import the shared data of `fairing` and `fairing.geometry`.
"""
