"""Leave-one-out evaluation: PSNR and SSIM of photos rendered from the textured model without the photo itself."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from fairing.cells.scale_space import LUMA
from fairing.judge.render import DEPTH_BYTES, LARGEST, MOST_SOURCES, PHOTO_BYTES, Renderer
from fairing.mesh import Mesh
from fairing.photo import LOADED_BYTES
from fairing.scene import Scene
from fairing.util.bounded_cache import BoundedCache

# Wang, Bovik, Sheikh, Simoncelli 2004: Gaussian window of 11 pixels, sigma 1.5, and their constants.
WINDOW, WINDOW_SIGMA = 11, 1.5
C1, C2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2

# Bytes, for the estimate of memory: of the program after a run, and of a pixel of all kept face ids and depths; of a photo's
# pixel for each of its sources (colour and weight), for points, rays and SSIM, and for each rendered state.
PROGRAM, DEPTH_PIXEL, SOURCE_PIXEL, WORK_PIXEL, STATE_PIXEL = 400_000_000, 12, 16, 160, 40


MOST_JUDGED = 40
"""Photos that are predicted; of more, as many evenly spread ones."""


@dataclass(frozen=True, eq=False)
class LeftOut:
    """How well one state of the mesh predicts photos, each rendered from the others.

    Attributes:
        views: v ids of the evaluated photos.
        psnr: (v,) float, dB; NaN for a photo without evaluated pixels.
        ssim: (v,) float, of the luma; NaN likewise.
        share: (v,) float, 0 to 1: evaluated part of the photo; NaN likewise.
    """

    views: tuple[int, ...]
    psnr: np.ndarray
    ssim: np.ndarray
    share: np.ndarray


@dataclass(frozen=True, eq=False)
class Prediction:
    """One photo, and its prediction from the others.

    Attributes:
        view: id of the photo.
        photo: (h, w, 3) float32, RGB grey levels.
        images: (h, w, 3) float32, RGB grey levels, for each state of the mesh.
        is_known: (h, w) bool: pixels that all states predict.
    """

    view: int
    photo: np.ndarray
    images: tuple[np.ndarray, ...]
    is_known: np.ndarray


def leave_one_out(
    scene: Scene,
    *states: np.ndarray | Mesh,
    views: Sequence[int] | None = None,
    match_exposure: bool = True,
    on_view: Callable[[Prediction], None] = lambda prediction: None,
) -> list[LeftOut]:
    """Render each photo from the others for several states of the mesh, evaluated on the pixels that all states predict.

    The common pixels make states comparable: evaluated on its own pixels, a mesh that covers more of the photos scores worse
    (ledger: leave-one-out pixels).

    Large photos are evaluated at the renderer's size limit (`fairing.judge.render.LARGEST`); masked pixels are excluded.

    Args:
        states: vertices (n, 3) float of the scene's mesh, world units, or other meshes.
        views: ids of the photos to leave out, one at a time; default: all.
        match_exposure: fit a gain and an offset per channel to the photo first, because photos of one scene differ in
            exposure and the exposure of the left-out photo is unknown to the model.
        on_view: callback with every evaluated photo, for pictures.

    Returns:
        One result per state.

    Raises:
        InputError: a photo cannot be decoded.
    """
    views = tuple(range(len(scene.views)) if views is None else views)
    photos: BoundedCache[int] = BoundedCache(PHOTO_BYTES)
    meshes = [state if isinstance(state, Mesh) else scene.mesh.moved(state) for state in states]
    renderers = [Renderer(replace(scene, mesh=mesh), mesh.vertices, photos) for mesh in meshes]
    psnrs, ssims, shares = (np.full((len(states), len(views)), np.nan) for _ in range(3))
    for i, view in enumerate(views):
        photo = renderers[0].photo(view).astype(np.float32)
        rendered = [renderer.render(view) for renderer in renderers]
        known = np.logical_and.reduce([r.is_known for r in rendered])
        images = [_matched(r.image, photo, known) if match_exposure and known.any() else r.image for r in rendered]
        on_view(Prediction(view, photo, tuple(images), known))
        inner = cv2.erode(known.astype(np.uint8), np.ones((WINDOW, WINDOW), np.uint8), borderValue=0) > 0
        if not inner.any():
            continue
        for s, image in enumerate(images):
            psnrs[s, i] = psnr(image[known], photo[known])
            ssims[s, i] = ssim_map(_luma(image), _luma(photo))[inner].mean()
            shares[s, i] = known.mean()
    return [LeftOut(views, *row) for row in zip(psnrs, ssims, shares, strict=True)]


def judged_views(scene: Scene) -> list[int]:
    """Ids of the photos to predict: all, or of many photos `MOST_JUDGED`."""
    count = len(scene.views)
    return np.unique(np.linspace(0, count - 1, min(count, MOST_JUDGED)).round().astype(int)).tolist()


def memory_of_left_out(scene: Scene, n_states: int = 2, scale: float = 1.0) -> int:
    """Approximate peak memory of `leave_one_out`, bytes, in a program that has run the scene.

    Args:
        n_states: states of the mesh.
        scale: factor of the photos' width and height.
    """
    sizes = np.array([view.camera.width * view.camera.height for view in scene.views]) * scale**2
    sizes = np.minimum(sizes, LARGEST)
    return int(
        PROGRAM
        + min(3 * sizes.sum(), LOADED_BYTES)
        + min(3 * sizes.sum(), PHOTO_BYTES)
        + n_states * min(DEPTH_PIXEL * sizes.sum(), DEPTH_BYTES)
        + sizes.max() * (SOURCE_PIXEL * min(len(sizes) - 1, MOST_SOURCES) + WORK_PIXEL + STATE_PIXEL * n_states)
    )


def left_out_summary(scene: Scene, before: LeftOut, after: LeftOut, beside: LeftOut | None = None) -> dict[str, Any]:
    """Plain numbers for a report: per photo, and means over the evaluated photos.

    PSNR of two meshes compares only on the same pixels: see `judged_share`.

    Args:
        before, after: two states from one call of `leave_one_out`.
        beside: a third state from the same call to compare with, for example another program's mesh.
    """
    photos = [
        {
            "photo": scene.views[view].name,
            "judged_share": before.share[i],
            "psnr_before": before.psnr[i],
            "psnr_after": after.psnr[i],
            "ssim_before": before.ssim[i],
            "ssim_after": after.ssim[i],
        }
        for i, view in enumerate(before.views)
    ]
    judged = [photo for photo in photos if np.isfinite(photo["psnr_before"]) and np.isfinite(photo["psnr_after"])]
    means = {
        key: float(np.mean([photo[key] for photo in judged])) if judged else None
        for key in ("judged_share", "psnr_before", "psnr_after", "ssim_before", "ssim_after")
    }
    better = sum(bool(photo["psnr_after"] > photo["psnr_before"]) for photo in judged)
    summary = {**means, "photos_judged": len(judged), "photos_better": better, "photos": photos}
    if beside is not None and judged:
        summary |= {"psnr_beside": float(np.nanmean(beside.psnr)), "ssim_beside": float(np.nanmean(beside.ssim))}
        summary["photos_better_than_beside"] = int((after.psnr > beside.psnr).sum())
    return summary


def psnr(image: np.ndarray, reference: np.ndarray) -> float:
    """Peak signal-to-noise ratio, dB, of two arrays of one shape with grey levels 0 to 255."""
    error = float(((image.astype(np.float64) - reference) ** 2).mean())
    return float(10 * np.log10(255**2 / error)) if error > 0 else float("inf")


def ssim_map(image: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Structural similarity at every pixel of two grey images (Wang et al. 2004, Eq. 13).

    ((2 mu_x mu_y + C1) (2 sigma_xy + C2)) / ((mu_x^2 + mu_y^2 + C1) (sigma_x^2 + sigma_y^2 + C2)). Images are mirrored at their
    borders.

    Args:
        image, reference: (h, w) float, grey levels.

    Returns:
        (h, w) float.
    """
    x, y = image.astype(np.float64), reference.astype(np.float64)

    def mean(values: np.ndarray) -> np.ndarray:
        return cv2.GaussianBlur(values, (WINDOW, WINDOW), WINDOW_SIGMA, borderType=cv2.BORDER_REFLECT_101)

    mu_x, mu_y = mean(x), mean(y)
    xx, yy, xy = mean(x * x) - mu_x**2, mean(y * y) - mu_y**2, mean(x * y) - mu_x * mu_y
    return ((2 * mu_x * mu_y + C1) * (2 * xy + C2)) / ((mu_x**2 + mu_y**2 + C1) * (xx + yy + C2))


def _matched(image: np.ndarray, photo: np.ndarray, known: np.ndarray) -> np.ndarray:
    """The image with the gain and offset per channel that fit it to the photo (least squares over known pixels)."""
    result = image.copy()
    for channel in range(3):
        x, y = image[known, channel].astype(np.float64), photo[known, channel].astype(np.float64)
        gain = ((x - x.mean()) * (y - y.mean())).mean() / max(x.var(), 1e-9)
        result[..., channel] = gain * (image[..., channel] - x.mean()) + y.mean()
    return result


def _luma(image: np.ndarray) -> np.ndarray:
    return image @ LUMA.astype(np.float32)
