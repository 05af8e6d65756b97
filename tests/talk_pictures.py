"""Three pictures for a talk, 1920 x 1080: the cube and the facade before and after, and a capture: its photos and the model.

Before and after show the mesh with the texture of its photos, and below it the place that changed most, magnified.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont, ImageOps

from app.export.captions import DIM, TEXT, error_words
from app.export.picture import framed
from app.export.run_facts import RunFacts
from app.export.texture_keyframes import KeyframeRenderer, texture_keyframes
from app.files.scene_source import SceneSource
from app.palette import BACKGROUND, SELECTED
from demo_scenes import load_demo
from fairing.camera import Camera
from fairing.io.convert import write_capture
from fairing.run.session import Session
from fairing.scene import Scene

NAMES = ("cube", "facade", "capture")
SIZE = (1920, 1080)
HEAD, DETAIL, GAP = 104, 360, 8  # px: heights of the heading and the magnified part, and what separates the halves
HALF = (SIZE[0] - GAP) // 2
MAGNIFIED = 3  # times
TEXELS = 4096
CAPTURE = "building:14"  # its photos and points, without its mesh


def talk_picture(name: str) -> Image.Image:
    """The picture of one of `NAMES`, 1920 x 1080."""
    session = Session(_capture() if name == "capture" else load_demo(name))
    session.run()
    halves = photos_and_model if name == "capture" else before_and_after
    return _side_by_side(halves(RunFacts(session)))


def _capture() -> Scene:
    """A scene whose mesh is triangulated from the points around the building."""
    building = SceneSource.typed(CAPTURE, None, points="automatic").load()
    low, high = building.mesh.vertices.min(axis=0), building.mesh.vertices.max(axis=0)
    margin = 0.02 * (high - low)
    with tempfile.TemporaryDirectory() as folder:
        write_capture(Path(folder), "scene.json", building.views, building.sparse_points)
        box = (*(low - margin).tolist(), *(high + margin).tolist())
        scene = SceneSource.typed(folder, None, box=box).load()
    # The folder is gone: the photos are those of the building.
    return replace(scene, views=building.views)


def photos_and_model(facts: RunFacts) -> list[Image.Image]:
    """The photos in a grid, and the textured mesh at the end."""
    size = (HALF, SIZE[1] - HEAD)
    keyframes = texture_keyframes(facts, [facts.length], TEXELS, lambda fraction: None)
    camera = framed(facts, [facts.length], *size)
    model = KeyframeRenderer(facts, keyframes, camera, BACKGROUND).draw(facts.length)
    faces = f"{len(facts.scene.mesh.faces)} faces, textured from the photos"
    return [
        _half(f"{len(facts.scene.views)} photos", "with their cameras, without a mesh", _grid(facts.scene, size)),
        _half("The model made of them", faces, Image.fromarray(model)),
    ]


def _grid(scene: Scene, size: tuple[int, int]) -> Image.Image:
    """All photos, in as many columns as make them largest."""
    count, camera = len(scene.views), scene.views[0].camera

    def scale(columns: int) -> float:
        return min(size[0] / columns / camera.width, size[1] / -(-count // columns) / camera.height)

    columns = max(range(1, count + 1), key=scale)
    width, height = int(scale(columns) * camera.width), int(scale(columns) * camera.height)
    grid = Image.new("RGB", size, BACKGROUND)
    left = (size[0] - columns * width) // 2
    for k, view in enumerate(scene.views):
        photo = ImageOps.contain(Image.fromarray(view.photo.load()), (width - GAP, height - GAP))
        grid.paste(photo, (left + k % columns * width, k // columns * height))
    return grid


def before_and_after(facts: RunFacts) -> list[Image.Image]:
    """Start and end of a run."""
    moments = [0, facts.length]
    keyframes = texture_keyframes(facts, moments, TEXELS, lambda fraction: None)

    def draw(camera: Camera) -> list[np.ndarray]:
        renderer = KeyframeRenderer(facts, keyframes, camera, BACKGROUND)
        return [renderer.draw(moment) for moment in moments]

    overview = framed(facts, moments, HALF, SIZE[1] - HEAD - DETAIL - GAP)
    pictures = draw(overview)
    box = _most_changed(pictures[0], pictures[1], (HALF // MAGNIFIED, DETAIL // MAGNIFIED))
    parts = draw(_magnified(overview, box))
    return [
        _half(head, _words(facts, moment), _with_detail(picture, part, box))
        for head, moment, picture, part in zip(("Before", "After"), moments, pictures, parts, strict=True)
    ]


def _most_changed(before: np.ndarray, after: np.ndarray, size: tuple[int, int]) -> tuple[int, int, int, int]:
    """Left, top, right and bottom, px, of the window of a size (width, height) in which two pictures differ most."""
    width, height = size
    change = np.abs(before.astype(np.float32) - after).mean(axis=2)
    sums = cv2.boxFilter(change, -1, size, anchor=(0, 0), normalize=False)[: 1 - height, : 1 - width]
    top, left = (int(at) for at in np.unravel_index(sums.argmax(), sums.shape))
    return left, top, left + width, top + height


def _magnified(camera: Camera, box: tuple[int, int, int, int]) -> Camera:
    """The camera of a part of a camera's picture, `MAGNIFIED` times as large."""
    left, top, right, bottom = box
    shift = [MAGNIFIED * (0.5 - at) - 0.5 for at in (left, top)]
    part = np.array([[MAGNIFIED, 0, shift[0]], [0, MAGNIFIED, shift[1]], [0, 0, 1]]) @ camera.image_from_world
    return Camera(part, MAGNIFIED * (right - left), MAGNIFIED * (bottom - top))


def _words(facts: RunFacts, moment: int) -> str:
    """What is wrong with the mesh at a moment, in figures that compare."""
    assert facts.errors is not None
    error = error_words(float(facts.errors[moment]))
    return f"vertices off by {error}, photos apart by {facts.residual(moment).mean:.2g} grey levels"


def _with_detail(picture: np.ndarray, part: np.ndarray, box: tuple[int, int, int, int]) -> Image.Image:
    """A picture, and below it the part within a box, magnified."""
    height = SIZE[1] - HEAD
    shown = Image.new("RGB", (HALF, height), BACKGROUND)
    shown.paste(Image.fromarray(picture), (0, 0))
    shown.paste(Image.fromarray(part), (0, height - DETAIL))
    draw = ImageDraw.Draw(shown)
    for corners in (box, (0, height - DETAIL, HALF - 1, height - 1)):
        draw.rectangle(corners, outline=SELECTED, width=3)
    return shown


def _half(head: str, words: str, shown: Image.Image) -> Image.Image:
    half = Image.new("RGB", (HALF, SIZE[1]), BACKGROUND)
    draw = ImageDraw.Draw(half)
    draw.text((24, 10), head, TEXT, ImageFont.load_default(44))
    draw.text((26, 66), words, DIM, ImageFont.load_default(24))
    half.paste(shown, (0, HEAD))
    return half


def _side_by_side(halves: list[Image.Image]) -> Image.Image:
    shown = Image.new("RGB", SIZE, BACKGROUND)
    for k, half in enumerate(halves):
        shown.paste(half, (k * (HALF + GAP), 0))
    return shown
