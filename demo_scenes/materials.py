"""Building materials painted from noise and structure, each a seamless texture.

A painter returns (n, n, 3) float64, albedo in grey levels 0 to 255, for a square piece of wall `metres` wide. Rows
run downwards as on a photo. Every painter ends in `_finish`, which removes detail finer than about two texels. Photos show
two or more texels per pixel, so their pixels average without aliasing.
"""

import numpy as np
from numba import njit

from demo_scenes.noise import fractal_noise, seeded, smoothstep, spline_noise, worley

Color = tuple[float, float, float]


def brick(n: int, metres: float, seed: int, tint: Color = (150, 84, 62)) -> np.ndarray:
    """Running bond of hand-made bricks (about 24 x 7.5 cm) with pale joints, every brick fired differently."""
    rng = seeded(seed, 1)
    rows, columns = 2 * round(metres / 0.15), round(metres / 0.24)
    brick_id, border = _courses(n, rows, columns, rng, wobble=0.010 * n / metres)
    joint = smoothstep(0.004, 0.010, border * metres / n + 0.0012 * _grain(n, metres, 0.03, rng))
    tone = rng.normal(0, 1, rows * columns)[brick_id]
    burnt = (rng.random(rows * columns) < 0.12)[brick_id]
    color = _tinted(tint, 14 * tone - 30 * burnt + 12 * _grain(n, metres, 0.05, rng) + 7 * _grain(n, metres, 0.4, rng))
    color[..., 0] += 6 * rng.normal(0, 1, rows * columns)[brick_id]
    mortar = _tinted((186, 176, 160), 9 * _grain(n, metres, 0.06, rng))
    return _finish(_blend(mortar, color, joint), _weather(n, metres, rng, 0.13))


def plaster(n: int, metres: float, seed: int, tint: Color = (206, 190, 158), contrast: float = 1.0) -> np.ndarray:
    """Rendered wall: trowel marks, fine sand, a few cracks and repaired patches; wide plain areas between."""
    rng = seeded(seed, 2)
    sand = 4.5 * _grain(n, metres, 0.035, rng)
    trowel = 5 * fractal_noise((n, n), (_cells(metres, 0.22), _cells(metres, 0.6)), 4, rng)
    patch = smoothstep(0.9, 1.15, fractal_noise((n, n), _square(metres, 2.2), 5, rng, 0.5))
    crack_field = fractal_noise((n, n), _square(metres, 2.5), 7, rng, 0.55)
    where = smoothstep(0.1, 0.9, spline_noise((n, n), _square(metres, 2.0), rng))
    crack = (1 - smoothstep(0.0, 0.022, np.abs(crack_field))) * where
    color = _tinted(tint, contrast * (sand + trowel - 46 * crack))
    color -= contrast * patch[..., None] * np.array([26.0, 30.0, 32.0])
    return _finish(color, _weather(n, metres, rng, 0.10 * contrast))


def ashlar(n: int, metres: float, seed: int, tint: Color = (178, 168, 150), block: float = 0.34) -> np.ndarray:
    """Cut stone in courses `block` metres high: tooled faces, veins, pitted, dark joints."""
    rng = seeded(seed, 3)
    rows, columns = 2 * round(metres / block / 2), round(metres / block / 1.9)
    stone_id, border = _courses(n, rows, columns, rng, wobble=0.008 * n / metres)
    edge = border * metres / n
    joint = smoothstep(0.004, 0.012, edge + 0.0016 * _grain(n, metres, 0.05, rng))
    bevel = 1 - smoothstep(0.008, 0.04, edge)
    vein = 1 - smoothstep(0.0, 0.10, np.abs(fractal_noise((n, n), _square(metres, 0.7), 6, rng, 0.6)))
    pits = smoothstep(1.5, 2.3, _grain(n, metres, 0.05, rng))
    tone = rng.normal(0, 1, rows * columns)[stone_id]
    relief = 11 * tone + 9 * _grain(n, metres, 0.25, rng) + 7 * _grain(n, metres, 0.04, rng)
    color = _tinted(tint, relief + 15 * vein * tone - 48 * pits - 16 * bevel)
    color[..., 2] -= 4 * rng.normal(0, 1, rows * columns)[stone_id]
    mortar = _tinted((92, 84, 74), 8 * _grain(n, metres, 0.05, rng))
    return _finish(_blend(mortar, color, joint), _weather(n, metres, rng, 0.14))


