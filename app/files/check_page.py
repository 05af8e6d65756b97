"""The findings of `check` as one self-contained HTML file: no script, no further file, no network."""

from collections.abc import Sequence

import numpy as np

from app.files.document import NEUTRAL, banner, bullets, document, jpeg_uri, tile
from app.html import text
from app.palette import BRAND, NOW, REJECTED, SELECTED, START, css
from app.pictures.check_pictures import HELD_BACK, IN_PART, OUT
from fairing.check.hints import is_off_alone
from fairing.check.result import BLANK_TEXTURE, SceneCheck, ViewCheck
from fairing.placement.judge import Placement
from fairing.scene import Scene

VERDICTS = {
    "good": ("Good", "This input is suitable."),
    "doubtful": ("Doubtful", "A run is possible; see the problems below."),
    "unusable": ("Unusable", "No face is seen by three photos, or the mesh lies elsewhere."),
}
_COLORS = {"good": START, "doubtful": SELECTED, "unusable": NOW}
_BINS = 24
_MOST_IDS = 500


def check_page(scene: Scene, check: SceneCheck, thumbnails: Sequence[np.ndarray], overlays: Sequence[str]) -> str:
    """The page as HTML.

    Args:
        thumbnails: (h, w, 3) uint8 RGB each: the mesh over each photo, reduced.
        overlays: file names of the full-size pictures that the thumbnails link to.
    """
    verdict, meaning = VERDICTS[check.verdict]
    sections = [
        f"<h1>{text(scene.name)}</h1><div class='dim'>{len(scene.views)} photos, {len(scene.mesh.vertices)} vertices, "
        f"{check.n_faces} faces{_points(scene)}</div>",
        banner(verdict, meaning, css(_COLORS[check.verdict])),
        bullets("Problems", check.hints, css(SELECTED)),
        bullets("Suggestions", check.suggestions, css(BRAND)),
        bullets("Notes from loading the scene", check.warnings, NEUTRAL),
        _faces(check),
        _photos(check.views, 0.0 if check.cameras is None else check.cameras.correction),
        _pictures(check, thumbnails, overlays),
    ]
    return document(f"Check of {scene.name}", sections)


def _points(scene: Scene) -> str:
    points = scene.sparse_points
    if points is None:
        return ""
    return f", {len(points.positions)} sparse points" + " found in the photos" * (points.origin == "own")


def _faces(check: SceneCheck) -> str:
    faces = check.faces
    part = faces.takes_part
    without = faces.without_part()
    reasons = ", ".join(f"{len(ids)} {reason}" for reason, ids in without.items())
    share = 100 * check.faces_in_part / check.n_faces
    others = f"; the others: {reasons}" if without else ""
    parallax = "–" if check.parallax is None else f"{check.parallax:.0f}°"
    tiles = [
        tile(f"{check.faces_in_part} of {check.n_faces}", f"faces used ({np.floor(share):.0f} %){others}"),
        tile(str(int(faces.is_blank.sum())), "of them are blank: no texture to align"),
        tile(str(int(faces.is_striped.sum())), "of them are striped: they can slide in one direction"),
        _place(check.placement),
        tile(parallax, "largest angle between lines of sight to a face (median)"),
    ]
    histograms = [
        _histogram("photos per face", faces.n_views, "", whole=True),
        _histogram("size of a face in the photos, px", faces.footprint[part], " px"),
        _histogram("texture of a face, grey levels per pixel", faces.texture[part], "", low=BLANK_TEXTURE),
    ]
    lists = {f"excluded: {reason}": ids for reason, ids in without.items()}
    lists |= {"are blank": np.flatnonzero(faces.is_blank), "are striped": np.flatnonzero(faces.is_striped)}
    details = "".join(_ids(name, ids) for name, ids in lists.items() if len(ids))
    return f"<h2>Faces</h2><div class='tiles'>{''.join(tiles)}</div><div class='tiles wide'>{''.join(histograms)}</div>{details}"


def _place(placement: Placement) -> str:
    if placement.verdict == "unknown":
        return tile("–", "points confirm the place of the mesh: too few points with photos")
    near, judged = placement.support.near, placement.support.judged
    return tile(f"{near} of {judged}", "sparse points have the mesh at their place, of those whose photos look at it")


def _ids(name: str, ids: np.ndarray) -> str:
    shown = ", ".join(map(str, ids[:_MOST_IDS].tolist()))
    rest = f" and {len(ids) - _MOST_IDS} more, see check.json" if len(ids) > _MOST_IDS else ""
    return f"<details><summary>{len(ids)} {text(name)}</summary><p class='dim'>{shown}{rest}</p></details>"


