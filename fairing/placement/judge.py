"""Judge of a mesh's place: whether the photos of the sparse points confirm the mesh, and in which frame they would."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from fairing.camera import Camera
from fairing.errors import InputError
from fairing.mesh import Mesh
from fairing.placement.displacement import best_translation
from fairing.placement.frames import IDENTITY, MeshFrame, axes_text, scaled_frames, turned_frames
from fairing.placement.sightings import NEAR, Sightings, Support
from fairing.scene import Scene, SparsePoints

LEAST_POINTS = 30
"""Fewer observed points judge nothing."""
LEAST_JUDGED = 20
"""A frame is judged by that many points in whose direction it puts the mesh."""
LEAST_AGAINST = 100
"""Against a mesh that is confirmed where it is, another frame needs that many: few faces may fit better elsewhere by chance.
Among that many points, a mesh that none of them has in its direction lies elsewhere."""
USUALLY_NEAR = 0.75
"""Of the judged points: where fewer confirm the mesh, points that are only near count for another frame."""
LEAST_NEAR, LEAST_NEAR_POINTS = 0.25, 3
"""Of the judged points, and of all: a mesh that fewer confirm lies elsewhere (ledger: place of the mesh)."""
SUSPICIOUS = 0.05
"""Of the judged points: where more have no mesh close by, other frames are tried."""
CERTAINTY = 2.0
"""Standard errors by which the share must exceed that: a few points say little."""
FEW_POINTS, EXAMINED = 200, 3
"""That many points choose the frames of a kind, so many, that all points examine."""
MORE, MISSING = 1.25, 0.3
"""Another frame is better where it is close to that many times as many points and that share of the contradictions is left."""
LEAST_DISPLACEMENT = 0.1
"""Of the diagonal: a mesh that is nearer to its place is a rough start; the fit to the points reaches that far."""


@dataclass(frozen=True, eq=False)
class Placement:
    """The place of a mesh, judged by sparse points.

    Attributes:
        verdict: "confirmed", "elsewhere" or, without enough points, "unknown".
        points: number of points whose photos were compared.
        support: what they say about the mesh where it is.
        better: the frame in which they confirm it, or None.
        better_support: what they say about it there.
    """

    verdict: Literal["confirmed", "elsewhere", "unknown"]
    points: int
    support: Support
    better: MeshFrame | None = None
    better_support: Support | None = None

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        better = None if self.better is None or self.better_support is None else {
            "name": self.better.name, "linear": self.better.linear.tolist(), "shift": self.better.shift.tolist(),
            **self.better_support._asdict(),
        }  # fmt: skip
        return {"verdict": self.verdict, "points": self.points, **self.support._asdict(), "better": better}

    @property
    def line(self) -> str:
        """What was compared, in words."""
        if self.verdict == "unknown":
            return "the place of the mesh was not judged: there are too few sparse points with photos"
        here = f"of {self.points} sparse points examined, {_counted(self.support)}"
        if self.verdict == "confirmed":
            return f"the photos confirm the place of the mesh: {here}"
        if self.better is None or self.better_support is None:
            return (
                f"the mesh lies elsewhere than the photos show: {here}, nor do more in other axes, units or at another "
                "place nearby; bring the mesh into the cameras' world"
            )
        remedy = _remedy(self.better)
        return (
            f"the mesh lies elsewhere than the photos show: {here}; {self.better.name} "
            f"{self.better_support.near} of {self.better_support.judged} would: {remedy}"
        )


def judge_placement(scene: Scene) -> Placement:
    """Judge the place of a scene's mesh by its sparse points."""
    return judge_mesh(scene.mesh, scene.sparse_points, [view.camera for view in scene.views])


def judge_mesh(
    mesh: Mesh, points: SparsePoints | None, cameras: Sequence[Camera], named: Sequence[MeshFrame] = ()
) -> Placement:
    """Judge the place of a mesh by sparse points and their photos.

    Args:
        points: those without observations take no part.
        cameras: of the views that the observations index.
        named: frames of the mesh that the capture's own files name; they are tried first.
    """
    if points is None or not has_judges(points):
        return Placement("unknown", 0, Support(0, 0, 0))
    sightings = Sightings(mesh, points, cameras)
    here = sightings.support()
    if here.judged and not _is_suspicious(here):
        return Placement("confirmed", sightings.count, here)
    few = Sightings(mesh, points, cameras, FEW_POINTS)
    better = _better_frame(sightings, few, here, named)
    is_rough_start = better is not None and _is_small_displacement(better[1], sightings.diagonal)
    if is_rough_start or (better is None and _is_confirmed(here)):
        return Placement("confirmed", sightings.count, here)
    if better is None:
        is_judged = here.judged >= LEAST_JUDGED or sightings.count >= LEAST_AGAINST
        return Placement("elsewhere" if is_judged else "unknown", sightings.count, here)
    support, frame = better
    return Placement("elsewhere", sightings.count, here, frame, support)


