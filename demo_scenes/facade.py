"""Demo scene `facade`: a stepped, recessed building; every start vertex is off its corner, along the surface."""

import numpy as np

from demo_scenes.facade_building import build_facade
from demo_scenes.materials import ashlar, blank, brick, planks, plaster, roof_tiles, rubble
from demo_scenes.noise import seeded
from demo_scenes.outdoors import Coat, building_views, camera_on_arc, window_coats
from demo_scenes.photography import Photography, Progress
from demo_scenes.start import faceted_truth, slide_off_corners
from fairing.camera import Camera
from fairing.scene import Scene

PHOTO_SIZE = (1000, 750)
FOCAL_PX = 1010.0
START_ERROR = (0.007, 0.010)  # fractions of the diagonal


def facade_scene(
    photography: Photography | None = None, progress: Progress | None = None, start_seed: int = 1
) -> Scene:
    """The facade with a start mesh like one from range data, which misses corners.

    Args:
        start_seed: seed of the start mesh; the photos do not depend on it.
    """
    photography = photography or Photography()
    sheet = build_facade()
    views = building_views("facade", sheet, _coats(photography), facade_cameras(), photography, progress)
    truth = faceted_truth(sheet.vertices, sheet.faces)
    low, high = (fraction * truth.surface.diagonal for fraction in START_ERROR)
    start = slide_off_corners(sheet.vertices, sheet.faces, (low, high), seeded(start_seed, 31))
    return Scene.build("facade", start, sheet.faces, views, truth=truth)


def facade_cameras() -> list[Camera]:
    """11 cameras at eye level and 11 from the windows opposite, 50 degrees to either side."""
    cameras = []
    for eye_height, distance, phase in ((1.8, 15.5, 0.0), (7.6, 16.0, 0.5)):
        for k in range(11):
            turn = np.radians(-50 + 100 * (k + phase / 2) / 10.25)
            height = eye_height + 0.25 * np.sin(2.1 * k)
            target = (0.6 * np.sin(1.3 * k + phase), 5.1 + 0.25 * np.sin(2.9 * k), 0.0)
            roll = 0.03 * np.sin(4.1 * k)
            cameras.append(camera_on_arc(distance, turn, height, target, roll, FOCAL_PX, PHOTO_SIZE))
    return cameras


def _coats(photography: Photography) -> dict[str, Coat]:
    wide, narrow = 1536, 1024
    wall = blank(8, (198, 186, 160)) if photography.blank_wall else None
    return {
        "plaster": Coat(lambda: plaster(wide, 12.0, seed=1) if wall is None else wall, wide / 12.0),
        "brick": Coat(lambda: brick(wide, 9.6, seed=2), wide / 9.6),
        "stone": Coat(lambda: ashlar(narrow, 6.4, seed=3), narrow / 6.4),
        "tiles": Coat(lambda: roof_tiles(wide, 9.6, seed=4), wide / 9.6),
        "wood": Coat(lambda: planks(narrow, 6.4, seed=5), narrow / 6.4),
        "mosaic": Coat(lambda: rubble(narrow, 6.0, seed=6, tint=(186, 176, 168), stone=0.11), narrow / 6.0),
        "plaster inside": Coat(lambda: plaster(narrow, 6.0, seed=7, tint=(186, 146, 112), contrast=1.8), narrow / 6.0),
        **window_coats("abcd", 20),
    }
