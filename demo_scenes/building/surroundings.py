"""What the photos show besides the mesh: ground, the rest of the building, neighbours, a backdrop and trees."""

import numpy as np

from demo_scenes.building.plan import Plan
from demo_scenes.building.walls import PANES
from demo_scenes.noise import seeded
from demo_scenes.outdoors import UP, tile_grid
from demo_scenes.sheet import Sheet, SheetBuilder

BACK = -7.0  # metres: z of the building's rear
TILE = 2.5  # metres: ground, and edges of all that is not in the mesh
BEHIND = 13.0  # metres from the front to the end of the ground
LEAVES = 320  # of a tree
CLEAR = 3.5  # metres between a tree and the nearest camera


def build_surroundings(plan: Plan, camera_places: np.ndarray) -> Sheet:
    """Everything around the building as one sheet.

    Args:
        camera_places: (c, 3) float, metres: the ground reaches beneath them, no tree stands near them.
    """
    rng = seeded(*plan.seed, 63)
    sheet = SheetBuilder(TILE)
    _rest_of_building(sheet, plan)
    left, right = plan.frame.x
    top = plan.frame.extent[1]
    for has_one, edge, side in zip(plan.neighbours, (left, right), (-1, 1), strict=True):
        if has_one:
            near = edge + side * rng.uniform(0.25, 2.5)
            far = near + side * rng.uniform(5, 9)
            box = (min(near, far), max(near, far))
            _house(sheet, box, rng.uniform(-2.0, 0.4), rng.uniform(0.6, 1.1) * top + 1.5, rng)
    for k in range(3):
        x = left - 9 + k * (right - left + 18) / 3
        _house(sheet, (x, x + (right - left + 18) / 3 - 1.0), -BEHIND, rng.uniform(0.7, 1.4) * top + 3, rng)
    trees = [_tree(plan, k, camera_places, rng) for k in range(plan.trees)]
    return joined([sheet.build(), _ground(plan, camera_places), *trees])


def joined(sheets: list[Sheet]) -> Sheet:
    """Several sheets as one; the faces follow in order."""
    offsets = np.cumsum([0, *(len(sheet.vertices) for sheet in sheets)])
    return Sheet(
        np.vstack([sheet.vertices for sheet in sheets]),
        np.vstack([sheet.faces + offset for sheet, offset in zip(sheets, offsets, strict=False)]),
        [name for sheet in sheets for name in sheet.material_of_face],
        np.concatenate([sheet.texture_metres for sheet in sheets]),
    )


def _rest_of_building(sheet: SheetBuilder, plan: Plan) -> None:
    """Side walls behind the mesh's, and the roof behind a gable."""
    frame = plan.frame
    (left, right), top = frame.x, frame.top
    for x, facing in ((left, -1), (right, 1)):
        sheet.rectangle((x, x), (0, top), (BACK, -frame.sides), (facing, 0, 0), "wall a")
    if frame.roof == "gable":
        ridge = top + frame.gable
        for x, facing in ((left, -1), (right, 1)):
            slope = [(x, top, 0), (x, top, BACK), (0, ridge, BACK), (0, ridge, 0)]
            sheet.add(slope, (facing * frame.gable, right, 0), "tiles")
    elif frame.roof == "eaves":
        front, head, ridge, back = frame.eaves
        above_wall = head + (ridge - head) * front / (front - back)
        for x, facing in ((left, -1), (right, 1)):
            side = [(x, top, 0), (x, above_wall, 0), (x, ridge, back), (x, top, BACK)]
            sheet.add(side, (facing, 0, 0), "wall a")
        rear = [(left, ridge, back), (right, ridge, back), (right, top, BACK), (left, top, BACK)]
        sheet.add(rear, (0, back - BACK, top - ridge), "tiles")
    else:
        sheet.rectangle((left, right), (top, top), (BACK, 0), (0, 1, 0), "gravel")


