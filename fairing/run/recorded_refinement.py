"""The refinement of cameras that a trace's header records, for display."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from fairing.camera import Camera
from fairing.run.trace_header import REFINEMENT
from fairing.scene import Scene


@dataclass(frozen=True, eq=False)
class RecordedRefinement:
    """Corrected cameras and how they were found.

    Attributes:
        reason: why the corrected cameras are used, as a sentence.
        given: the given cameras, one a photo.
        corrections: (v,) float, px, see `Refinement.corrections`.
        turns, shifts: (k, v, 3) float, radians and world units: the iterations, see `fairing.cameras.refinement.Iteration`.
        errors: (k, v) float, px: median reprojection error of each photo in each iteration; the first is with the given cameras.
    """

    reason: str
    given: tuple[Camera, ...]
    corrections: np.ndarray
    turns: np.ndarray
    shifts: np.ndarray
    errors: np.ndarray

    @classmethod
    def of(cls, scene: Scene, header: dict[str, Any]) -> "RecordedRefinement | None":
        """Of a run's scene and header; None if its cameras are the given ones, or the header does not tell how they were found."""
        facts, given = header.get(REFINEMENT), scene.given_cameras
        if given is None or not isinstance(facts, dict):
            return None
        try:
            states = facts["iterations"]
            corrections = np.array([photo["correction_px"] for photo in facts["photos"]], dtype=float)
            turns, shifts, errors = (
                np.array([s[name] for s in states], dtype=float) for name in ("turns", "shifts", "errors")
            )
        except (KeyError, TypeError, ValueError):
            return None
        n, v = len(states), len(given)
        shapes = [array.shape for array in (turns, shifts, errors, corrections)]
        if not all(np.isfinite(array).all() for array in (turns, shifts, errors, corrections)):
            return None
        if n == 0 or shapes != [(n, v, 3), (n, v, 3), (n, v), (v,)]:
            return None
        return cls(str(facts.get("reason", "")), given, corrections, turns, shifts, errors)

    def __len__(self) -> int:
        return len(self.errors)

    def cameras_at(self, iteration: int, magnification: float = 1.0) -> list[Camera]:
        """The cameras of an iteration, their displacement from those of the last one magnified."""
        last = Rotation.from_rotvec(self.turns[-1])
        turned = Rotation.from_rotvec(self.turns[iteration]) * last.inv()
        R = (Rotation.from_rotvec(magnification * turned.as_rotvec()) * last).as_matrix()
        shifts = self.shifts[-1] + magnification * (self.shifts[iteration] - self.shifts[-1])
        return [
            Camera.from_krt(
                camera.K, R[v] @ camera.camera_from_world[:, :3],
                -R[v] @ camera.camera_from_world[:, :3] @ (camera.center + shifts[v]), camera.width, camera.height,
            )
            for v, camera in enumerate(self.given)
        ]  # fmt: skip
