"""Point page of the cells panel: a sparse point in the photos of its track."""

from collections.abc import Callable

import numpy as np

from app.html import number, text
from app.palette import NOW, SELECTED, css
from app.panels.choice import photo_link
from app.panels.photo_pages import CROP_SIDE, framed_picture
from app.pictures.photo_crops import Window
from app.pictures.photo_store import PhotoStore
from fairing.scene import Scene, SparsePoints

LEAST_SPAN = 40.0  # photo px: side of a crop
ARM = 7.0  # px: half the size of the cross at an observation
ORIGINS = {"given": "given with the capture", "own": "found in the photos", "both": "given, or found in the photos"}


class PointPhotos:
    """Draws the track of a sparse point. Runs on the background worker."""

    def __init__(self, scene: Scene, photos: PhotoStore, enter: Callable[[str], str]) -> None:
        self._scene, self._photos, self._enter = scene, photos, enter

    def draw(self, points: SparsePoints, point: int) -> str:
        """Markup: the facts of a point, and a crop of every photo that observes it.

        Args:
            point: its index.
        """
        observed = np.flatnonzero(points.observations[:, 0] == point)
        views, pixels = points.observations[observed, 1].tolist(), points.pixels[observed]
        cameras = [self._scene.views[view].camera for view in views]
        projected = np.array([camera.project(points.positions[point])[0] for camera in cameras]).reshape(-1, 2)
        residuals = np.linalg.norm(projected - pixels, axis=1)
        head = (
            f"<div class='big'>Sparse point {point}</div><div class='dim'>{text(ORIGINS[points.origin].capitalize())}, "
            f"observed in {len(views)} photos"
            + (f", mean reprojection error {number(float(residuals.mean()), 3)} px" if views else "")
            + "</div>"
        )
        if not views:
            return f"{head}<div class='note'>The capture does not list the photos that observe this point.</div>"
        crops = "".join(
            f"<div><div class='one'>{photo_link(view, self._scene.views[view].name, self._enter(str(view)))}</div>"
            f"{self._crop(view, pixel, place)}<div class='dim'>{number(float(residual), 3)} px</div></div>"
            for view, pixel, place, residual in zip(views, pixels, projected, residuals, strict=True)
        )
        key = (
            "<div class='note dim'><span class='selected'>+</span> observed <span class='now'>○</span> projection of the "
            "point</div>"
        )
        return f"{head}{key}<div class='crops'>{crops}</div>"

    def _crop(self, view: int, pixel: np.ndarray, projected: np.ndarray) -> str:
        window = Window.around(np.stack([pixel, projected]), CROP_SIDE, margin=0.5, least=LEAST_SPAN)
        (x, y), (u, v) = window.place(pixel), window.place(projected)
        drawn = (
            f'<path d="M{x - ARM:.1f} {y:.1f}h{2 * ARM}M{x:.1f} {y - ARM:.1f}v{2 * ARM}" stroke="{css(SELECTED)}"/>'
            f'<circle cx="{u:.1f}" cy="{v:.1f}" r="{ARM}" fill="none" stroke="{css(NOW)}" stroke-width="1.4"/>'
        )
        return framed_picture(window.cut(self._photos[view]), CROP_SIDE, drawn)
