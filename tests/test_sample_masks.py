"""Depth maps and sample masks against slow loops written from their definitions."""

from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from fairing.camera import Camera
from fairing.cells.depth_map import depth_map
from fairing.cells.layout import plan_cells
from fairing.cells.sample_masks import mask_views
from fairing.cells.visibility import Visibility, footprints_in_views
from fairing.geometry.rasterize import HIDDEN_DEPTH, rasterize
from fairing.options import FairingOptions, VisibilityOptions
from tests.terrain_scene import pinhole

pytestmark = pytest.mark.compiled

SMALL = Camera(np.diag([0.125, 0.125, 1]) @ pinhole([1.0, -2.0, 3.0], [0, 0, 0]).image_from_world, 80, 60)


def slow_raster(vertices: np.ndarray, faces: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """The nearest face at each pixel centre and its inverse depth, every face tried at every pixel."""
    ys, xs = np.mgrid[: camera.height, : camera.width]
    face_id, inverse = np.full(ys.shape, -1), np.zeros(ys.shape)
    for f, face in enumerate(faces):
        uv, depth = camera.project(vertices[face])
        if (depth <= 0).any():
            continue
        M = np.vstack([uv.T, np.ones(3)])
        weights = np.linalg.solve(M, np.stack([xs.ravel(), ys.ravel(), np.ones(xs.size)])).reshape(3, *ys.shape)
        here = np.where((weights >= -1e-9).all(axis=0), np.tensordot(1 / depth, weights, 1), 0)
        face_id[here > inverse] = f
        inverse = np.maximum(inverse, here)
    return face_id, inverse


@pytest.mark.parametrize("seed", range(6))
def test_the_nearest_face_is_found_at_every_pixel(seed: int):
    rng = np.random.default_rng(seed)
    centers = rng.uniform(-1.2, 1.2, (60, 1, 3))
    vertices = (centers + rng.normal(size=(60, 3, 3)) * rng.choice([0.02, 0.3, 1.0], (60, 1, 1))).reshape(-1, 3)
    faces = np.arange(180).reshape(-1, 3)
    face_id, depth = rasterize(vertices, faces, SMALL)
    expected, inverse = slow_raster(vertices, faces, SMALL)
    assert len(np.unique(expected)) > 20
    np.testing.assert_array_equal(face_id, expected)
    np.testing.assert_allclose(1 / depth, inverse, rtol=1e-9, atol=1e-12)


def folded_mesh(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A rough terrain with a plate above it that hides a part."""
    n = 9
    x, y = np.meshgrid(np.linspace(-1.6, 1.6, n), np.linspace(-1.2, 1.2, n), indexing="ij")
    ground = np.stack([x, y, 0.25 * rng.random((n, n))], axis=-1).reshape(-1, 3)
    a = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    cells = np.concatenate([np.stack([a, a + n, a + 1], 1), np.stack([a + n, a + n + 1, a + 1], 1)])
    plate = np.array([[-0.5, -0.4, 0.9], [0.5, -0.4, 1.0], [0.5, 0.4, 0.8], [-0.5, 0.4, 0.9]])
    faces = np.concatenate([cells, len(ground) + np.array([[0, 1, 2], [0, 2, 3]])])
    return np.concatenate([ground, plate]), faces


@pytest.mark.parametrize(("blur", "reduction"), [(0.5, 1), (0.5, 2), (1.2, 4), (3.6, 2), (6.0, 3)])
def test_a_mask_has_the_samples_that_the_photo_shows(blur: float, reduction: int):
    rng = np.random.default_rng(int(10 * blur) + reduction)
    vertices, faces = folded_mesh(rng)
    cameras = [pinhole([x, y, 3.5], [0.1, 0, 0]) for x, y in ((0.1, 0), (-2, 1), (3, 1), (-3, -2))]
    options = VisibilityOptions(reduction=reduction)
    is_used = np.ones((-(-480 // reduction), -(-640 // reduction)), dtype=bool)
    is_used[10:40, 60:90] = False
    photos = SimpleNamespace(mask=lambda view, _: is_used if view == 1 else None)
    with ThreadPoolExecutor(1) as pool:
        outlines = footprints_in_views(vertices, faces, cameras, 1, options, blur, pool)
        reasons = outlines.reason
        is_candidate = reasons == Visibility.SEEN
        layout = plan_cells(
            FairingOptions().with_levels(blur=(blur,)),
            0,
            outlines.longest_edge,
            outlines.height,
            is_candidate,
        )
        found = mask_views(
            vertices, faces, cameras, photos, layout, options, blur, reasons, None, pool, lambda: None  # pyright: ignore[reportArgumentType]
        )  # fmt: skip
    kinds = set()
    for v, camera in enumerate(cameras):
        masks = np.split(found[v].masks, np.cumsum(layout.samples[found[v].faces])[:-1])
        mask_of = dict(zip(found[v].faces.tolist(), masks, strict=True))
        depths = depth_map(vertices, faces, camera, reduction, photos.mask(v, reduction))
        distance = reduction * distance_transform_edt(depths.edges == 0) if depths.edges.any() else np.inf
        clear = np.broadcast_to(distance >= options.edge_margin * blur + 1, depths.edges.shape)
        for f in np.flatnonzero(is_candidate[:, v]):
            grid = layout.face_grid[f]
            ramp = layout.ramp[:, layout.grid_start[grid] : layout.grid_start[grid + 1]].astype(float)
            a, b = layout.inset[f] + (1 - 3 * layout.inset[f]) * ramp
            uv, depth = camera.project(np.stack([a, b, 1 - a - b], 1) @ vertices[faces[f]])
            x, y = uv.T
            inside = (np.minimum(x, y) >= 1 + blur) & (x <= 638 - blur) & (y <= 478 - blur)
            row, column = (np.where(inside, (at + 0.5) / reduction, 0).astype(int) for at in (y, x))
            nearer = 1 - HIDDEN_DEPTH * reduction / depths.focal_length
            seen = inside & clear[row, column] & (depths.inverse_depth[row, column] * depth * nearer <= 1)
            kind = reasons[f, v]
            kinds.add(Visibility(kind))
            if seen.all():
                assert kind == Visibility.SEEN
            elif seen.sum() < options.min_samples * len(seen):
                assert kind == Visibility.HIDDEN
            else:
                assert kind == Visibility.PARTLY_SEEN
                np.testing.assert_array_equal(mask_of[f], seen)
    assert kinds == {Visibility.SEEN, Visibility.PARTLY_SEEN, Visibility.HIDDEN}
