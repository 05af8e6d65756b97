"""The plan of a member of the family: all choices that are drawn from its seed before anything is built."""

from dataclasses import dataclass

import numpy as np

from demo_scenes.building.cameras import KINDS, Shoot, place_cameras
from demo_scenes.building.walls import Frame, build_walls
from demo_scenes.noise import seeded
from demo_scenes.photography import Photography
from demo_scenes.sheet import Sheet
from fairing.camera import Camera
from fairing.geometry.rasterize import rasterize

FACES = (60, 800)
FACE_PX = (15.0, 150.0)
PHOTOS = (8, 30)
PHOTO_SIZES = ((640, 480), (720, 540), (800, 600), (960, 640), (1024, 768), (1280, 960), (1440, 1080), (1600, 1200))
MOST_MEGAPIXELS = 24.0  # of all photos together, so that the largest scenes are made within about a minute
STARTS = ("corners", "noise", "decimated", "points")
START_PX = (1.0, 15.0)
MOST_OF_A_FACE = 0.3  # largest start error, in typical edges
SMOOTH = 4  # facets of a true curve to one facet of the mesh
LEAST_SEEN = 0.9  # share of faces that three photos must see
ATTEMPTS = 60


@dataclass(frozen=True)
class Plan:
    """A member of the family.

    Attributes:
        seed: key of all random numbers; its last entry counts the attempts.
        frame: the building.
        shoot: the photos.
        photography: noise, exposure, gloss, blur, passers-by.
        spacing: aimed-at edge length, metres.
        px_per_metre: scale of the front in a typical photo.
        start: one of STARTS.
        start_px: error of the start, pixels in a typical photo.
        has_points: whether the scene comes with sparse points.
        point_px: standard deviation of keypoints, pixels.
        trees: their number.
        ground: material of the ground: "cobbles", "paving" or "gravel".
        neighbours: whether other buildings stand to the left and to the right.
        sun: direction towards the sun.
    """

    seed: tuple[int, ...]
    frame: Frame
    shoot: Shoot
    photography: Photography
    spacing: float
    px_per_metre: float
    start: str
    start_px: float
    has_points: bool
    point_px: float
    trees: int
    ground: str
    neighbours: tuple[bool, bool]
    sun: tuple[float, float, float]

    @property
    def start_error(self) -> float:
        """Error of the start, metres."""
        return self.start_px / self.px_per_metre

    def sheet(self) -> Sheet:
        """The building as the mesh has it."""
        return build_walls(self.frame, self.seed, self.spacing)

    def true_sheet(self) -> Sheet:
        """The building as the photos show it: curved parts in more facets where they are true curves."""
        return build_walls(self.frame, self.seed, self.spacing, SMOOTH if self.frame.is_smooth else 1)

    def cameras(self) -> list[Camera]:
        """One for each photo."""
        return place_cameras(self.shoot, *self.frame.extent, self.seed)


def draw_plan(seed: int) -> Plan:
    """The plan that belongs to a seed: the first of its draws that keeps the family's limits."""
    for attempt in range(ATTEMPTS):
        plan = _draw((abs(seed), int(seed < 0), attempt))
        if plan is not None and _keeps_limits(plan):
            return plan
    raise AssertionError(f"seed {seed}: no building within the limits in {ATTEMPTS} attempts")


def _draw(key: tuple[int, ...]) -> Plan | None:
    """One draw; None where no edge length leads to the wanted number of faces."""
    rng = seeded(*key, 60)
    wanted = float(np.exp(rng.uniform(np.log(70), np.log(720))))
    frame = _draw_frame(wanted, rng)
    photography = _draw_photography(rng)
    size = PHOTO_SIZES[int(rng.integers(len(PHOTO_SIZES)))]
    most = MOST_MEGAPIXELS / (size[0] * size[1] / 1e6)
    photos = int(min(rng.integers(PHOTOS[0], PHOTOS[1] + 1), max(most, PHOTOS[0])))
    kind = KINDS[int(rng.integers(len(KINDS)))]
    if frame.is_tall:
        size = size[1], size[0]
    shoot = Shoot(kind, photos, size, rng.uniform(0.8, 1.2), rng.uniform(0.7, 0.92))
    start = STARTS[int(rng.choice(len(STARTS), p=[0.3, 0.3, 0.2, 0.2]))]
    start_px = float(np.exp(rng.uniform(*np.log(START_PX))))
    options = {
        "has_points": bool(rng.random() < 0.5),
        "point_px": float(rng.uniform(0.3, 0.9)),
        "trees": int(rng.integers(0, 4)),
        "ground": ("cobbles", "paving", "gravel")[int(rng.integers(3))],
        "neighbours": (bool(rng.random() < 0.6), bool(rng.random() < 0.6)),
        "sun": (float(rng.uniform(-0.8, 0.8)), float(rng.uniform(0.5, 0.9)), float(rng.uniform(0.3, 0.8))),
    }
    px_per_metre = _typical_scale(frame, shoot, key)
    spacing = _spacing(frame, key, wanted, (18 / px_per_metre, 140 / px_per_metre))
    if spacing is None:
        return None
    start_px = min(start_px, MOST_OF_A_FACE * spacing * px_per_metre)
    return Plan(key, frame, shoot, photography, spacing, px_per_metre, start, start_px, **options)


