"""Cell data of the replay page: tiles of the photos and the parameters of each sweep.

The page computes the cells of a face at any moment itself (`web/photos.js`, `web/eigenspace.js`), because pictures of
all cells would be far larger than the lossless photo tiles around the faces (ledger: replay cells). Neighbouring faces
share tiles.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.export.packing import packed
from app.export.run_facts import RunFacts
from fairing.cells.context import CellContext
from fairing.cells.pair_photos import ANTI_ALIASING, blur_octaves, blur_of_octave
from fairing.cells.point_spread import missing_blur
from fairing.cells.scale_space import ScaleSpace
from fairing.errors import InputError
from fairing.judge.inspect import FaceCells, face_cells
from fairing.run.sweep import SweepState

ALL_FACES = 24  # a mesh with at most this many faces has the cells of all of them in the file
CHOSEN_VERTICES = 24  # of larger meshes: vertices whose faces may have cells in the file
PIXELS = 3_000_000  # limit of photo pixels in the file: about 3 MB
TILE = 32  # px
MARGIN = 9  # px around a face: the page blurs a larger area, which stays valid for the next moments


@dataclass(frozen=True, eq=False)
class _Sweep:
    """Parameters of one sweep for F faces, with P pairs of face and photo.

    Attributes:
        key: first moment and level of the sweep; unique.
        k, size, inset, scale: (F,): dimensions, samples along a cell's edge, inset (barycentric), scale of the robust
            norm (sigma squared, grey levels squared).
        starts: (F + 1,) int: index of the first pair of each face.
        views, weight: (P,): photo of each pair and its weight.
        blur: (P, 3) float32: covariance xx, xy, yy of the blur of the photo, px^2.
        masks: for each pair a bit per sample, 1 if it counts; empty if all samples count.
        is_common: whether all photos of a face are blurred to a common point spread function.
    """

    key: tuple[int, int]
    k: np.ndarray
    size: np.ndarray
    inset: np.ndarray
    scale: np.ndarray
    starts: np.ndarray
    views: np.ndarray
    weight: np.ndarray
    blur: np.ndarray
    masks: list[np.ndarray]
    is_common: bool


def chosen_vertices(facts: RunFacts) -> np.ndarray:
    """(n,) int: vertex ids, largest displacement first; vertices with unused faces come last."""
    displacement = np.linalg.norm(facts.trace.vertices_at(facts.length) - facts.trace.start, axis=1)
    takes_part = facts.session.sweep_state(facts.length).context.takes_part
    is_seen = np.array([takes_part[ring].all() for ring in facts.scene.mesh.one_rings])
    return np.lexsort([-displacement, ~is_seen])


def cells_of_run(facts: RunFacts, on_progress: Callable[[float], None]) -> dict[str, Any]:
    """Photo tiles, sweep parameters, and the faces they are for.

    These are all faces of a small mesh; of a large mesh the faces around the vertices that moved most, up to `PIXELS`.
    """
    (cells,), photos = cells_of_runs([facts], on_progress)
    return cells | {"photos": photos}


def cells_of_runs(
    runs: Sequence[RunFacts], on_progress: Callable[[float], None], reach: float = 0.0
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """The faces with the sweep parameters of each run, and the photo tiles of all runs.

    Args:
        runs: on the same scene, with the same channels. The faces of a large mesh are chosen by the first run.
        reach: how far a reader may move a single vertex from the positions of a run, world units.
    """
    facts = runs[0]
    groups = _groups(facts)
    faces = [face for group in groups for face in group]
    found = []
    for n, run in enumerate(runs):
        sweeps, sweep_at = _sweeps(run, faces, lambda fraction, n=n: on_progress(0.9 * (n + fraction) / len(runs)))
        found.append((run, sweeps, sweep_at, _tiles_of_faces(run, faces, sweeps, sweep_at, reach)))
    kept, wanted, count = [], [set[int]() for _ in facts.scene.views], 0
    channels = 3 if facts.options.cells.color else 1
    for group in groups:
        joined = [old.union(*(tiles[face][v] for *_, tiles in found for face in group)) for v, old in enumerate(wanted)]
        count = channels * TILE * TILE * sum(map(len, joined))
        if kept and count > PIXELS:
            break
        wanted = joined
        kept += group
    rows = [index for index, face in enumerate(faces) if face in set(kept)]
    cells = [_cells_of(run, kept, rows, sweeps, sweep_at) for run, sweeps, sweep_at, _ in found]
    return cells, _photos(facts, wanted, lambda fraction: on_progress(0.9 + 0.1 * fraction))


def _cells_of(
    facts: RunFacts, kept: list[int], rows: list[int], sweeps: list[_Sweep], sweep_at: np.ndarray
) -> dict[str, Any]:
    options, norm = facts.options, facts.session.norm
    return {
        "faces": kept,
        "scales": [_scales(facts, face) for face in kept],
        "sweepAt": packed(sweep_at.astype(np.uint16)),
        "sweeps": _packed_sweeps(facts, sweeps, rows),
        "affine": options.cells.warp == "affine",
        "removeBias": options.cells.remove_bias,
        "centered": options.eigenspace.centered,
        "norm": packed(norm.table),
        "threshold": norm.outlier_threshold if np.isfinite(norm.outlier_threshold) else None,
    }


def _groups(facts: RunFacts) -> list[list[int]]:
    """Groups of faces that are added to the file together: the new faces of each chosen vertex."""
    mesh = facts.scene.mesh
    if len(mesh.faces) <= ALL_FACES:
        return [list(range(len(mesh.faces)))]
    groups, known = [], set[int]()
    for vertex in chosen_vertices(facts)[:CHOSEN_VERTICES].tolist():
        ring = [int(face) for face in mesh.one_rings[vertex] if face not in known]
        known.update(ring)
        groups.append(ring)
    return groups


def _sweeps(facts: RunFacts, faces: list[int], on_progress: Callable[[float], None]) -> tuple[list[_Sweep], np.ndarray]:
    """The sweeps, and the index of the sweep of each moment (moments,)."""
    found: dict[tuple[int, int], int] = {}
    sweeps: list[_Sweep] = []
    sweep_at = np.empty(facts.length + 1, dtype=np.int64)
    for moment in range(facts.length + 1):
        state = facts.session.sweep_state(moment)
        key = (state.moment, state.context.level)
        if key not in found:
            found[key] = len(sweeps)
            sweeps.append(_choices(facts, key, state, faces))
        sweep_at[moment] = found[key]
        on_progress(moment / (facts.length + 1))
    return sweeps, sweep_at


def _choices(facts: RunFacts, key: tuple[int, int], state: SweepState, faces: list[int]) -> _Sweep:
    context = state.context
    data = context.kernel
    pairs = [np.arange(data.pair_start[face], data.pair_start[face + 1]) for face in faces]
    joined = np.concatenate(pairs)
    starts = np.cumsum([0, *map(len, pairs)])
    sizes = _cell_sizes(context)[data.face_grid[faces]]
    masks = []
    for row, of_face in enumerate(pairs):
        samples = sizes[row] * (sizes[row] + 1) // 2
        masks += [_bits(data.masks, start, samples) for start in data.pair_mask[of_face].tolist()]
    is_common = facts.options.levels[context.level].point_spread == "common" and not context.point_spread_fallback
    of_pairs = np.repeat(sizes, np.diff(starts))
    return _Sweep(
        key=key,
        k=data.face_dimensions[faces],
        size=sizes,
        inset=data.face_inset[faces],
        scale=state.scale[faces],
        starts=starts,
        views=data.pair_view[joined],
        weight=data.pair_weight[joined],
        blur=_blur(facts, context, np.array(faces), data.pair_view[joined], starts, of_pairs, is_common),
        masks=masks,
        is_common=is_common,
    )


def _bits(masks: np.ndarray, start: int, count: int) -> np.ndarray:
    return np.packbits(masks[start : start + count] > 0) if start >= 0 else np.zeros(0, dtype=np.uint8)


def _cell_sizes(context: CellContext) -> np.ndarray:
    samples = np.diff(context.kernel.grid_start)
    return ((np.sqrt(8 * samples + 1) - 1) / 2).round().astype(np.int64)


def _blur(
    facts: RunFacts,
    context: CellContext,
    faces: np.ndarray,
    views: np.ndarray,
    starts: np.ndarray,
    sizes: np.ndarray,
    is_common: bool,
) -> np.ndarray:
    """(P, 3) float: covariance xx, xy, yy, px^2, of each pair's blur, as in `fairing.cells.context.build_context`."""
    blur = facts.options.levels[context.level].blur
    cameras = [view.camera for view in facts.scene.views]
    corners = context.vertices[facts.scene.mesh.faces[faces]]
    face = np.repeat(np.arange(len(faces)), np.diff(starts))
    edges = np.zeros((len(face), 3, 2))
    for pair, (f, view) in enumerate(zip(face, views, strict=True)):
        uv = cameras[view].project(corners[f])[0]
        edges[pair] = np.roll(uv, -1, axis=0) - uv
    spacing = np.linalg.norm(edges, axis=2).max(axis=1) / sizes
    if is_common:
        least = np.maximum(blur, ANTI_ALIASING * spacing)
        covariance = missing_blur(cameras, views, starts, corners, least)
        return covariance.reshape(-1, 4)[:, [0, 1, 3]]
    octaves = blur_octaves(spacing, blur)
    sigma = np.array([blur_of_octave(octave, blur) for octave in octaves.tolist()])
    return np.stack([sigma**2, np.zeros(len(face)), sigma**2], axis=1)


