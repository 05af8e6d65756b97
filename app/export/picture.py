"""Picture of a run: the textured mesh before and after, or at one moment, rendered without a browser."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

from app.export.captions import Caption, error_words, moment_words, residual_words
from app.export.frame import framing_camera
from app.export.run_facts import RunFacts
from app.export.texture_keyframes import KeyframeRenderer, texture_keyframes
from app.palette import BACKGROUND
from fairing.camera import Camera
from fairing.io import write_atomically

SIDE, CAPTION, GAP = 800, 76, 4  # px
TEXELS = 2048


def write_picture(facts: RunFacts, out: Path, moment: int | None, on_progress: Callable[[float], None]) -> None:
    """Write a PNG.

    Args:
        moment: the moment shown; None: start and end side by side.
        on_progress: called with the fraction that is done.
    """
    image = Image.fromarray(picture(facts, moment, on_progress))
    write_atomically(out, lambda file: image.save(file, format="PNG"))


def picture(facts: RunFacts, moment: int | None, on_progress: Callable[[float], None]) -> np.ndarray:
    """(h, w, 3) uint8, RGB; see `write_picture`."""
    moments = [0, facts.length] if moment is None else [moment]
    camera = framed(facts, [0, facts.length, *moments], SIDE)
    renderer = KeyframeRenderer(
        facts, texture_keyframes(facts, sorted(set(moments)), TEXELS, on_progress), camera, BACKGROUND
    )
    caption = Caption(facts, SIDE, CAPTION, with_curve=False)
    parts = []
    for index, m in enumerate(moments):
        words = moment_words(facts, m) if moment is not None else _words(facts, m, ("Before", "After")[index])
        parts.append(np.vstack([renderer.draw(m), caption.strip(words)]))
    gap = np.full((len(parts[0]), GAP, 3), BACKGROUND, dtype=np.uint8)
    return parts[0] if len(parts) == 1 else np.hstack([parts[0], gap, parts[1]])


def framed(facts: RunFacts, moments: list[int], width: int, height: int | None = None) -> Camera:
    """A camera for the mesh at all of these moments; see `framing_camera`."""
    states = [facts.trace.vertices_at(moment) for moment in moments]
    return framing_camera(facts.scene, facts.stage, states, width, height)


def _words(facts: RunFacts, moment: int, head: str) -> list[str]:
    """Caption of start or end, with comparable figures: error, and the residual at the finest level."""
    figures = residual_words(facts, moment)
    if facts.errors is not None:
        figures.insert(0, f"error {error_words(float(facts.errors[moment]))}")
    return [head, ", ".join(figures)]