def _house(sheet: SheetBuilder, x: tuple[float, float], front: float, height: float, rng: np.random.Generator) -> None:
    """A plain house with rows of windows in its wall."""
    material = ("wall c", "wall d")[int(rng.integers(2))]
    depth, n_rows, n_columns = 7.0, max(1, int(height / 3.1)), max(1, int((x[1] - x[0]) / 2.4))
    holes = []
    for row in range(n_rows):
        for column in range(n_columns):
            middle = x[0] + (x[1] - x[0]) * (column + 0.5) / n_columns
            foot = height * (row + 0.3) / n_rows
            mouth = sheet.box_recess(
                (middle - 0.55, middle + 0.55), (foot, foot + 1.4), (front - 0.2, front), "stone", PANES[0]
            )
            holes.append(mouth)
    outline = [(x[0], 0, front), (x[1], 0, front), (x[1], height, front), (x[0], height, front)]
    sheet.add(outline, (0, 0, 1), material, holes=holes)
    for side, facing in ((x[0], -1), (x[1], 1)):
        sheet.rectangle((side, side), (0, height), (front - depth, front), (facing, 0, 0), material)
    sheet.rectangle(x, (height, height), (front - depth, front), (0, 1, 0), "gravel")


def _ground(plan: Plan, camera_places: np.ndarray) -> Sheet:
    """A level floor from behind the neighbours to beneath the farthest camera."""
    reach = max(abs(plan.frame.x[0]) + 14, float(np.abs(camera_places[:, 0]).max()) + 2)
    vertices, faces = tile_grid((-reach, reach), (-BEHIND - 1, float(camera_places[:, 2].max()) + 2), 0.0, TILE)
    return Sheet(vertices, faces, [plan.ground] * len(faces), vertices[:, [0, 2]][faces])


def _tree(plan: Plan, number: int, camera_places: np.ndarray, rng: np.random.Generator) -> Sheet:
    """A trunk and a crown of leaves: the first may hide a corner of the building, the others stand beside it."""
    half, depth = plan.frame.x[1], float(np.median(camera_places[:, 2]))
    side = (-1, 1)[int(rng.integers(2))]
    height, crown = rng.uniform(2.8, 6.0), rng.uniform(0.6, 1.2)
    if number == 0:
        x, z = side * (0.8 * half + rng.uniform(0, 1.0)), rng.uniform(1.5, 0.25 * depth + 1.5)
    else:
        x, z = side * (half + rng.uniform(1.0, 4.0)), rng.uniform(-4.0, 2.5)
    if np.hypot(camera_places[:, 0] - x, camera_places[:, 2] - z).min() < CLEAR:
        x, z = side * (half + 2.5), -3.0
    radius = 0.016 * height
    ring = [np.array([x + radius * np.cos(t), 0, z + radius * np.sin(t)]) for t in 2 * np.pi * np.arange(6) / 6]
    trunk = np.array([corner + level * height * UP for level in (0, 0.4, 0.8) for corner in ring])
    faces = []
    for level in range(2):
        for k in range(6):
            a, b = 6 * level + k, 6 * level + (k + 1) % 6
            faces += [[a, b + 6, b], [a, a + 6, b + 6]]
    bark = Sheet(trunk, np.array(faces), ["wood"] * len(faces), _unmapped(trunk)[np.array(faces)])

    center = np.array([x, 0.85 * height, z])
    middles = center + crown * np.array([1, 0.9, 1]) * rng.standard_normal((LEAVES, 3)) * 0.5
    long, wide = (scale * rng.standard_normal((LEAVES, 3)) for scale in (0.09, 0.055))
    leaves = np.stack([middles - long, middles - wide, middles + long, middles + wide], axis=1).reshape(-1, 3)
    first = 4 * np.arange(LEAVES)[:, None]
    leaf_faces = np.vstack([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])
    foliage = Sheet(leaves, leaf_faces, ["leaves"] * len(leaf_faces), _unmapped(leaves)[leaf_faces])
    return joined([bark, foliage])


def _unmapped(vertices: np.ndarray) -> np.ndarray:
    """Texture coordinates (n, 2), metres, of small things: position from the front."""
    return np.stack([vertices[:, 0] + 0.7 * vertices[:, 2], -vertices[:, 1]], axis=-1)