def _draw_frame(wanted: float, rng: np.random.Generator) -> Frame:
    """A building whose elements alone make up about half the wanted faces."""
    slots = max(2, round(wanted / rng.uniform(22, 44)))
    n_storeys = min(int(rng.integers(1, 4)), slots)
    n_bays = int(np.clip(round(slots / n_storeys), 1, 6))
    bay = rng.uniform(2.3, 3.2)
    half = round(n_bays * bay / 2, 3)
    bays = tuple(round(-half + 2 * half * k / n_bays, 3) for k in range(n_bays + 1))
    storeys = tuple(round(float(y), 3) for y in np.cumsum([0, *rng.uniform(2.9, 3.5, n_storeys)]))
    wing = None
    if n_storeys > 1 and n_bays > 1 and rng.random() < 0.55:
        first = int(rng.integers(n_bays - 1))
        behind = int(rng.integers(first + 1, n_bays)) if first == 0 else int(rng.integers(first + 1, n_bays + 1))
        wing = first, behind, int(rng.integers(1, n_storeys)), round(rng.uniform(0.8, 1.8), 3)
    front, head = round(rng.uniform(0.35, 0.7), 3), round(storeys[-1] + rng.uniform(0.3, 0.5), 3)
    ridge, back = round(head + rng.uniform(1.6, 2.6), 3), round(front - rng.uniform(2.0, 3.2), 3)
    return Frame(
        bays,
        storeys,
        wing,
        eaves=(front, head, ridge, back),
        roof=("flat", "cornice", "eaves", "gable")[int(rng.integers(4))],
        sides=round(rng.uniform(1.5, 3.5), 3) if rng.random() < 0.5 else 0.0,
        is_smooth=bool(rng.random() < 0.4),
        plain=bool(rng.random() < 0.35),
    )


def _draw_photography(rng: np.random.Generator) -> Photography:
    return Photography(
        noise=round(float(rng.uniform(0, 4)) if rng.random() < 0.8 else 0.0, 2),
        exposure=round(float(rng.uniform(0.02, 0.15)) if rng.random() < 0.6 else 0.0, 3),
        occluders=bool(rng.random() < 0.5),
        gloss=bool(rng.random() < 0.35),
        seed=int(rng.integers(1 << 30)),
        blur=round(float(rng.uniform(0.3, 1.2)) if rng.random() < 0.5 else 0.0, 2),
    )


def _typical_scale(frame: Frame, shoot: Shoot, key: tuple[int, ...]) -> float:
    """Pixels per metre at the middle of the front, median over the photos."""
    width, height = frame.extent
    middle = np.array([0, height / 2, 0])
    distances = [np.linalg.norm(camera.center - middle) for camera in place_cameras(shoot, width, height, key)]
    return shoot.focal_px / float(np.median(distances))


def _spacing(frame: Frame, key: tuple[int, ...], wanted: float, limits: tuple[float, float]) -> float | None:
    """Edge length, metres, within limits, that brings the number of faces nearest to what is wanted."""
    best, least = None, np.inf
    for spacing in np.geomspace(*limits, 6)[::-1]:
        faces = len(build_walls(frame, key, float(spacing)).faces)
        off = abs(np.log(faces / wanted))
        if off > least:
            break  # the number only grows
        if FACES[0] <= faces <= FACES[1]:
            best, least = round(float(spacing), 3), off
    return best


def _keeps_limits(plan: Plan) -> bool:
    """Whether the faces are as large in the photos as they should be, and seen by enough of them."""
    sheet, cameras = plan.sheet(), plan.cameras()
    edges = sheet.vertices[np.roll(sheet.faces, -1, axis=1)] - sheet.vertices[sheet.faces]
    typical = float(np.median(np.linalg.norm(edges, axis=2).mean(axis=1))) * plan.px_per_metre
    if not FACE_PX[0] < typical < FACE_PX[1]:
        return False
    seen = np.zeros(len(sheet.faces), int)
    for camera in cameras:
        shown = rasterize(sheet.vertices, sheet.faces, camera.resized(camera.width // 2, camera.height // 2))[0]
        seen += np.bincount(shown[shown >= 0], minlength=len(sheet.faces)) >= 8
    return bool((seen >= 3).mean() >= LEAST_SEEN)
