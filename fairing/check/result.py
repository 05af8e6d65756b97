"""What `fairing.check.scene_check` finds, in numbers and words."""

from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from fairing.cells.visibility import Visibility

# Grey levels a pixel. Noise of 2 grey levels alone gives 0.8 after the blur; what falls below this holds no vertex.
BLANK_TEXTURE = 1.2
# A face whose gradients all but vanish along one direction can slide along it.
STRIPED = 0.2
SEEN = (Visibility.SEEN, Visibility.PARTLY_SEEN, Visibility.SURPLUS)


@dataclass(frozen=True)
class ViewCheck:
    """One photo.

    Attributes:
        focal_length: px.
        faces: faces that take part in it.
        mesh_share: part of the photo that the mesh covers, 0 to 1.
        in_front: part of the mesh's vertices in front of the camera, 0 to 1.
        reprojection: median distance of sparse points to where the photo saw them, px; None without any.
        shift: median of the same as a vector, px: what is systematic in it.
        exposure: how bright the photo is beside the median photo, judged by the faces both see; None if unknown.
        masked: part of the photo that its mask leaves out, 0 to 1.
    """

    name: str
    width: int
    height: int
    focal_length: float
    faces: int
    mesh_share: float
    in_front: float
    reprojection: float | None
    shift: tuple[float, float] | None
    exposure: float | None
    masked: float


@dataclass(frozen=True, eq=False)
class FaceChecks:
    """All faces, (m,) each.

    Attributes:
        n_views: photos a face takes part in.
        takes_part: whether they are enough.
        footprint: square root of its mean area in them, px.
        texture: rms gradient of the photos there, grey levels a pixel (`fairing.check.appearance`); NaN where it is not seen.
        weakest: the same in the direction of least.
        reason: for faces that take no part, what most of the photos say, as in `Visibility`, in lower case.
    """

    n_views: np.ndarray
    takes_part: np.ndarray
    footprint: np.ndarray
    texture: np.ndarray
    weakest: np.ndarray
    reason: list[str]

    @property
    def is_blank(self) -> np.ndarray:
        """(m,) bool: faces in part that show no texture."""
        return self.takes_part & (self.texture < BLANK_TEXTURE)

    def without_part(self) -> dict[str, np.ndarray]:
        """Ids (k,) of the faces that take no part, by reason in words, most first."""
        reasons = np.array(self.reason)
        found = {reason: np.flatnonzero(reasons == reason) for reason in sorted(set(self.reason) - {""})}
        return {reason.replace("_", " "): ids for reason, ids in sorted(found.items(), key=lambda item: -len(item[1]))}

    @property
    def is_striped(self) -> np.ndarray:
        """(m,) bool: faces in part whose texture runs in one direction only."""
        return self.takes_part & ~self.is_blank & (self.weakest < STRIPED * self.texture)


@dataclass(frozen=True, eq=False)
class SceneCheck:
    """What `check_scene` found.

    Attributes:
        faces_in_part: faces seen by enough photos, of `n_faces`.
        views_per_face: percentiles 0, 25, 50, 75, 100 over faces.
        footprint: the same percentiles of the square root of a face's mean area in the photos, px.
        texture: the same of the faces' texture, grey levels a pixel.
        reasons: why faces take no part, as counts over all pairs of face and photo.
        parallax: median over the faces in part of the widest angle between two of their lines of sight, degrees.
        mistake: what is likely wrong with the cameras as a whole, or None.
        memory: bytes that a run takes at most, about.
        warnings: of the scene.
        hints: what speaks against the scene and what to do, in order of importance.
        suggestions: options and changes worth trying; they speak against nothing.
    """

    verdict: Literal["good", "doubtful", "unusable"]
    n_faces: int
    faces_in_part: int
    views_per_face: tuple[float, ...]
    footprint: tuple[float, ...]
    texture: tuple[float, ...]
    reasons: dict[str, int]
    parallax: float | None
    mistake: str | None
    memory: int
    views: tuple[ViewCheck, ...]
    faces: FaceChecks
    visibility: np.ndarray
    warnings: tuple[str, ...]
    hints: tuple[str, ...]
    suggestions: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """For JSON. Faces are lists of numbers, one a face, null where a number is unknown."""
        values = {name: getattr(self, name) for name in self.__dataclass_fields__ if name != "visibility"}
        values["views"] = [asdict(view) for view in self.views]
        values["faces"] = {
            name: [round(value, 3) if isinstance(value, float) else value for value in np.asarray(column).tolist()]
            for name, column in vars(self.faces).items()
        }
        return values
