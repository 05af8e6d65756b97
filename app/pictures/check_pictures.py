"""Pictures of the command `check`: the mesh drawn over each photo, and a contact sheet of all photos."""

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from app.palette import BACKGROUND, LOCKED, POINTS, REJECTED, RGB, START
from fairing.cells.visibility import Visibility
from fairing.check.result import SEEN, SceneCheck
from fairing.scene import Scene

THUMBNAIL = 640
"""Width of a photo on the contact sheet and in the page, px."""
_COLUMNS = 3
_FRAMED = 1e5
"""px: outlines with corners at larger coordinates are not drawn."""


class Line(NamedTuple):
    """One kind of face outline: its colour and its meaning."""

    color: RGB
    meaning: str


IN_PART = Line(START, "face used in this photo")
HELD_BACK = Line(LOCKED, "face used, but not in this photo (hidden, too oblique, too small, at the border)")
OUT = Line(REJECTED, "face not used: fewer than 3 photos see it well enough")


def overlay(scene: Scene, check: SceneCheck, view: int, width: int | None = None) -> np.ndarray:
    """A dimmed photo, (h, w, 3) uint8 RGB, with the outlines of its front-facing faces; masked areas are darker.

    Args:
        view: index of the photo.
        width: of the picture, px; default: that of the photo. Outlines are drawn at this size, so that they stay visible.
    """
    item = scene.views[view]
    photo = item.photo.load()
    scale = 1.0 if width is None else min(1.0, width / photo.shape[1])
    size = (round(photo.shape[1] * scale), round(photo.shape[0] * scale))
    picture = cv2.resize(photo, size, interpolation=cv2.INTER_AREA)
    grey = cv2.cvtColor(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), cv2.COLOR_GRAY2RGB)
    picture = cv2.addWeighted(picture, 0.45, grey, 0.3, 0)
    if item.mask is not None:
        mask = cv2.resize(item.mask.load().astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
        picture[mask == 0] //= 4
    codes = check.visibility[:, view]
    held_back = (Visibility.GRAZING, Visibility.OUTSIDE_PHOTO, Visibility.TOO_SMALL, Visibility.HIDDEN)
    turned = np.isin(codes, [*held_back, *SEEN])
    part = check.faces.takes_part
    uv, _ = item.camera.project(scene.mesh.vertices)
    uv = (uv + 0.5) * scale - 0.5
    # The line width grows with the picture, so that outlines look alike at the same display size.
    thickness = max(1, round(max(size) / 1400))
    for faces, line in (
        (turned & part & ~np.isin(codes, SEEN), HELD_BACK),
        (turned & ~part, OUT),
        (part & np.isin(codes, SEEN), IN_PART),
    ):
        corners = uv[scene.mesh.faces[faces]]
        near = np.abs(corners).max(axis=(1, 2), initial=0) < _FRAMED
        outlines = np.round(corners[near] * 16).astype(np.int32)
        cv2.polylines(picture, list(outlines), True, line.color, thickness, cv2.LINE_AA, shift=4)
    return picture


def contact_sheet(thumbnails: Sequence[np.ndarray], captions: Sequence[str]) -> Image.Image:
    """All pictures in rows of three, each with a caption below it; long captions are truncated."""
    font = ImageFont.load_default(size=15)
    gap, line = 12, 26
    columns = min(_COLUMNS, len(thumbnails))
    cell_width = max(picture.shape[1] for picture in thumbnails)
    cell_height = max(picture.shape[0] for picture in thumbnails) + line
    rows = -(-len(thumbnails) // columns)
    sheet = Image.new("RGB", (columns * (cell_width + gap) + gap, rows * (cell_height + gap) + gap), color=BACKGROUND)
    draw = ImageDraw.Draw(sheet)
    for i, (picture, caption) in enumerate(zip(thumbnails, captions, strict=True)):
        x = gap + i % columns * (cell_width + gap)
        y = gap + i // columns * (cell_height + gap)
        sheet.paste(Image.fromarray(picture), (x, y))
        text = caption
        while len(text) > 1 and draw.textlength(text, font=font) > cell_width:
            text = f"{text[:-2]}…"
        draw.text((x, y + picture.shape[0] + 4), text, fill=POINTS, font=font)
    return sheet
