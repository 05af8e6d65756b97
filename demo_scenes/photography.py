"""Photos of a scene: flaws of real photography, rendering in threads, and the resulting views."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace

import numpy as np

from demo_scenes.cache import cached_photos
from demo_scenes.lens import BLUR, expose
from demo_scenes.lighting import light_lattice
from demo_scenes.noise import seeded
from demo_scenes.occluders import passer_by, pole_and_leaves
from demo_scenes.surface import Stage
from fairing.camera import Camera
from fairing.photo import ArrayPhoto
from fairing.scene import View

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Photography:
    """Settings of the photos of a demo scene; the defaults are ideal.

    Attributes:
        noise: standard deviation of the sensor's noise, grey levels.
        exposure: largest gain error of a photo; 0.15 is +-15 %, drawn for each photo.
        occluders: a pole, leaves and passers-by stand in front of the scene; the mesh does not contain them.
        gloss: the surface has a specular highlight, which moves with the camera.
        blank_wall: one wall is of a single colour (scenes without a wall ignore it).
        seed: seed of all random numbers.
        blur: largest blur of a photo beyond the lens's own, pixels (sigma); drawn for each photo.
    """

    noise: float = 0.0
    exposure: float = 0.0
    occluders: bool = False
    gloss: bool = False
    blank_wall: bool = False
    seed: int = 0
    blur: float = 0.0


GLOSS_LEVELS = 70.0


def take_photos(
    scene: str,
    cameras: Sequence[Camera],
    build_stage: Callable[[], Stage],
    subject: np.ndarray,
    photography: Photography,
    samples: int,
    progress: Progress | None,
    variant: str = "",
) -> tuple[View, ...]:
    """Views of a scene; the photos are rendered on first use and cached.

    Args:
        build_stage: builds what the cameras see; called only if photos have to be rendered.
        subject: (n, 3) float, points of the photographed object; occluders stand in front of them.
        samples: rays along a pixel's side.
        variant: anything else the photos depend on; part of the cache key.
    """

    def shoot() -> np.ndarray:
        report(0.0, f"{scene}: painting textures")
        stage = build_stage()
        report(0.2, f"{scene}: light and shadow")
        if photography.occluders:
            stage = replace(
                stage, surface=stage.surface.joined(pole_and_leaves(subject, cameras, stage.up, photography.seed))
            )
        light = light_lattice(stage)
        photos = np.zeros(shape, np.uint8)

        def take(k: int) -> None:
            seen, lit = stage, light
            if photography.occluders:
                person = passer_by(subject, cameras[k], stage.up, seeded(photography.seed, k, 22))
                seen = replace(stage, surface=stage.surface.joined(person))
                lit = np.concatenate([light, np.ones((len(person.faces), *light.shape[1:]))])
            photos[k] = _develop(expose(seen, lit, cameras[k], samples, _blur_of(photography, k)), photography, k)

        with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
            waiting = [pool.submit(take, k) for k in range(len(cameras))]
            try:
                for count, future in enumerate(as_completed(waiting), start=1):
                    future.result()
                    report(0.3 + 0.7 * count / len(cameras), f"{scene}: photo {count} of {len(cameras)}")
            finally:
                # After an interruption, photos that have not been started are cancelled.
                pool.shutdown(cancel_futures=True)
        return photos

    def report(fraction: float, message: str) -> None:
        if progress is not None:
            progress(fraction, message)

    shape = (len(cameras), cameras[0].height, cameras[0].width, 3)
    matrices = [camera.image_from_world.tolist() for camera in cameras]
    photos = cached_photos(scene, f"{photography} {samples} {variant} {matrices}", shape, shoot)
    report(1.0, f"{scene}: ready")
    return tuple(
        View(f"{scene}_{k:02d}.png", camera, ArrayPhoto(photo))
        for k, (camera, photo) in enumerate(zip(cameras, photos, strict=True))
    )


def looking_at(
    eye: np.ndarray, target: np.ndarray, up: np.ndarray, focal_px: float, width: int, height: int, roll: float = 0.0
) -> Camera:
    """A camera at `eye` with `target` in the photo's centre, `up` upwards, then turned by `roll` radians."""
    forward = np.asarray(target, float) - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    right, down = np.cos(roll) * right + np.sin(roll) * down, np.cos(roll) * down - np.sin(roll) * right
    R = np.array([right, down, forward])
    K = np.array([[focal_px, 0, (width - 1) / 2], [0, focal_px, (height - 1) / 2], [0, 0, 1]])
    return Camera.from_krt(K, R, -R @ eye, width, height)


def _blur_of(photography: Photography, photo_id: int) -> float:
    """Sigma of a photo's blur, pixels: the lens's, and independent of it what was drawn for the photo."""
    return float(np.hypot(BLUR, photography.blur * seeded(photography.seed, photo_id, 23).random()))


def _develop(levels: np.ndarray, photography: Photography, photo_id: int) -> np.ndarray:
    """8-bit pixels of a noiseless photo in grey levels: gain, then noise, then rounding."""
    rng = seeded(photography.seed, photo_id, 21)
    gain = 1 + photography.exposure * rng.uniform(-1, 1)
    noise = photography.noise * rng.standard_normal(levels.shape) if photography.noise > 0 else 0.0
    return np.clip(np.rint(gain * levels + noise), 0, 255).astype(np.uint8)