def rubble(n: int, metres: float, seed: int, tint: Color = (150, 144, 134), stone: float = 0.16) -> np.ndarray:
    """Field stones of about `stone` metres in mortar; also cobbles."""
    rng = seeded(seed, 4)
    cells = _cells(metres, stone)
    stone_id, border = worley((n, n), (cells, cells), rng)
    edge = border * stone + 0.003 * _grain(n, metres, 0.06, rng)
    inside = smoothstep(0.006, 0.014, edge)
    dome = smoothstep(0.0, 0.3 * stone, edge)
    tone = rng.normal(0, 1, cells * cells)[stone_id]
    warmth = rng.normal(0, 1, cells * cells)[stone_id]
    color = _tinted(
        tint, 24 * tone + 26 * (dome - 0.7) + 10 * _grain(n, metres, 0.08, rng) + 6 * _grain(n, metres, 0.02, rng)
    )
    color += warmth[..., None] * np.array([10.0, 1.0, -10.0])
    mortar = _tinted((110, 103, 92), 9 * _grain(n, metres, 0.03, rng))
    return _finish(_blend(mortar, color, inside), _weather(n, metres, rng, 0.10))


def roof_tiles(n: int, metres: float, seed: int, tint: Color = (158, 82, 56)) -> np.ndarray:
    """Plain clay tiles (about 17 x 20 cm visible), each casting a shadow on the next course, with lichen."""
    rng = seeded(seed, 5)
    rows, columns = 2 * round(metres / 0.40), round(metres / 0.17)
    tile_id, border = _courses(n, rows, columns, rng, wobble=0.012 * n / metres)
    gap = smoothstep(0.002, 0.008, border * metres / n)
    down = (np.arange(n)[:, None] * rows / n) % 1.0 + np.zeros((n, n))
    lip = smoothstep(0.0, 0.16, down) * (1 + 0.12 * smoothstep(0.8, 1.0, down))
    tone = rng.normal(0, 1, rows * columns)[tile_id]
    old = (rng.random(rows * columns) < 0.15)[tile_id]
    lichen = smoothstep(1.0, 1.6, _grain(n, metres, 0.3, rng))
    color = _tinted(tint, 20 * tone - 34 * old + 9 * _grain(n, metres, 0.06, rng) + 10 * down)
    color = _blend(color, _tinted((150, 146, 112), 12 * _grain(n, metres, 0.04, rng)), 0.7 * lichen)
    color *= (0.35 + 0.65 * gap * lip)[..., None]
    return _finish(color, _weather(n, metres, rng, 0.18))


def planks(n: int, metres: float, seed: int, tint: Color = (142, 104, 66)) -> np.ndarray:
    """Vertical boards 14 cm wide: grain along the board bent around knots, open joints, a row of nails."""
    rng = seeded(seed, 6)
    boards = round(metres / 0.14)
    across = np.arange(n)[None, :] * boards / n + 0.02 * spline_noise((n, n), (_cells(metres, 1.0), boards), rng)
    board = np.floor(across).astype(np.int64) % boards
    inside = across - np.floor(across)
    knot = spline_noise((n, n), (_cells(metres, 0.45), _cells(metres, 0.14)), rng)
    rings = inside * 5 + 1.7 * knot + 8 * rng.random(boards)[board]
    rings += 0.35 * fractal_noise((n, n), (_cells(metres, 0.6), _cells(metres, 0.05)), 3, rng)
    grain = np.sin(2 * np.pi * rings)
    fibre = fractal_noise((n, n), (_cells(metres, 0.25), _cells(metres, 0.02)), 3, rng)
    color = _tinted(
        tint, 16 * grain + 9 * fibre + 17 * rng.normal(0, 1, boards)[board] + 7 * _grain(n, metres, 0.3, rng)
    )
    dark_knot = smoothstep(1.9, 2.6, knot)
    color *= (1 - 0.55 * dark_knot)[..., None]
    joint = smoothstep(0.02, 0.06, np.minimum(inside, 1 - inside))
    nail = _dots(n, boards, _cells(metres, 0.8), 0.05)
    color *= (0.25 + 0.75 * joint)[..., None]
    color *= (1 - 0.7 * nail)[..., None]
    return _finish(color, _weather(n, metres, rng, 0.12))


def blank(n: int, tint: Color) -> np.ndarray:
    """A wall of one colour, on which photos do not determine tangential position."""
    return np.broadcast_to(np.asarray(tint, float), (n, n, 3)).copy()


def _cells(metres: float, feature: float) -> int:
    """How many lattice cells of about `feature` metres cover the texture (at least one)."""
    return max(1, round(metres / feature))


def _square(metres: float, feature: float) -> tuple[int, int]:
    return _cells(metres, feature), _cells(metres, feature)


