"""EigenFairing: move the vertices of a mesh until its faces' textures, seen in many photos, agree."""
