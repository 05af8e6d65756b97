"""Materials of the family: textures with random tints, as fine as the photos need."""

from collections.abc import Callable
from functools import partial

import numpy as np

from demo_scenes.building.plan import Plan
from demo_scenes.building.walls import PANES
from demo_scenes.materials import Color, ashlar, blank, brick, planks, plaster, roof_tiles, rubble
from demo_scenes.noise import seeded
from demo_scenes.outdoors import Coat, window_coats

TEXELS_PER_PIXEL = 2.2
LEAST_METRES = 3.0  # width of a texture before it repeats
TEXTURE_SIZES = (384, 512, 768, 1024, 1280)

Painter = Callable[..., np.ndarray]
_WALLS: tuple[tuple[Painter, Color], ...] = (
    (plaster, (206, 190, 158)),
    (plaster, (176, 196, 190)),
    (brick, (150, 84, 62)),
    (brick, (182, 150, 108)),
    (ashlar, (178, 168, 150)),
    (rubble, (150, 144, 134)),
)


def building_coats(plan: Plan) -> dict[str, Coat]:
    """A coat for each material of the building and its surroundings."""
    rng = seeded(*plan.seed, 64)

    def coat(painter: Painter, tint: Color, coarse: int = 1, **options: float) -> Coat:
        seed = int(rng.integers(1 << 20))
        bright = rng.uniform(0.85, 1.12)
        r, g, b = (float(np.clip(c * bright * rng.uniform(0.94, 1.06), 20, 225)) for c in tint)
        paint = partial(painter, n // coarse, metres, seed=seed, tint=(r, g, b), **options)
        return Coat(paint, n // coarse / metres)

    n, metres = _resolution(plan.px_per_metre)
    walls = [_WALLS[int(k)] for k in rng.permutation(len(_WALLS))[:4]]
    pane_size = int(np.clip(TEXELS_PER_PIXEL * plan.px_per_metre * 1.4, 128, 512))
    light = float(rng.uniform(150, 215))
    coats = {
        f"wall {name}": coat(*wall, coarse=far) for name, wall, far in zip("abcd", walls, (1, 1, 2, 2), strict=True)
    }
    coats |= {
        "stone": coat(ashlar, (190, 180, 158)),
        "wood": coat(planks, (142, 104, 66)),
        "tiles": coat(roof_tiles, (158, 82, 56)),
        "inside": coat(plaster, (186, 160, 130), contrast=1.8),
        "rubble": coat(rubble, (168, 156, 140), stone=0.14),
        "cobbles": coat(rubble, (128, 122, 112), coarse=2, stone=0.16),
        "paving": coat(ashlar, (150, 146, 138), coarse=2),
        "gravel": coat(plaster, (140, 136, 126), coarse=2, contrast=1.6),
        "leaves": coat(plaster, (84, 112, 52), coarse=2, contrast=2.0),
        "paint": Coat(lambda: blank(8, (light, 0.97 * light, 0.88 * light)), 1.0),
    }
    letters = "".join(name[-1] for name in PANES)
    return coats | window_coats(letters, int(rng.integers(1 << 20)), pane_size)


def _resolution(px_per_metre: float) -> tuple[int, float]:
    """Texels along a texture's side, and its width in metres, so that photos see a texel or two less than a pixel wide."""
    density = TEXELS_PER_PIXEL * px_per_metre
    for n in TEXTURE_SIZES:
        if n / density >= LEAST_METRES:
            return n, n / density
    return TEXTURE_SIZES[-1], TEXTURE_SIZES[-1] / density
