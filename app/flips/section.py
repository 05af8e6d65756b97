"""Section: the plane behind which tetrahedra are shown."""

from dataclasses import dataclass, replace

import numpy as np

from app.stage import SIZE, Stage

DIRECTIONS = {"off": "Off", "front": "Front", "side": "Side", "top": "Top"}
"""Where a section is seen from, and its name on the page."""
TILT = 0.3  # upwards and towards the front, of the direction from which a section is seen


@dataclass(frozen=True)
class Section:
    """A plane across the object.

    Attributes:
        direction: one of `DIRECTIONS`; "off": no plane, everything is shown.
        depth: of the plane, percent of half the object's size: 0 is its middle, 100 behind it, -100 before it.
    """

    direction: str = "front"
    depth: int = 0

    def heights(self, points: np.ndarray, stage: Stage) -> np.ndarray:
        """(n,) float, page units: heights of points (n, 3), page, over the plane, on the side that is cut away; all below 0
        without a plane."""
        if self.direction == "off":
            return np.full(len(points), -1.0)
        normal = self.normal(stage)
        return points @ normal + self.depth / 100 * SIZE / 2

    def seen_from(self, stage: Stage) -> np.ndarray:
        """(3,) float, page: a direction from which the section and what is behind it are seen."""
        front = replace(self, direction="front").normal(stage)
        if self.direction == "off":
            return front
        tilted = self.normal(stage) + TILT * (stage.up + front)
        return tilted / np.linalg.norm(tilted)

    def normal(self, stage: Stage) -> np.ndarray:
        """(3,) float, page: unit vector towards the side that is cut away."""
        if self.direction == "top":
            return stage.up
        towards = stage.eye - stage.target
        level = towards - (towards @ stage.up) * stage.up
        if np.linalg.norm(level) < 1e-3 * np.linalg.norm(towards):  # the cameras look straight down
            level = np.roll(stage.up, 1) - (np.roll(stage.up, 1) @ stage.up) * stage.up
        level = level / np.linalg.norm(level)
        return level if self.direction == "front" else np.cross(stage.up, level)
