"""Result of the capture check, in numbers and words."""

from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from fairing.cells.visibility import Visibility
from fairing.placement.judge import Placement

# Grey levels / px. Noise of 2 grey levels alone gives 0.8 after the blur; texture below this limit determines no vertex.
BLANK_TEXTURE = 1.2
# A face can slide along a direction in which its rms gradient is below this fraction of the whole.
STRIPED = 0.2
SEEN = (Visibility.SEEN, Visibility.PARTLY_SEEN, Visibility.SURPLUS)


@dataclass(frozen=True)
class ViewCheck:
    """Findings for one photo.

    Attributes:
        name: of the photo.
        width, height: px.
        focal_length: px.
        faces: number of faces that the photo shows well enough.
        mesh_share: fraction of the photo that the mesh covers, 0 to 1.
        in_front: fraction of the mesh's vertices in front of the camera, 0 to 1.
        observations: number of sparse points observed in it.
        reprojection: median reprojection error of its sparse points, px; None without any.
        shift: median of projection minus observation, px: the systematic part of that error; None for fewer than five.
        exposure: brightness relative to the median photo, from faces that several photos show; None if unknown.
        masked: fraction of the photo that its mask excludes, 0 to 1.
        correction: correction of its camera, px (see `CamerasCheck`); None if cameras were not refined.
    """

    name: str
    width: int
    height: int
    focal_length: float
    faces: int
    mesh_share: float
    in_front: float
    observations: int
    reprojection: float | None
    shift: tuple[float, float] | None
    exposure: float | None
    masked: float
    correction: float | None = None


@dataclass(frozen=True)
class CamerasCheck:
    """Findings about the cameras by refinement (`fairing.cameras`).

    Attributes:
        corrected: whether the scene has corrected cameras, because held-out points are clearly better with them.
        line: what was found, as a sentence.
        correction: median over the photos, px; 0 if the cameras are kept as given.
        error_before, error_after: median reprojection error of held-out points, px, with the given and the corrected cameras.
        misfits: names of the photos whose camera does not fit the others, also if it was corrected.
        lens_note: a sentence if the photos look distorted by a lens of which the cameras do not tell; else "".
    """

    corrected: bool
    line: str
    correction: float
    error_before: float
    error_after: float
    misfits: tuple[str, ...]
    lens_note: str


@dataclass(frozen=True, eq=False)
class FaceChecks:
    """Findings for all faces, (m,) each.

    Attributes:
        n_views: int: photos that take part.
        takes_part: bool: whether they are enough.
        footprint: float, px: square root of the mean area in these photos.
        texture: float, grey levels / px: rms gradient (`fairing.check.appearance`); NaN if unseen.
        weakest: float, grey levels / px: rms gradient in the direction of least change.
        reason: for faces that take no part, the most frequent `Visibility` in the photos, in lower case; else "".
    """

    n_views: np.ndarray
    takes_part: np.ndarray
    footprint: np.ndarray
    texture: np.ndarray
    weakest: np.ndarray
    reason: list[str]

    @property
    def is_blank(self) -> np.ndarray:
        """(m,) bool: faces that take part but have no texture."""
        return self.takes_part & (self.texture < BLANK_TEXTURE)

    def without_part(self) -> dict[str, np.ndarray]:
        """Ids (k,) int of the faces that take no part, by reason in words, most frequent reason first."""
        reasons = np.array(self.reason)
        found = {reason: np.flatnonzero(reasons == reason) for reason in sorted(set(self.reason) - {""})}
        return {reason.replace("_", " "): ids for reason, ids in sorted(found.items(), key=lambda item: -len(item[1]))}

    @property
    def is_striped(self) -> np.ndarray:
        """(m,) bool: faces that take part whose grey levels change in one direction only."""
        return self.takes_part & ~self.is_blank & (self.weakest < STRIPED * self.texture)


@dataclass(frozen=True, eq=False)
class SceneCheck:
    """Findings of `check_scene`.

    Attributes:
        verdict: "unusable" if no face takes part or the mesh lies elsewhere than the photos show, "doubtful" if there are
            hints, else "good".
        n_faces: number of faces.
        faces_in_part: number of faces seen by enough photos.
        views_per_face: percentiles 0, 25, 50, 75, 100 over faces.
        footprint: the same percentiles of the square root of a face's mean area in the photos, px.
        texture: the same percentiles of the faces' texture, grey levels / px.
        reasons: number of pairs of face and photo by `Visibility`, in lower case.
        parallax: widest angle between two lines of sight to a face, degrees, median over the faces that take part.
        points: origin of the sparse points, see `SparsePoints`; None without any.
        placement: place of the mesh by the sparse points.
        mistake: likely mistake in the cameras as a whole, or None.
        memory: approximate peak memory of a run, bytes.
        views: findings for each photo.
        faces: findings for the faces.
        visibility: (m, V) int8: `Visibility` of every face in every photo.
        warnings: of the scene.
        hints: problems and their remedies, in order of importance.
        suggestions: options and changes worth trying; they do not affect the verdict.
        cameras: None if they were not refined.
    """

    verdict: Literal["good", "doubtful", "unusable"]
    n_faces: int
    faces_in_part: int
    views_per_face: tuple[float, ...]
    footprint: tuple[float, ...]
    texture: tuple[float, ...]
    reasons: dict[str, int]
    parallax: float | None
    points: Literal["given", "own", "both"] | None
    placement: Placement
    mistake: str | None
    memory: int
    views: tuple[ViewCheck, ...]
    faces: FaceChecks
    visibility: np.ndarray
    warnings: tuple[str, ...]
    hints: tuple[str, ...]
    suggestions: tuple[str, ...]
    cameras: CamerasCheck | None = None

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON. Faces are lists with one entry per face, null where unknown."""
        values = {name: getattr(self, name) for name in self.__dataclass_fields__ if name != "visibility"}
        values["placement"] = self.placement.as_dict()
        values["views"] = [asdict(view) for view in self.views]
        values["cameras"] = None if self.cameras is None else asdict(self.cameras)
        values["faces"] = {
            name: [round(value, 3) if isinstance(value, float) else value for value in np.asarray(column).tolist()]
            for name, column in vars(self.faces).items()
        }
        return values
