"""Cameras of the family: on arcs, in rows along the street, or free hand."""

from dataclasses import dataclass

import numpy as np

from demo_scenes.noise import seeded
from demo_scenes.outdoors import UP
from demo_scenes.photography import looking_at
from fairing.camera import Camera

KINDS = ("arc", "rows", "free hand")


@dataclass(frozen=True)
class Shoot:
    """How a building is photographed.

    Attributes:
        kind: one of KINDS.
        photos: their number.
        size: width and height, pixels.
        focal: focal length as a fraction of the longer side.
        fill: part of the photo that the building fills, seen from the front.
    """

    kind: str
    photos: int
    size: tuple[int, int]
    focal: float
    fill: float

    @property
    def focal_px(self) -> float:
        return self.focal * max(self.size)

    def distance(self, width: float, height: float) -> float:
        """Metres at which a front of that extent (metres) fills the photo as wanted."""
        return self.focal_px * max(width / self.size[0], height / self.size[1]) / self.fill


def place_cameras(shoot: Shoot, width: float, height: float, seed: tuple[int, ...]) -> list[Camera]:
    """Cameras in front of a building of that extent (metres) about the y axis, which faces the z axis."""
    rng = seeded(*seed, 62)
    distance = shoot.distance(width, height)
    if shoot.kind == "arc":
        places = _arc(shoot.photos, distance, height, rng)
    elif shoot.kind == "rows":
        places = _rows(shoot.photos, distance, width, height, rng)
    else:
        places = _free_hand(shoot.photos, distance, width, height, rng)
    return [
        looking_at(np.array(eye), np.array(target), UP, shoot.focal_px, *shoot.size, roll=0.04 * rng.standard_normal())
        for eye, target in places
    ]


Places = list[tuple[tuple[float, float, float], tuple[float, float, float]]]


def _arc(count: int, distance: float, height: float, rng: np.random.Generator) -> Places:
    """Two heights, 40 to 55 degrees to either side; the lower one is eye level."""
    reach, upper = np.radians(rng.uniform(40, 55)), max(4.0, rng.uniform(0.8, 1.3) * height)
    places: Places = []
    for k in range(count):
        turn = reach * (2 * k / (count - 1) - 1)
        level = (1.7, upper)[k % 2] + 0.25 * rng.standard_normal()
        far = distance * (1 + 0.05 * rng.standard_normal())
        target = (0.05 * distance * rng.standard_normal(), 0.48 * height, 0.0)
        places.append(((far * np.sin(turn), max(level, 1.2), far * np.cos(turn)), target))
    return places


def _rows(count: int, distance: float, width: float, height: float, rng: np.random.Generator) -> Places:
    """Two rows parallel to the wall, nearer than an arc, each photo turned to one side or the other."""
    upper, near = max(4.0, rng.uniform(0.8, 1.3) * height), 0.8 * distance
    places: Places = []
    for k in range(count):
        x = (0.5 * width + 0.35 * near) * (2 * k / (count - 1) - 1)
        level = (1.7, upper)[k % 2] + 0.2 * rng.standard_normal()
        aside = 0.25 * near * (1, -1)[(k // 2) % 2] + 0.05 * near * rng.standard_normal()
        target = (float(np.clip(0.75 * x + aside, -0.4 * width, 0.4 * width)), 0.45 * height, 0.0)
        places.append(((x, max(level, 1.2), near * (1 + 0.04 * rng.standard_normal())), target))
    return places


def _free_hand(count: int, distance: float, width: float, height: float, rng: np.random.Generator) -> Places:
    """Anywhere within 50 degrees of the front, nearer and farther, at eye level or from windows and ladders."""
    places: Places = []
    for k in range(count):
        # One place in each of as many sectors: a photographer walks round.
        turn = np.radians(50) * (2 * (k + rng.uniform(0.2, 0.8)) / count - 1)
        far = distance * rng.uniform(0.75, 1.25)
        level = 1.65 + 0.1 * rng.standard_normal() if rng.random() < 0.55 else rng.uniform(2.0, 1.3 * height + 1)
        target = (0.16 * width * rng.standard_normal(), height * rng.uniform(0.36, 0.6), 0.0)
        places.append(((far * np.sin(turn), max(level, 1.2), far * np.cos(turn)), target))
    return places
