"""Demo scene `archway`: archways and balcony edges; the start mesh is spanned between noisy reconstructed points."""

import numpy as np

from demo_scenes.archway_building import build_archway
from demo_scenes.materials import ashlar, blank, brick, plaster, rubble
from demo_scenes.noise import seeded
from demo_scenes.outdoors import Coat, building_views, camera_on_arc, window_coats
from demo_scenes.photography import Photography, Progress
from demo_scenes.start import displaced_at_random, faceted_truth, observed_points
from fairing.camera import Camera
from fairing.scene import Scene

PHOTO_SIZE = (960, 720)
FOCAL_PX = 880.0
START_ERROR = (0.003, 0.005)  # fractions of the diagonal
SPARSE_POINTS = 500
SPARSE_ERROR = 0.0004  # fraction of the diagonal


def archway_scene(
    photography: Photography | None = None, progress: Progress | None = None, start_seed: int = 1
) -> Scene:
    """The archway, with sparse points and a start mesh as inaccurate as such points are.

    Args:
        start_seed: seed of the start mesh and the points; the photos do not depend on it.
    """
    photography = photography or Photography()
    sheet = build_archway()
    views = building_views("archway", sheet, _coats(photography), archway_cameras(), photography, progress)
    truth = faceted_truth(sheet.vertices, sheet.faces)
    diagonal = truth.surface.diagonal
    low, high = (fraction * diagonal for fraction in START_ERROR)
    start = displaced_at_random(sheet.vertices, sheet.faces, (low, high), seeded(start_seed, 32))
    points = observed_points(truth.surface, views, SPARSE_POINTS, SPARSE_ERROR * diagonal, seeded(start_seed, 33))
    return Scene.build("archway", start, sheet.faces, views, truth=truth, sparse_points=points, points_choice="given")


def archway_cameras() -> list[Camera]:
    """10 cameras, alternately at eye level and 8 metres up, 48 degrees to either side."""
    cameras = []
    for k in range(10):
        turn = np.radians(-48 + 96 * k / 9)
        height = (1.7, 8.0)[k % 2] + 0.3 * np.sin(1.9 * k)
        target = (0.4 * np.sin(1.3 * k), 3.6 + 0.2 * np.sin(2.9 * k), 0.0)
        cameras.append(camera_on_arc(12.5, turn, height, target, 0.03 * np.sin(4.1 * k), FOCAL_PX, PHOTO_SIZE))
    return cameras


def _coats(photography: Photography) -> dict[str, Coat]:
    wide, narrow = 1536, 1024
    wall = blank(8, (170, 122, 100)) if photography.blank_wall else None
    return {
        "brick": Coat(lambda: brick(wide, 9.6, seed=12, tint=(168, 112, 84)) if wall is None else wall, wide / 9.6),
        "stone": Coat(lambda: ashlar(narrow, 6.4, seed=13, tint=(190, 180, 158)), narrow / 6.4),
        "plaster": Coat(lambda: plaster(narrow, 6.4, seed=14, tint=(196, 186, 170), contrast=1.3), narrow / 6.4),
        "rubble": Coat(lambda: rubble(narrow, 6.4, seed=15), narrow / 6.4),
        **window_coats("ab", 30),
    }