def has_judges(points: SparsePoints) -> bool:
    """Whether there are enough observed points to judge a mesh."""
    return len(np.unique(points.observations[:, 0])) >= LEAST_POINTS


def refuse_elsewhere(scene: Scene) -> None:
    """Refuse a mesh that the photos of the sparse points do not confirm.

    Raises:
        InputError: it lies elsewhere; the line says what was compared and what would fit.
    """
    placement = judge_placement(scene)
    if placement.verdict == "elsewhere":
        raise InputError(f"scene {scene.name}: {placement.line}")


def _is_suspicious(support: Support) -> bool:
    """Whether clearly more points than usual have no mesh close by."""
    share = SUSPICIOUS * support.judged
    return support.judged - support.close > share + CERTAINTY * np.sqrt(share * (1 - SUSPICIOUS))


def _better_frame(
    sightings: Sightings, few: Sightings, here: Support, named: Sequence[MeshFrame]
) -> tuple[Support, MeshFrame] | None:
    """The frame that the points clearly prefer to the given one, and what they say about it; or None.

    The first kind of frame that leaves hardly a contradiction decides; else the frame with the most confirmed points.

    Args:
        few: sightings of few points, which choose the frames of a kind that all points examine.
    """
    turned = turned_frames()
    about_middle = [
        MeshFrame(f"turned about its middle,{frame.name.removeprefix('with its')}", frame.linear, shift)
        for frame in turned
        for shift in [sightings.middle - frame.linear @ sightings.middle]
    ]
    best: tuple[Support, MeshFrame] | None = None
    for frames in (list(named), turned, scaled_frames([IDENTITY]), about_middle, scaled_frames(turned), None):
        tried = [best_translation(sightings)] if frames is None else frames
        examined = sorted(tried, key=lambda frame: -few.support(frame).near)[:EXAMINED]
        found = [(sightings.support(frame), frame) for frame in examined]
        found = [item for item in found if _is_better(item[0], here)]
        if not found:
            continue
        support, frame = max(found, key=lambda item: item[0].close)
        # Of two kinds that fit alike, the earlier is the more usual mistake.
        if best is None or support.close > MORE * best[0].close:
            best = support, frame
        if best[0].missing <= SUSPICIOUS:
            break
    return best


def _is_small_displacement(frame: MeshFrame, diagonal: float) -> bool:
    is_turned = not np.array_equal(frame.linear, np.eye(3))
    return not is_turned and float(np.linalg.norm(frame.shift)) < LEAST_DISPLACEMENT * diagonal


def _is_better(other: Support, here: Support) -> bool:
    """Whether the points clearly prefer the other of two frames, at the smaller tolerance, or at the larger if few confirm here."""
    if other.judged < LEAST_JUDGED or (_is_confirmed(here) and min(here.judged, other.judged) < LEAST_AGAINST):
        return False
    pairs = [(other.close, here.close)]
    if here.near <= USUALLY_NEAR * here.judged:
        pairs.append((other.near, here.near))
    return any(
        there >= MORE * max(now, 1) and 1 - there / other.judged <= MISSING * (1 - now / max(here.judged, 1))
        for there, now in pairs
    )


def _is_confirmed(support: Support) -> bool:
    """Whether enough of the judged points have the mesh at their place."""
    return support.near >= max(LEAST_NEAR * support.judged, LEAST_NEAR_POINTS)


def _counted(support: Support) -> str:
    if support.judged == 0:
        return "none has the mesh in the direction in which its photos see it"
    return (
        f"{support.judged} have the mesh in the direction in which their photos see them, and of these "
        f"{support.near} at their place (within {100 * NEAR:.0f} % of its diagonal)"
    )


def _remedy(frame: MeshFrame) -> str:
    scale = frame.scale
    linear = np.round(frame.linear / scale)
    is_turned = np.abs(linear - frame.linear / scale).max() < 1e-9 and not (linear == np.eye(3)).all()
    if frame.is_mirrored:
        return "flip that axis in the program that made the mesh"
    flags = [f"--mesh-axes={axes_text(linear)}"] if is_turned else []
    flags += [f"--mesh-scale={scale:.6g}"] if abs(scale - 1) > 1e-9 else []
    if not flags or frame.shift.any():
        return "move it there in the program that made the mesh"
    return f"use {' '.join(flags)}"