def _grain(n: int, metres: float, feature: float, rng: np.random.Generator) -> np.ndarray:
    """Isotropic fractal noise (n, n), deviation 1, from `feature` metres down to the texels."""
    return fractal_noise((n, n), _square(metres, feature), 5, rng)


def _weather(n: int, metres: float, rng: np.random.Generator, strength: float) -> np.ndarray:
    """Factor (n, n, 1) about 1: broad stains, and streaks where rain ran down."""
    broad = fractal_noise((n, n), _square(metres, 1.8), 5, rng)
    streaks = fractal_noise((n, n), (_cells(metres, 1.6), _cells(metres, 0.25)), 4, rng)
    return np.clip(1 + strength * (0.7 * broad + 0.5 * streaks), 0.4, 1.35)[..., None]


def _tinted(tint: Color, levels: np.ndarray) -> np.ndarray:
    """A colour (n, n, 3) that is `levels` grey levels lighter than the tint, keeping its hue."""
    tint_array = np.asarray(tint, float)
    return tint_array * (1 + levels[..., None] / tint_array.mean())


def _blend(below: np.ndarray, above: np.ndarray, cover: np.ndarray) -> np.ndarray:
    """below + cover (above - below), computed in `above`."""
    above -= below
    above *= cover[..., None]
    above += below
    return above


def _courses(n: int, rows: int, columns: int, rng: np.random.Generator, wobble: float) -> tuple[np.ndarray, np.ndarray]:
    """Courses of units, every second course shifted by half a unit (`rows` is even, so the texture is seamless).

    `wobble` is the amplitude, in texels, by which the joints deviate from straight lines.

    Returns:
        The unit's number (n, n) int64 and the distance to its border (n, n) in texels.
    """
    bend_y, bend_x = (wobble * fractal_noise((n, n), (rows // 2, columns), 2, rng) * 0.5 for _ in range(2))
    y = (np.arange(n)[:, None] + bend_y) * rows / n
    row = np.floor(y)
    x = (np.arange(n)[None, :] + bend_x) * columns / n + 0.5 * (row % 2)
    column = np.floor(x)
    along, up = x - column, y - row
    border = np.minimum(np.minimum(along, 1 - along) * n / columns, np.minimum(up, 1 - up) * n / rows)
    return (row.astype(np.int64) % rows) * columns + column.astype(np.int64) % columns, border


def _dots(n: int, columns: int, rows: int, radius: float) -> np.ndarray:
    """Round dots (n, n), 1 inside, one in each of rows x columns cells; `radius` in cell widths."""
    x = (np.arange(n)[None, :] * columns / n) % 1.0 - 0.5
    y = ((np.arange(n)[:, None] * rows / n) % 1.0 - 0.5) * columns / rows
    return 1 - smoothstep(0.7 * radius, 1.3 * radius, np.sqrt(x * x + y * y))


def _finish(color: np.ndarray, weather: np.ndarray) -> np.ndarray:
    """The smooth texture of a colour (n, n, 3), which is overwritten, times the weather (n, n, 1)."""
    color *= weather
    return smooth(np.clip(color, 4, 250, out=color))


def smooth(color: np.ndarray) -> np.ndarray:
    """Binomial low-pass [1 4 6 4 1] / 16 in both directions (deviation 1 texel), periodic; (h, w, 3) float64."""
    across, out = np.zeros_like(color), np.zeros_like(color)  # from NumPy, see `demo_scenes.noise`
    _smooth(*(of_rows.reshape(len(color), -1) for of_rows in (color, across, out)))
    return out


@njit(cache=True, nogil=True)
def _smooth(color, across, out):
    """The low-pass of rows (h, 3 w), first along them into `across`, then across them into `out`."""
    height, count = color.shape
    for y in range(height):
        row, result = color[y], across[y]
        left2, left, here, right, right2, inside = row[:-12], row[3:-9], row[6:-6], row[9:-3], row[12:], result[6:-6]
        for i in range(inside.shape[0]):
            inside[i] = (left2[i] + right2[i] + 4 * (left[i] + right[i]) + 6 * here[i]) / 16
        for k in range(min(12, count)):
            i = k if k < 6 else count - 1 - (k - 6)
            near, far = row[i - 3] + row[(i + 3) % count], row[i - 6] + row[(i + 6) % count]
            result[i] = (far + 4 * near + 6 * row[i]) / 16
    for y in range(height):
        above2, above, here, result = across[y - 2], across[y - 1], across[y], out[y]
        below, below2 = across[(y + 1) % height], across[(y + 2) % height]
        for i in range(count):
            result[i] = (above2[i] + below2[i] + 4 * (above[i] + below[i]) + 6 * here[i]) / 16
