"""Noise experiment: final error against the photos' noise, compared with the Cramer-Rao bound."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar

import numpy as np

from fairing.experiments.experiment import Row
from fairing.experiments.setting import Setting
from fairing.judge.cramer_rao import ROUNDING, cramer_rao_covariance, luma_noise
from fairing.options import VisibilityOptions
from fairing.photo import ArrayPhoto
from fairing.scene import View

START_PERCENT = 5.0


@dataclass(frozen=True)
class NoiseAgainstBound:
    """Runs on photos with increasing noise."""

    name: ClassVar[str] = "noise"
    title: ClassVar[str] = "Accuracy against noise"
    question: ClassVar[str] = "How much accuracy does noise in the photos cost, compared with the theoretical minimum?"
    columns: ClassVar[dict[str, str]] = {
        "noise": "standard deviation of the noise added to each channel, grey levels",
        "draw": "index of the random draw",
        "noise_in_all": "standard deviation of noise and rounding to 8 bits together, grey levels",
        "end_percent": "final error, % of the edge",
        "bound_percent": "Cramer-Rao bound of the rms error with unknown texture, % of the edge",
        "steps": "steps of the run",
    }

    noises: tuple[float, ...] = (0.0, 1.0, 2.0, 4.0, 8.0)
    """Standard deviations of the noise added to each channel of the photos, grey levels."""
    draws: int = 6
    """Number of random draws for each noise level."""

    def cases(self, setting: Setting) -> list[Row]:
        # At zero noise all draws are equal.
        return [{"noise": s, "draw": d} for d in range(self.draws) for s in self.noises if s > 0 or d == 0]

    def measure(self, setting: Setting, case: Row) -> Row:
        """The columns, and `error`: the final error as a vector, to separate bias from spread."""
        start = setting.displaced(START_PERCENT, setting.directions(3)[0])
        noisy = replace(start, views=noisy_views(start.views, case["noise"], case["draw"]))
        session = setting.session(noisy)
        session.run()
        return {
            "noise_in_all": float(np.sqrt(case["noise"] ** 2 + ROUNDING)),
            "end_percent": setting.distance(session.vertices),
            "bound_percent": luma_noise(case["noise"]) * bound_percent(setting),
            "steps": len(session.trace),
            "error": setting.error(session.vertices).tolist(),
        }

    def finding(self, rows: Sequence[Row]) -> str:
        if not rows:
            return ""
        noise = max(row["noise"] for row in rows)
        here = [row for row in rows if row["noise"] == noise]
        rms, bound = rms_of(here), here[0]["bound_percent"]
        spread = spread_of(here)
        precision = "" if spread is None else f" The spread about the mean is {spread / bound:.1f} times the bound."
        return (
            f"With noise of {noise:g} grey levels the final error is {rms:.2g} % of the edge (rms of {len(here)}), "
            f"{rms / bound:.1f} times the bound of {bound:.2g} %.{precision}"
        )


def rms_of(rows: Sequence[Row]) -> float:
    """Root mean square of the final errors, percent of the edge."""
    return float(np.sqrt(np.mean([row["end_percent"] ** 2 for row in rows])))


def spread_of(rows: Sequence[Row]) -> float | None:
    """Root mean square distance of the final positions from their mean, percent of the edge; None for a single draw."""
    if len(rows) < 2:
        return None
    return float(np.sqrt(np.var([row["error"] for row in rows], axis=0, ddof=1).sum()))


def noisy_views(views: tuple[View, ...], noise: float, seed: int) -> tuple[View, ...]:
    """The views with Gaussian noise in their photos (standard deviation in grey levels, per channel), rounded to 8 bits."""
    rng = np.random.default_rng(seed)
    noisy = []
    for view in views:
        pixels = view.photo.load()
        changed = np.rint(pixels + noise * rng.standard_normal(pixels.shape))
        noisy.append(replace(view, photo=ArrayPhoto(np.clip(changed, 0, 255).astype(np.uint8))))
    return tuple(noisy)


@lru_cache(maxsize=1)
def bound_percent(setting: Setting) -> float:
    """Cramer-Rao bound of the rms error in the determined directions, % of the edge per grey level of luma noise."""
    covariance = cramer_rao_covariance(setting.scene, setting.vertex, 1.0, _views_of_face(setting))
    along = setting.determined @ covariance @ setting.determined.T
    return 100 / setting.edge * float(np.sqrt(np.trace(along)))


def _views_of_face(setting: Setting) -> dict[int, np.ndarray]:
    """For each face around the vertex the views that see any part of it: a bound for all methods uses all photos."""
    scene = setting.displaced(0.0, np.zeros(3))
    anything = VisibilityOptions(min_angle=0.5, min_footprint=0.1, edge_margin=0.0, min_samples=0.01)
    options = replace(setting.options, visibility=replace(anything, max_views=len(scene.views)))
    context = setting.session(scene, options).sweep_state().context
    return {
        face: context.kernel.pair_view[context.pairs_of(face)] for face in scene.mesh.one_rings[setting.vertex].tolist()
    }
