"""Comparison page: meshes of any origin side by side, seen by one camera, with a table of figures and predicted photos.

One HTML file that opens without a server, a network connection or a program, with pictures instead of a 3D view: it shows meshes of
any size on any computer.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from string import Template

import cv2
import numpy as np

from app.export.assets import asset, offline_document
from app.export.orbit import VIEWS, orbit, orbit_pictures
from app.files.document import jpeg_uri
from app.html import number, text
from fairing.io import write_atomically
from fairing.judge.left_out import Prediction
from fairing.judge.mesh_comparison import MeshFigures
from fairing.judge.metrics import Distances

SIZE = 460  # px: of a picture of a mesh
PHOTO = 300  # px: width of a photo
MOST_PHOTOS = 8  # shown, spread evenly
ERROR_GAIN = 4.0


class PredictedPhotos:
    """Photos and the errors of their predictions by each mesh, reduced; `add` receives them one by one."""

    def __init__(self) -> None:
        self.rows: list[tuple[int, list[np.ndarray]]] = []

    def add(self, prediction: Prediction) -> None:
        """Keep the photo and the errors."""
        known = prediction.is_known[..., None]
        errors = [np.where(known, ERROR_GAIN * np.abs(image - prediction.photo), 0) for image in prediction.images]
        height, width = prediction.photo.shape[:2]
        size = (PHOTO, max(1, round(height * PHOTO / width)))
        small = [
            cv2.resize(np.clip(picture, 0, 255), size, interpolation=cv2.INTER_AREA).astype(np.uint8)
            for picture in (prediction.photo, *errors)
        ]
        self.rows.append((prediction.view, small))


def write_comparison(
    names: Sequence[str],
    figures: Sequence[MeshFigures],
    photos: PredictedPhotos,
    out: Path,
    on_progress: Callable[[float], None],
) -> None:
    """Write the page.

    Args:
        names: of the meshes.
        on_progress: called with the fraction that is done.

    Raises:
        InputError: a mesh has too many faces for a picture with its texture, or a photo is missing.
    """
    scenes = [each.scene for each in figures]
    cameras, pictures = orbit(scenes, SIZE), []
    for n, scene in enumerate(scenes):
        pictures.append(orbit_pictures(scene, cameras, lambda part, n=n: on_progress((n + part) / len(scenes))))
    frames = {
        look: [[jpeg_uri(picture) for picture in of_mesh[index]] for of_mesh in pictures]
        for index, look in enumerate(("textured", "shaded"))
    }
    meshes = "".join(
        f'<figure><img alt="{text(name)}" src="{frames["textured"][n][VIEWS // 2]}"><figcaption><b>{text(name)}</b>'
        f"<span>{len(scene.mesh.vertices)} vertices</span></figcaption></figure>"
        for n, (name, scene) in enumerate(zip(names, scenes, strict=True))
    )
    body = Template(asset("comparison.html")).substitute(
        name=text(scenes[0].name),
        counts=f"{len(scenes)} meshes · {len(scenes[0].views)} photos",
        meshes=meshes,
        last=VIEWS - 1,
        middle=VIEWS // 2,
        table=_table(names, figures),
        photos=_photos(names, figures, photos),
    )
    title = f"{scenes[0].name}: {len(scenes)} meshes compared"
    page = offline_document(title, title, asset("comparison.css"), body, {"frames": frames}, "export/web/comparison.js")
    write_atomically(out, lambda file: file.write(page.encode()))


def _table(names: Sequence[str], figures: Sequence[MeshFigures]) -> str:
    """The figures, a row each, with the best mesh of each row in bold."""
    columns: list[tuple[str, str, int, Callable[[MeshFigures], float]]] = [
        ("residual at the finest level, grey levels", "Over the faces of each mesh that at least three photos see.", -1,
         lambda each: each.residual),
        ("left-out photos, PSNR, dB", "Each photo predicted from the others, on the pixels that all meshes show.", 1,
         lambda each: each.psnr),
        ("left-out photos, SSIM", "On the same pixels.", 1, lambda each: each.ssim),
        ("held-out points, median distance, %", "Sparse points that no fit of this program uses, the same for all meshes.", -1,
         lambda each: _median(each.held_out)),
        ("to the reference, median, %", "Samples of the mesh: how accurate it is.", -1, lambda each: _median(each.to_reference)),
        ("to the reference, 90 % of the mesh, %", "", -1, lambda each: _quantile(each.to_reference)),
        ("from the reference, 90 % of it, %", "Samples of the reference: how complete the mesh is.", -1,
         lambda each: _quantile(each.from_reference)),
    ]  # fmt: skip
    head = "".join(f"<th>{text(name)}</th>" for name in names)
    rows = []
    for label, meaning, better, value_of in columns:
        values = np.array([value_of(each) for each in figures])
        if not np.isfinite(values).any():
            continue
        shown = [number(value, 4) if np.isfinite(value) else "–" for value in values]
        best = shown[int(np.nanargmax(better * values))]
        cells = "".join(f"<td{' class=best' * (value == best)}>{value}</td>" for value in shown)
        rows.append(f"<tr><th>{text(label)}<small>{text(meaning)}</small></th>{cells}</tr>")
    return f"<table><thead><tr><th></th>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


def _median(found: Distances | None) -> float:
    return np.nan if found is None or not len(found.values) else float(np.median(found.percent))


def _quantile(found: Distances | None) -> float:
    return np.nan if found is None or not len(found.values) else float(np.quantile(found.percent, 0.9))


def _photos(names: Sequence[str], figures: Sequence[MeshFigures], photos: PredictedPhotos) -> str:
    """A row a photo: the photo, and the error of each mesh's prediction."""
    shown = np.unique(np.linspace(0, len(photos.rows) - 1, min(len(photos.rows), MOST_PHOTOS)).round().astype(int))
    rows = []
    for row in shown.tolist():
        view, pictures = photos.rows[row]
        psnr = [figures[n].left_out.psnr[row] for n in range(len(names))]
        captions = [figures[0].scene.views[view].name]
        captions += [f"{value:.2f} dB" if np.isfinite(value) else "not judged" for value in psnr]
        labels = ["photo", *(f"error of {name}" for name in names)]
        rows.append("".join(
            f'<figure><img loading="lazy" alt="{text(label)}" src="{jpeg_uri(picture)}"><figcaption><span>{text(label)}</span>'
            f"<b>{text(caption)}</b></figcaption></figure>"
            for picture, label, caption in zip(pictures, labels, captions, strict=True)
        ))  # fmt: skip
    return "".join(f'<div class="row">{row}</div>' for row in rows)
