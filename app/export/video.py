"""Video of a run: the moving textured mesh with captions, rendered and encoded without a browser.

MP4 and WebM files contain VP9, the only codec in OpenCV's build that browsers play: H.264 is missing, and browsers do
not play MPEG-4 part 2.
"""

import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from app.export.captions import Caption, moment_words
from app.export.picture import framed
from app.export.run_facts import RunFacts
from app.export.texture_keyframes import KeyframeRenderer, texture_keyframes
from app.palette import BACKGROUND
from fairing.errors import InputError
from fairing.io import write_atomically

CODECS = {".mp4": "vp09", ".webm": "VP90"}
KEYFRAMES = 8
SECONDS, HELD_SECONDS = 7.0, 1.5  # of movement; of rest at the start and at the end
VIDEO_SIZE, VIDEO_RATE = (960, 540), 24
GIF_SIZE, GIF_RATE = (640, 360), 10
GIF_COLORS = 160
CAPTION_SHARE = 0.17


def write_video(facts: RunFacts, out: Path, on_progress: Callable[[float], None]) -> None:
    """Write an MP4, a WebM or a GIF, depending on the suffix.

    Raises:
        InputError: this build of OpenCV cannot encode it.
    """
    is_gif = out.suffix.lower() == ".gif"
    (width, height), rate = (GIF_SIZE, GIF_RATE) if is_gif else (VIDEO_SIZE, VIDEO_RATE)
    frames = film(facts, width, height, rate, on_progress)
    if is_gif:
        images = [Image.fromarray(frame).quantize(GIF_COLORS, dither=Image.Dither.NONE) for frame in frames]
        write_atomically(
            out,
            lambda file: images[0].save(
                file, format="GIF", save_all=True, append_images=images[1:], duration=round(1000 / rate), loop=0
            ),
        )
        return
    with tempfile.TemporaryDirectory() as folder:
        aside = Path(folder) / out.with_suffix(out.suffix.lower()).name
        writer = cv2.VideoWriter(str(aside), cv2.VideoWriter.fourcc(*CODECS[aside.suffix]), rate, (width, height))
        if not writer.isOpened():
            raise InputError(f"{out}: this build of OpenCV cannot encode VP9; write a .gif instead")
        for frame in frames:
            writer.write(np.ascontiguousarray(frame[..., ::-1]))
        writer.release()
        with aside.open("rb") as source:
            write_atomically(out, lambda file: shutil.copyfileobj(source, file))


def film(
    facts: RunFacts, width: int, height: int, rate: int, on_progress: Callable[[float], None]
) -> Iterator[np.ndarray]:
    """The frames, (height, width, 3) uint8 RGB, with pauses at the start and at the end."""
    strip = round(CAPTION_SHARE * height)
    moments = facts.key_moments(KEYFRAMES)
    camera = framed(facts, moments, width, height - strip)
    keyframes = texture_keyframes(facts, moments, width, lambda fraction: on_progress(0.3 * fraction))
    renderer, caption = (
        KeyframeRenderer(facts, keyframes, camera, BACKGROUND),
        Caption(facts, width, strip, with_curve=True),
    )
    shown = shown_moments(facts, rate)
    frame, last = np.zeros((height, width, 3), dtype=np.uint8), -1.0
    for k, moment in enumerate(shown):
        if moment != last:
            words = moment_words(facts, int(moment))
            frame, last = np.vstack([renderer.draw(moment), caption.strip(words, moment)]), moment
        yield frame
        on_progress(0.3 + 0.7 * (k + 1) / len(shown))


def shown_moments(facts: RunFacts, rate: int) -> list[float]:
    """The moment of every frame, evenly spaced by `RunFacts.pace`; it may lie between two recorded moments."""
    held = round(HELD_SECONDS * rate)
    if facts.length == 0:
        return [0.0] * (2 * held)
    moving = np.interp(np.linspace(0, 1, round(SECONDS * rate)), facts.pace, np.arange(facts.length + 1))
    return [0.0] * held + moving.tolist() + [float(facts.length)] * held