def _histogram(title: str, values: np.ndarray, unit: str, whole: bool = False, low: float = 0.0) -> str:
    """Bars from 0 to the largest value; those below `low` in the colour of excluded faces."""
    values = values[np.isfinite(values)]
    if len(values) == 0:
        return tile("–", title)
    top = float(values.max()) or 1.0
    edges = np.arange(top + 2) - 0.5 if whole and top < 2 * _BINS else np.linspace(0, top, _BINS + 1)
    counts, edges = np.histogram(values, bins=edges)
    width = 100 / len(counts)
    heights = np.where(counts > 0, np.maximum(40 * counts / counts.max(), 1), 0)  # a single face stays visible
    bars = []
    for i, count in enumerate(counts.tolist()):
        color = css(REJECTED if edges[i + 1] <= low else BRAND)
        bars.append(
            f"<rect x='{i * width:.2f}' y='{40 - heights[i]:.2f}' width='{0.86 * width:.2f}' height='{heights[i]:.2f}' "
            f"fill='{color}'><title>{count} faces: {_range(edges[i], edges[i + 1], whole)}{unit}</title></rect>"
        )
    middle = float(np.median(values))
    return (
        f"<div class='tile'><b>{_short(middle)}{unit}</b><span class='dim'>{title} (median)</span>"
        f"<svg viewBox='0 0 100 40' preserveAspectRatio='none' role='img' aria-label='{text(title)}'>{''.join(bars)}</svg>"
        f"<div class='axis'><span>0</span><span>{_short(top)}</span></div></div>"
    )


def _short(value: float) -> str:
    return f"{value:.0f}" if value == round(value) or value >= 100 else f"{value:.1f}"


def _range(low: float, high: float, whole: bool) -> str:
    return f"{(low + high) / 2:.0f}" if whole and high - low == 1 else f"{low:.1f} to {high:.1f}"


def _photos(views: Sequence[ViewCheck], correction_of_all: float) -> str:
    """The table of photos; correction_of_all: median of their corrections, px."""
    most = max((view.faces for view in views), default=0) or 1
    rows = []
    for view in views:
        off = "–" if view.reprojection is None else f"{view.reprojection:.2f} px"
        shift = "–" if view.shift is None else ", ".join(map(_signed, view.shift))
        correction = "–" if view.correction is None else f"{view.correction:.2f} px"
        exposure = "–" if view.exposure is None else f"{view.exposure:.2f}"
        cells = [
            (f"{view.width} × {view.height}", False),
            (f"{view.focal_length:.0f}", False),
            (
                f"{view.faces}<span class='bar'><i style='width:{100 * view.faces / most:.0f}%'></i></span>",
                view.faces == 0,
            ),
            (f"{100 * view.mesh_share:.0f} %", view.mesh_share == 0),
            (f"{100 * view.in_front:.0f} %", view.in_front < 0.5),
            (off, (view.reprojection or 0) > 1.5),
            (shift, max(map(abs, view.shift or (0, 0))) > 0.4),
            (correction, view.correction is not None and is_off_alone(view.correction, correction_of_all)),
            (exposure, not 0.7 < (view.exposure or 1) < 1.4),
            (f"{100 * view.masked:.0f} %" if view.masked else "–", False),
        ]
        rows.append(
            f"<tr><td><span class='name'>{text(view.name)}</span></td>"
            + "".join(f"<td{' class=bad' if bad else ''}>{value}</td>" for value, bad in cells)
            + "</tr>"
        )
    names = ("photo", "size", "focal, px", "faces", "mesh covers", "mesh in front", "reprojection", "mean shift, px",
             "correction", "exposure", "masked")  # fmt: skip
    header = "".join(f"<th>{name}</th>" for name in names)
    return (
        f"<h2>Photos</h2><table><thead><tr>{header}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
        "<p class='dim'>Reprojection: median distance between a projected sparse point and its observation; the mean shift is its "
        "systematic part. Exposure: relative to the median photo, measured on faces that both show.</p>"
    )


def _signed(value: float) -> str:
    return f"{round(value, 2) + 0.0:.2f}".replace("-", "\u2212")


def _pictures(check: SceneCheck, thumbnails: Sequence[np.ndarray], overlays: Sequence[str]) -> str:
    legend = "".join(
        f"<span><i style='background:{css(line.color)}'></i>{text(line.meaning)}</span>"
        for line in (IN_PART, HELD_BACK, OUT)
    )
    figures = "".join(
        f"<figure><a href='{text(file)}'><img alt='mesh over {text(view.name)}' src='{jpeg_uri(picture)}'></a>"
        f"<figcaption><b>{text(view.name)}</b><span class='dim'>{view.faces} faces</span></figcaption></figure>"
        for view, picture, file in zip(check.views, thumbnails, overlays, strict=True)
    )
    return f"<h2>The mesh over each photo</h2><div class='legend'>{legend}</div><div class='photos'>{figures}</div>"
