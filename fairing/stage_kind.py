"""Kinds of stages: what the steps of a run minimise, or do, in the order in which a run meets them."""

from enum import IntEnum


class StageKind(IntEnum):
    """A stage is a part of a run whose steps have the same terms; a recorded step knows the kind of its stage."""

    PHOTOS = 0
    SMOOTHNESS = 1
    POINTS = 2
    SURFACE_POINTS = 3
    AXES = 4
    CLOSEST_POINTS = 5
    JUDGE = 6
    MANUAL = 7
    FIT = 8
    SNAPSHOT = 9

    @property
    def label(self) -> str:
        """Its name for readers."""
        return _TEXTS[self][0]

    @property
    def text(self) -> str:
        """One sentence about what it does."""
        return _TEXTS[self][1]

    @property
    def is_fit(self) -> bool:
        """Whether its steps use no photos: their energies are not those of the photos."""
        return self in (
            StageKind.SMOOTHNESS,
            StageKind.POINTS,
            StageKind.SURFACE_POINTS,
            StageKind.AXES,
            StageKind.CLOSEST_POINTS,
        )


_TEXTS = {
    StageKind.PHOTOS: ("photos", "Vertices move until the photos of every face agree."),
    StageKind.SMOOTHNESS: ("smoothing", "Noise of the start is filtered out; creases stay."),
    StageKind.POINTS: (
        "points",
        "Sparse points pull the faces that their photos see; each narrower gate leaves out more of the clutter.",
    ),
    StageKind.SURFACE_POINTS: (
        "surface points",
        "Points are sought near the mesh, pixel by pixel, and pull like the sparse points.",
    ),
    StageKind.AXES: ("axes", "Edges and faces that nearly follow the axes of a building come to follow them."),
    StageKind.CLOSEST_POINTS: ("closest points", "Every point pulls the face that lies closest to it."),
    StageKind.JUDGE: ("judge", "What points or photos find worse than before goes back."),
    StageKind.MANUAL: ("by hand", "Vertices were moved by hand."),
    StageKind.FIT: ("fit to points", "The whole fit to the sparse points as one step, as former versions recorded it."),
    StageKind.SNAPSHOT: ("meshes", "Each step is the next mesh that another program made."),
}
