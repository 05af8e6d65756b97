"""Names of the terms of the objective, in the order of legends and tables."""

PHOTOS = "photos"
POINTS = "points"
IMAGE_EDGES = "image edges"
AXES = "axes"
SMOOTHNESS = "smoothness"
START = "start"

TERMS: dict[str, str] = {
    PHOTOS: "differences between the photos of each face, after the robust loss",
    POINTS: "sparse points that lie off their closest face",
    IMAGE_EDGES: "creases of the mesh that lie off their edge in the photos",
    AXES: "edges and faces that nearly follow the axes of a building, but not quite",
    SMOOTHNESS: "vertices that lie off the smoothed mesh",
    START: "vertices that lie off the start; the more, the less the photos agree",
}
"""What adds to the energy of each built-in term."""
