"""Textures that do not repeat: a weathered poster, windows with curtains."""

import numpy as np

from demo_scenes.materials import smooth
from demo_scenes.noise import fractal_noise, seeded, smoothstep

INK = np.array([34.0, 34.0, 44.0])


def poster(n: int, seed: int) -> np.ndarray:
    """A printed poster (n, n, 3): sun over hills, a headline and small print, on stained paper."""
    rng = seeded(seed, 11)
    y, x = np.mgrid[0:n, 0:n] / n
    pixel = 1.0 / n
    page = np.array([232.0, 214.0, 170.0]) - y[..., None] * np.array([30.0, 60.0, 60.0])

    radius = np.hypot(x - 0.62, y - 0.33)
    angle = np.arctan2(y - 0.33, x - 0.62)
    rays = 0.5 + 0.5 * np.tanh(6 * np.sin(18 * angle))
    _over(page, (236, 168, 74), rays * smoothstep(0.19, 0.22, radius) * (1 - smoothstep(0.3, 0.5, radius)))
    _over(page, (206, 64, 46), 1 - smoothstep(0.17 - pixel, 0.17 + pixel, radius))
    for depth, tint in enumerate([(116, 142, 132), (72, 108, 110), (38, 72, 86)]):
        crest = 0.50 + 0.09 * depth + 0.05 * fractal_noise((n, n), (1, 3 + 2 * depth), 6, rng, 0.5)[:1]
        _over(page, tint, smoothstep(crest - 1.5 * pixel, crest + 1.5 * pixel, y))
    _over(page, (226, 206, 164), smoothstep(0.755 - pixel, 0.755 + pixel, y))
    _write(page, rng, top=0.07, height=0.10, left=0.06, right=0.62, tint=INK)
    _write(page, rng, top=0.19, height=0.035, left=0.06, right=0.40, tint=np.array([180.0, 50.0, 40.0]))
    for line in range(5):
        _write(page, rng, top=0.785 + 0.034 * line, height=0.018, left=0.06, right=rng.uniform(0.75, 0.94), tint=INK)
    frame = np.minimum(np.minimum(x, 1 - x), np.minimum(y, 1 - y))
    _over(page, (240, 232, 212), 1 - smoothstep(0.022 - pixel, 0.022 + pixel, frame))

    fibre = fractal_noise((n, n), (24, 24), 6, rng, 0.7)
    stain = fractal_noise((n, n), (3, 3), 7, rng, 0.55)
    crease = 1 - smoothstep(0.0, 0.02, np.abs(fractal_noise((n, n), (3, 4), 6, rng, 0.5)))
    page *= (1 + 0.035 * fibre + 0.06 * stain)[..., None]
    _over(page, (238, 230, 214), 0.55 * crease * smoothstep(0.0, 1.0, stain))
    return smooth(np.clip(page, 4, 250))


def window(n: int, seed: int, frame_tint: tuple[int, int, int] = (222, 216, 200)) -> np.ndarray:
    """A closed window (n, n, 3): painted wooden frame with a cross bar, patterned curtains behind still glass."""
    rng = seeded(seed, 12)
    y, x = np.mgrid[0:n, 0:n] / n
    pixel = 1.0 / n
    folds = np.sin(2 * np.pi * (9 * x + 0.25 * fractal_noise((n, n), (2, 3), 3, rng)))
    cloth = np.array([146.0, 134.0, 122.0]) + 40 * (rng.random(3) - 0.5)
    pane = cloth * (1 + 0.22 * folds)[..., None]
    flowers = smoothstep(0.8, 1.2, fractal_noise((n, n), (14, 10), 3, rng))
    _over(pane, tuple(60 + 130 * rng.random(3)), 0.8 * flowers)
    gap = np.abs(x - 0.5) + 0.02 * fractal_noise((n, n), (4, 2), 3, rng)
    _over(pane, (30, 34, 42), 1 - smoothstep(0.06, 0.09, gap + 0.10 * (1 - y)))
    pane *= (1 + 0.10 * fractal_noise((n, n), (3, 3), 7, rng))[..., None]
    bars = np.minimum(
        np.minimum(np.minimum(x, 1 - x) - 0.075, np.minimum(y, 1 - y) - 0.06),
        np.minimum(np.abs(x - 0.5) - 0.035, np.abs(y - 0.36) - 0.03),
    )
    _over(pane, (40, 36, 32), 0.8 * (1 - smoothstep(0.0, 0.022, bars)))
    wood = (
        np.asarray(frame_tint, float)
        * (1 + 0.05 * fractal_noise((n, n), (6, 60), 3, rng) + 0.06 * fractal_noise((n, n), (8, 8), 5, rng))[..., None]
    )
    cover = 1 - smoothstep(-pixel, pixel, bars)
    return smooth(np.clip(pane + cover[..., None] * (wood - pane), 4, 250))


def _over(picture: np.ndarray, tint, cover: np.ndarray) -> None:
    """Paint a colour over the picture (h, w, 3), in place, where `cover` (h, w) is 1."""
    picture += cover[..., None] * (np.asarray(tint, float) - picture)


def _write(
    picture: np.ndarray, rng: np.random.Generator, top: float, height: float, left: float, right: float, tint
) -> None:
    """Set a line of letter-like strokes into the picture, in place; positions in fractions of its side."""
    n = len(picture)
    rows = slice(int((top - 0.3 * height) * n), int((top + 1.4 * height) * n))
    line = picture[rows]
    y, x = np.arange(n)[rows, None] / n, np.arange(n)[None, :] / n
    pixel = 1.5 / n
    ink = np.zeros(line.shape[:2])
    pen = left
    while pen + 0.7 * height < right:
        width = height * rng.uniform(0.45, 0.75)
        if rng.random() < 0.16:
            pen += width
            continue
        stem = 0.17 * height
        boxes = [(pen, pen + stem, 0.0, 1.0)]
        boxes += [(pen, pen + width, level, level + 0.16) for level in (0.0, 0.42, 0.84) if rng.random() < 0.6]
        if rng.random() < 0.5:
            boxes.append((pen + width - stem, pen + width, rng.choice([0.0, 0.42]), rng.choice([0.58, 1.0])))
        for x0, x1, y0, y1 in boxes:
            across = np.minimum(x - x0, x1 - x)
            down = np.minimum(y - top - y0 * height, top + y1 * height - y)
            ink = np.maximum(ink, smoothstep(-pixel, pixel, np.minimum(across, down)))
        pen += width + 0.22 * height
    _over(line, tint, 0.92 * ink)