def _tiles_of_faces(
    facts: RunFacts, faces: list[int], sweeps: list[_Sweep], sweep_at: np.ndarray, reach: float
) -> dict[int, list[set[int]]]:
    """For each face id and photo the numbers of the tiles that its cells read at any moment."""
    cameras = [view.camera for view in facts.scene.views]
    positions = np.stack(
        [facts.trace.vertices_at(moment)[facts.scene.mesh.faces[faces]] for moment in range(facts.length + 1)]
    )
    tiles: dict[int, list[set[int]]] = {face: [set() for _ in cameras] for face in faces}
    for number, sweep in enumerate(sweeps):
        moments = np.flatnonzero(sweep_at == number)
        for row, face in enumerate(faces):
            points = _within_reach(positions[moments, row], reach)
            for pair in range(sweep.starts[row], sweep.starts[row + 1]):
                view = int(sweep.views[pair])
                uv, depth = cameras[view].project(points)
                if (depth <= 0).any():
                    continue
                border = MARGIN + np.ceil(4 * np.sqrt(sweep.blur[pair, [0, 2]].max())) + 4
                size = np.array([cameras[view].width, cameras[view].height])
                low = np.clip(np.floor(uv.min(0) - border), 0, size - 1).astype(int) // TILE
                high = np.clip(np.ceil(uv.max(0) + border), 0, size - 1).astype(int) // TILE
                across = -(-size[0] // TILE)
                rows, columns = np.mgrid[low[1] : high[1] + 1, low[0] : high[0] + 1]
                tiles[face][view].update((rows * across + columns).ravel().tolist())
    return tiles


def _within_reach(corners: np.ndarray, reach: float) -> np.ndarray:
    """(n, 3) float: the corners of a face at some moments (moments, 3, 3), and with one of them moved by up to `reach`."""
    if not reach:
        return corners.reshape(-1, 3)
    signs = np.stack(np.meshgrid(*[(-1, 1)] * 3), axis=-1).reshape(-1, 1, 3)
    return (corners.reshape(-1, 3) + reach * signs).reshape(-1, 3)


def _scales(facts: RunFacts, face: int) -> dict[str, float]:
    """Residual at full colour and energy of a full bar: the larger values of start and end."""
    residual, energy = 1.0, 0.0
    for moment in sorted({0, facts.length}):
        cells = _cells(facts, face, moment)
        if cells is not None:
            residual = max(residual, float(np.percentile(np.abs(cells.residual[cells.counts]), 99)))
            energy = max(energy, float(cells.view_energy.max()))
    return {"residual": residual, "energy": energy}


def _cells(facts: RunFacts, face: int, moment: int) -> FaceCells | None:
    """The cells of a face; None if it is not used or has a corner behind a camera."""
    try:
        cells = face_cells(facts.session, face, moment)
    except InputError:
        return None
    return cells if cells.takes_part and cells.counts.any() else None


def _packed_sweeps(facts: RunFacts, sweeps: list[_Sweep], rows: list[int]) -> dict[str, Any]:
    """Parameters of all sweeps for the F faces in the file; row sweep * F + face belongs to a sweep and a face."""
    parts = [(sweep, row) for sweep in sweeps for row in rows]
    pairs = [(sweep, np.arange(sweep.starts[row], sweep.starts[row + 1])) for sweep, row in parts]
    masks = [sweep.masks[pair] for sweep, of_face in pairs for pair in of_face]

    def of_faces(name: str, kind: type) -> dict[str, Any]:
        return packed(np.array([getattr(sweep, name)[row] for sweep, row in parts], dtype=kind))

    def of_pairs(name: str, kind: type) -> dict[str, Any]:
        values = [getattr(sweep, name)[of_face] for sweep, of_face in pairs]
        return packed(np.concatenate([np.zeros(0), *values], axis=None).astype(kind))

    levels = [sweep.key[1] for sweep in sweeps]
    options = facts.options
    return {
        "level": levels,
        "cubic": [options.levels[level].interpolation == "cubic" for level in levels],
        "common": [sweep.is_common for sweep in sweeps],
        "k": of_faces("k", np.uint8),
        "size": of_faces("size", np.uint16),
        "inset": of_faces("inset", np.float32),
        "scale": of_faces("scale", np.float32),
        "starts": packed(np.cumsum([0, *(len(of_face) for _, of_face in pairs)]).astype(np.uint32)),
        "views": of_pairs("views", np.uint16),
        "weight": of_pairs("weight", np.float32),
        "blur": of_pairs("blur", np.float32),
        "maskStarts": packed(np.cumsum([0, *map(len, masks)]).astype(np.uint32)),
        "masks": packed(np.concatenate([np.zeros(0, np.uint8), *masks])),
    }


def _steps(values: np.ndarray) -> np.ndarray:
    """int16: differences of successive values, which compress better because neighbouring pixels are similar."""
    return np.diff(values.astype(np.int64), prepend=0).astype(np.int16)


def _photos(facts: RunFacts, wanted: list[set[int]], on_progress: Callable[[float], None]) -> dict[str, Any]:
    """The tiles of all photos in the integer units of `ScaleSpace`, as differences of successive values."""
    space = ScaleSpace(facts.scene, facts.options.cells.color)
    views: list[dict[str, Any]] = [{} for _ in wanted]

    def cut(view: int, photo: np.ndarray) -> None:
        channels, height, width = photo.shape
        padded = np.pad(photo, [(0, 0), (0, -height % TILE), (0, -width % TILE)], mode="edge")
        tiles = padded.reshape(channels, -(-height // TILE), TILE, -(-width // TILE), TILE).transpose(1, 3, 0, 2, 4)
        numbers = sorted(wanted[view])
        values = tiles.reshape(-1, channels * TILE * TILE)[numbers].ravel()
        views[view] = {"tiles": packed(np.array(numbers, dtype=np.uint32)), "pixels": packed(_steps(values))}

    with ThreadPoolExecutor() as pool:
        space.for_each([view for view, numbers in enumerate(wanted) if numbers], cut, pool)
    on_progress(1.0)
    stage = facts.stage
    place = np.concatenate([np.diag(np.full(3, 1 / stage.scale)), stage.origin[:, None]], axis=1)
    world_from_page = np.concatenate([place, [[0, 0, 0, 1]]])
    for view, found in zip(facts.scene.views, views, strict=True):
        camera = view.camera
        found.update(
            name=view.name,
            width=camera.width,
            height=camera.height,
            imageFromPage=(camera.image_from_world @ world_from_page).ravel().tolist(),
        )
    return {"tile": TILE, "channels": space.channels, "unit": float(space.grey_levels), "views": views}
