"""Colouring of a mesh by a quantity: texture coordinates into a colour scale, and the legend.

Faces read their colours from a small texture of the scale, so that values rather than colours are interpolated between
vertices. Viser's tone mapping makes the mesh slightly brighter than the legend (ledger: surface colours).
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from enum import Enum

import cv2
import numpy as np

from app.debugger.moment_pulls import MomentPulls, moment_pulls
from app.palette import HAND, LOCKED, NOW, REFERENCE, REJECTED, RGB, SELECTED, START, TRUTH
from app.pictures.term_colors import colors_of_terms
from fairing.judge import quantities
from fairing.judge.face_residuals import FaceResiduals, face_residuals
from fairing.run.session import Session
from fairing.scene import Scene
from fairing.terms.names import PHOTOS, TERMS
from fairing.trace import StepReason

SHADES = 256
UNKNOWN: RGB = (88, 58, 52)  # brown, unlike any colour of the scale, also in colour-blind vision
ROBUST_RANGE = (2.0, 98.0)  # percentiles at the ends of the scale: a few extreme values do not use up the colours
DECADES = 4  # maximal range of a logarithmic scale

REASON_COLORS: dict[StepReason, tuple[str, RGB]] = {
    StepReason.ACCEPTED: ("accepted", START),
    StepReason.CONVERGED: ("converged", TRUTH),
    StepReason.REJECTED_ENERGY: ("rejected: energy", REJECTED),
    StepReason.REJECTED_FOLD: ("rejected: fold", NOW),
    StepReason.RESTING: ("resting after rejections", (230, 159, 0)),
    StepReason.FOUND_PLACE: ("moved by local search", (0, 114, 178)),
    StepReason.FOUND_TOGETHER: ("moved by restart", (86, 180, 233)),
    StepReason.NO_BETTER_PLACE: ("search found no better position", REFERENCE),
    StepReason.RETURNED: ("returned: earlier position better", (240, 228, 66)),
    StepReason.UNSEEN: ("seen by fewer than 3 photos", (60, 60, 60)),
    StepReason.LOCKED: ("locked", LOCKED),
    StepReason.MOVED_MANUALLY: ("moved manually", SELECTED),
    StepReason.RESET_MANUALLY: ("reset manually", (150, 120, 20)),
    StepReason.SMOOTHED: ("smoothed", (170, 210, 170)),
    StepReason.FITTED_TO_POINTS: ("fitted to sparse points", (110, 180, 200)),
    StepReason.FITTED_AGAIN: ("fitted to sparse points again", (60, 130, 160)),
    StepReason.REJECTED_FIT: ("smoothing or fit rejected by photos", (140, 140, 150)),
    StepReason.READ_FROM_FILE: ("read from a file", HAND),
}


class Scale(Enum):
    """How values map to colours: linearly, logarithmically, as whole numbers, by category (step reason, term), or vectors by
    their direction and length."""

    LINEAR = "linear"
    VECTOR = "vector"
    LOGARITHMIC = "logarithmic"
    COUNT = "count"
    CATEGORY = "category"


@dataclass(frozen=True)
class Coloring:
    """A quantity and how it is shown.

    Attributes:
        label: text of its button.
        title: title of the legend.
        unit: of the legend's numbers; may be empty.
        by_face: one value per face instead of per vertex.
        values: returns the values (m,) or (n,) from a session at a moment; NaN where unknown.
        unknown: why values are unknown; may be empty.
        of_photo: returns the values (m,) in one photo (its index), or over all photos (None); None: not known by photo.
        of_pulls: returns the values (n,) from the pulls at a moment and the term chosen by the page.
        categories: returns value, name and colour of each from the names of the run's terms, for `Scale.CATEGORY`.
    """

    label: str
    title: str
    unit: str
    by_face: bool
    scale: Scale
    values: Callable[[Session, int], np.ndarray]
    unknown: str = ""
    of_photo: Callable[[FaceResiduals, int | None], np.ndarray] | None = None
    of_pulls: Callable[[MomentPulls, str], np.ndarray] | None = None
    categories: Callable[[Iterable[str]], Sequence[tuple[int, str, RGB]]] = lambda terms: ()


# Of vectors to the right, and clockwise every 60 degrees; shorter ones are mixed with the colour of zero.
HUES: tuple[RGB, ...] = ((230, 60, 60), (225, 200, 40), (60, 180, 75), (50, 190, 200), (70, 90, 220), (210, 70, 200))
ZERO: RGB = (242, 244, 247)
DIFFERENCE, STRONGEST, PULL = "difference", "strongest", "pull"


def _reasons(_: Iterable[str]) -> list[tuple[int, str, RGB]]:
    return [(int(reason), name, color) for reason, (name, color) in REASON_COLORS.items()]


def _terms(names: Iterable[str]) -> list[tuple[int, str, RGB]]:
    return [(k, name, color) for k, (name, color) in enumerate(colors_of_terms(names).items())]


def _no_reference(session: Session, moment: int) -> np.ndarray:
    """Distances without a reference: all unknown. The page computes the distances to its reference A itself."""
    return np.full(len(session.scene.mesh.vertices), np.nan)


def _mean_residual(session: Session, moment: int) -> np.ndarray:
    return face_residuals(session, moment, with_flow=False).mean_residual()


def _mean_flow(session: Session, moment: int) -> np.ndarray:
    return face_residuals(session, moment).mean_flow_px()


def _photo_pull(session: Session, moment: int) -> np.ndarray:
    return moment_pulls(session, moment).px_of(PHOTOS)


def _strongest_pull(session: Session, moment: int) -> np.ndarray:
    return moment_pulls(session, moment).strongest()


FEW_PHOTOS = "too few photos"
NO_STEP = "no step yet"

COLORINGS: dict[str, Coloring] = {
    "energy": Coloring(
        "Energy", "Energy of each face", "", True, Scale.LINEAR, quantities.face_energy, unknown=FEW_PHOTOS
    ),
    "residual": Coloring(
        *("Residual", "Mean absolute residual, grey levels", "", True, Scale.LINEAR, _mean_residual),
        unknown=FEW_PHOTOS, of_photo=FaceResiduals.mean_residual,
    ),
    "flow": Coloring(
        *("Image flow", "Image flow of each face", "px", True, Scale.LINEAR, _mean_flow),
        unknown="little texture or too few photos", of_photo=FaceResiduals.mean_flow_px,
    ),
    "moved": Coloring("Displacement", "Distance from the start", "%", False, Scale.LINEAR, quantities.displacement),
    "distance": Coloring("Error", "Distance to the truth", "%", False, Scale.LINEAR, quantities.distance_to_truth),
    DIFFERENCE: Coloring("Distance to A", "Distance to A", "%", False, Scale.LINEAR, _no_reference, unknown="no A"),
    "photos": Coloring("Photo count", "Photos that see each face", "", True, Scale.COUNT, quantities.view_count),
    "determined": Coloring(
        *("Certainty", "Weakest / strongest eigenvalue", "", False, Scale.LOGARITHMIC, quantities.determinacy),
        unknown=NO_STEP,
    ),
    "reason": Coloring(
        "Last step", "Last step of each vertex", "", False, Scale.CATEGORY, quantities.last_reason, unknown=NO_STEP,
        categories=_reasons,
    ),
    STRONGEST: Coloring(
        *("Strongest pull", "Term with the longest part of the next step", "", False, Scale.CATEGORY, _strongest_pull),
        unknown="no step", of_pulls=lambda found, _: found.strongest(), categories=_terms,
    ),
    PULL: Coloring(
        *("One pull", "Part of a term in the next step", "px", False, Scale.LINEAR, _photo_pull), of_pulls=MomentPulls.px_of
    ),
}  # fmt: skip


PER_PIXEL: dict[str, Coloring] = {
    "residual": replace(COLORINGS["residual"], title="Residual per pixel, grey levels"),
    "flow": replace(COLORINGS["flow"], title="Flow per pixel, px", scale=Scale.VECTOR),
}
"""How the values of `fairing.judge.texel_residuals` and `fairing.judge.texel_flow` are shown, by the name of the colouring."""


def available_colorings(scene: Scene) -> list[str]:
    """Names of the quantities for which the scene has data."""
    return [name for name in COLORINGS if name != "distance" or scene.truth is not None]


@dataclass(frozen=True, eq=False)
class Legend:
    """Meaning of the colours of a mesh.

    Attributes:
        low, high: values at the ends of the scale; equal if there is only one value.
        smallest, largest: extremes of all values; they may lie beyond the ends of the scale.
        unknown: number of faces or vertices without a value.
        left_out: share of the samples of the other faces that no photo shows, or only near an outline, 0 to 1; of colours by pixel.
        why_unknown: the reason, in place of that of the colouring; may be empty.
        categories: name, colour and count of each category, for `Scale.CATEGORY`.
        moment: the moment of the values, where it is not the present one.
        note: the photos or the term that the values come from, and what the arrows show; may be empty.
        awaited: title of another quantity that was chosen and is being computed; empty: none.
    """

    coloring: Coloring
    low: float = 0.0
    high: float = 0.0
    smallest: float = 0.0
    largest: float = 0.0
    unknown: int = 0
    left_out: float = 0.0
    categories: tuple[tuple[str, RGB, int], ...] = ()
    moment: int | None = None
    note: str = ""
    why_unknown: str = ""
    awaited: str = ""


@dataclass(frozen=True, eq=False)
class ColoredMesh:
    """A mesh of separate triangles, textured with the colour scale.

    Attributes:
        vertices: (c, 3) float, in the unit of the input vertices.
        faces: (t, 3) int.
        uv: (c, 2) float: texture coordinates, 0 to 1.
        picture: the texture, a PNG file.
    """

    vertices: np.ndarray
    faces: np.ndarray
    uv: np.ndarray
    picture: bytes
    legend: Legend


def color_mesh(
    coloring: Coloring, values: np.ndarray, vertices: np.ndarray, faces: np.ndarray, terms: Iterable[str] = TERMS
) -> ColoredMesh:
    """Colour a mesh by a quantity.

    Args:
        values: (m,) or (n,) float, per face or per vertex, NaN where unknown.
        vertices: (n, 3) float, any unit.
        faces: (m, 3) int.
        terms: names of the run's terms, in their order.
    """
    if coloring.scale is Scale.CATEGORY:
        corners, owner = _around_each_vertex(vertices, faces)
        categories = coloring.categories(terms)
        at, legend = _by_category(coloring, categories, values)
        colors = np.array([color for _, _, color in categories], dtype=np.uint8)
        corner_at = at[owner]
    else:
        corners = vertices[faces].reshape(-1, 3)
        at, legend = by_value(coloring, values)
        colors = color_map()
        corner_at = np.repeat(at, 3) if coloring.by_face else at[faces.ravel()]
    known = ~np.isnan(corner_at)
    # Texel centres are exact: the centres of the first and the last texel are the ends of the scale.
    u = (np.nan_to_num(corner_at) * (len(colors) - 1) + 0.5) / len(colors)
    uv = np.stack([u, np.where(known, 0.25, 0.75)], axis=1)
    return ColoredMesh(corners, np.arange(len(corners)).reshape(-1, 3), uv, _picture(colors), legend)


def color_map() -> np.ndarray:
    """(256, 3) uint8 RGB: cividis, from dark blue (low) to yellow (high); suitable for colour-blind readers."""
    ramp = np.arange(SHADES, dtype=np.uint8)[:, None]
    return cv2.applyColorMap(ramp, cv2.COLORMAP_CIVIDIS)[:, 0, ::-1]


def wheel_colors(at: np.ndarray) -> np.ndarray:
    """(p, 3) uint8 RGB: colours of vectors (p, 2) of a length of at most 1: hues by direction, mixed with `ZERO` by length."""
    length = np.hypot(at[:, 0], at[:, 1])[:, None]
    turn = np.arctan2(at[:, 1], at[:, 0]) * len(HUES) / (2 * np.pi)
    hue = np.stack(
        [np.interp(turn, np.arange(len(HUES)), part, period=len(HUES)) for part in zip(*HUES, strict=True)], axis=1
    )
    return np.round(np.array(ZERO) + length * (hue - ZERO)).astype(np.uint8)


def by_value(coloring: Coloring, values: np.ndarray, beside: np.ndarray | None = None) -> tuple[np.ndarray, Legend]:
    """Position of each value on the scale, 0 to 1, NaN where unknown; and the legend.

    Args:
        beside: further values, shown beside these. The scale covers the range of either, however many they are.
    """
    shown = [each[np.isfinite(each)] for each in (values, beside) if each is not None and np.isfinite(each).any()]
    if not shown:
        return np.full(len(values), np.nan), Legend(coloring, unknown=len(values))
    smallest, largest = min(float(each.min()) for each in shown), max(float(each.max()) for each in shown)
    low, high = smallest, largest
    if coloring.scale is not Scale.COUNT:
        ranges = np.array([np.percentile(each, ROBUST_RANGE) for each in shown])
        low, high = float(ranges[:, 0].min()), float(ranges[:, 1].max())
    scaled, ends = values.astype(float), (low, high)
    if coloring.scale in (Scale.LINEAR, Scale.VECTOR):
        ends = (low, high) = (0.0, high)
    elif coloring.scale is Scale.LOGARITHMIC:
        low = max(low, high * 10.0**-DECADES)
        with np.errstate(divide="ignore"):
            scaled, ends = np.log(np.maximum(scaled, 0)), (np.log(max(low, 1e-300)), np.log(max(high, 1e-300)))
    span = ends[1] - ends[0]
    at = np.clip((scaled - ends[0]) / span, 0, 1) if span > 0 else np.where(np.isnan(scaled), np.nan, 0.0)
    return at, Legend(coloring, low, high, smallest, largest, int(np.isnan(values).sum()))


def by_vector(coloring: Coloring, values: np.ndarray, beside: np.ndarray | None = None) -> tuple[np.ndarray, Legend]:
    """Vectors (m, 2) as they are shown, of a length of at most 1, NaN where unknown; and the legend, of their lengths.

    Args:
        beside: further vectors, as in `by_value`.
    """
    length, other = (None if each is None else np.hypot(each[:, 0], each[:, 1]) for each in (values, beside))
    assert length is not None
    at, legend = by_value(coloring, length, other)
    return values * (at / np.where(length > 0, length, 1))[:, None], legend


def _by_category(
    coloring: Coloring, known: Sequence[tuple[int, str, RGB]], values: np.ndarray
) -> tuple[np.ndarray, Legend]:
    """Position of each category in the texture, 0 to 1, NaN where unknown; and the legend."""
    at = np.full(len(values), np.nan)
    categories = []
    for k, (value, name, color) in enumerate(known):
        chosen = values == value
        at[chosen] = k / (len(known) - 1)
        if chosen.any():
            categories.append((name, color, int(chosen.sum())))
    return at, Legend(coloring, unknown=int(np.isnan(values).sum()), categories=tuple(categories))


def _around_each_vertex(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners (18 m, 3) of six triangles per face, and for each corner the vertex nearest to its triangle (18 m,)."""
    points = vertices[faces]
    middle = points.mean(axis=1)
    pieces, owner = [], []
    for k in range(3):
        here, ahead, behind = points[:, k], points[:, (k + 1) % 3], points[:, (k + 2) % 3]
        to_next, from_last = (here + ahead) / 2, (behind + here) / 2
        pieces += [np.stack([here, to_next, middle], axis=1), np.stack([here, middle, from_last], axis=1)]
        owner += [faces[:, k], faces[:, k]]
    return np.concatenate(pieces).reshape(-1, 3), np.repeat(np.concatenate(owner), 3)


def _picture(colors: np.ndarray) -> bytes:
    """A PNG file of two rows: the colours, and the colour for unknown values."""
    below = np.tile(np.array(UNKNOWN, dtype=np.uint8), (len(colors), 1))
    ok, encoded = cv2.imencode(".png", np.stack([colors, below])[..., ::-1])
    assert ok
    return encoded.tobytes()
