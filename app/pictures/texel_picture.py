"""Picture of the residuals or the flow at the samples of the cells, as a texture of the mesh, in the colours of the legend.

The samples of a face are copied into the texture as they are, in their triangle; two triangles of one size
share a square. The
border that the cells leave out, and a few texels beyond it for the filtering, repeat the nearest sample.
"""

import io
from dataclasses import dataclass, replace

import numpy as np
from PIL import Image

from app.pictures.coloring import UNKNOWN, Coloring, Legend, Scale, by_value, by_vector, color_map, wheel_colors
from fairing.judge.texels import Texels
from fairing.texture.layout import pack_in_pairs

# Texels per side, which any graphics card can hold. Where the samples do not fit, blocks of 2 x 2, 3 x 3 ... are averaged.
LARGEST = 4096
LEAST_SIZE = 8  # samples along a leg that averaging leaves
SHADES = 255  # of the scale in the palette
UNKNOWN_INDEX = SHADES  # the last entry of the palette


@dataclass(frozen=True, eq=False)
class TexelPicture:
    """A texture of the values at the samples.

    Attributes:
        uv: (m, 3, 2) float: texture coordinates of the corners of the faces, 0 to 1, origin at the top left.
        picture: the texture, a PNG file.
        texels: number of its pixels.
        legend: its `unknown` counts the faces without any known sample.
        blur: px, see `Texels`.
    """

    uv: np.ndarray
    picture: bytes
    texels: int
    legend: Legend
    blur: float


@dataclass(frozen=True, eq=False)
class _Grids:
    """How the samples of the faces that have any lie in the texture, f faces, after averaging.

    Attributes:
        size: (f,) int: samples along a leg, N.
        margin: (f,) int: texels left of and above the samples, the same for all faces with as many samples.
        corner_at: (f, 3, 2) float: column and row of the faces' corners, in samples from the first one.
    """

    size: np.ndarray
    margin: np.ndarray
    corner_at: np.ndarray

    @property
    def box(self) -> np.ndarray:
        """(f,) int: side of the square that a face shares with another. Its samples with their margins have
        N + 3 margin + 1 texels along a leg, and the texels between both triangles belong to neither."""
        return self.size + 3 * self.margin + 2


def texel_picture(found: Texels, coloring: Coloring, beside: Texels | None = None) -> TexelPicture:
    """Paint residuals or flow.

    Args:
        coloring: how values become colours.
        beside: values that the scale fits too, shown beside these.

    Raises:
        ValueError: too many faces for a texture of `LARGEST` texels.
    """
    ids = np.flatnonzero(found.size)
    place, paint, empty = (
        (by_vector, _wheel_shades, np.array(UNKNOWN, dtype=np.uint8))
        if coloring.scale is Scale.VECTOR
        else (by_value, _shades, np.uint8(UNKNOWN_INDEX))
    )
    at, legend = place(coloring, found.values, None if beside is None else beside.values)
    is_known = ~np.isnan(at if at.ndim == 1 else at[:, 0])
    n_known = np.array([is_known[found.start[face] : found.start[face + 1]].sum() for face in ids.tolist()], dtype=int)
    n_samples = np.diff(found.start)[ids]
    legend = replace(
        legend,
        unknown=len(found.size) - int((n_known > 0).sum()),
        left_out=float((n_samples - n_known)[n_known > 0].sum() / max(1, n_samples[n_known > 0].sum())),
    )
    factor, grids, (size, first, is_turned) = _fitting(found.size[ids], found.inset[ids])
    texture = np.full((size[1], size[0], *np.shape(empty)), empty)
    nearest: dict[int, tuple[np.ndarray, np.ndarray]] = {}
    for k, face in enumerate(ids.tolist()):
        n, box = int(grids.size[k]), int(grids.box[k])
        if n not in nearest:
            nearest[n] = _nearest_samples(n, int(grids.margin[k]))
        is_own, sample = nearest[n]
        shade = paint(_averaged(at[found.start[face] : found.start[face + 1]], int(factor[k])))
        tile = texture[first[k, 1] : first[k, 1] + box, first[k, 0] : first[k, 0] + box]
        (tile[::-1, ::-1] if is_turned[k] else tile)[is_own] = shade[sample]
    # The last row is unknown: the faces without samples lie in it.
    uv = np.full((len(found.size), 3, 2), (0.5, (size[1] - 0.5) / size[1]))
    local = grids.margin[:, None, None] + grids.corner_at
    local = np.where(is_turned[:, None, None], grids.box[:, None, None] - 1 - local, local)
    uv[ids] = (first[:, None] + local + 0.5) / size
    return TexelPicture(uv, _png(texture), int(size[0] * size[1]), legend, found.blur)


def _shades(at: np.ndarray) -> np.ndarray:
    """Entries of the palette, uint8, of positions on the scale, 0 to 1, NaN where unknown."""
    return np.where(np.isnan(at), UNKNOWN_INDEX, np.round((SHADES - 1) * np.nan_to_num(at))).astype(np.uint8)


def _wheel_shades(at: np.ndarray) -> np.ndarray:
    """(p, 3) uint8 RGB: colours of vectors (p, 2), NaN where unknown."""
    is_known = ~np.isnan(at[:, :1])
    return np.where(is_known, wheel_colors(np.nan_to_num(at)), np.array(UNKNOWN, dtype=np.uint8))


def _png(texture: np.ndarray) -> bytes:
    """A PNG file, without the errors of a JPEG file, of colours (h, w, 3) or of entries of the palette (h, w), a third as large."""
    image = Image.fromarray(texture)
    if texture.ndim == 2:
        shades = color_map()[np.linspace(0, len(color_map()) - 1, SHADES).round().astype(int)]
        image.putpalette(np.vstack([shades, UNKNOWN]).astype(np.uint8).tobytes())
    file = io.BytesIO()
    image.save(file, "PNG", compress_level=1)
    return file.getvalue()


def _fitting(
    size: np.ndarray, inset: np.ndarray
) -> tuple[np.ndarray, _Grids, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """The side of the blocks of samples to average in each face (f,), as small as they fit into the texture; their grids, and
    where these lie, see `pack_in_pairs`; the texture has one row more.

    Args:
        size, inset: (f,): see `Texels`.
    """
    if len(size) == 0:
        empty = np.zeros(0, dtype=np.int64)
        return empty, _grids(size, inset, empty), (np.array([1, 1]), np.zeros((0, 2), dtype=np.int64), empty == 1)
    for factor in range(1, int(size.max()) + 1):
        factors = np.clip(size // LEAST_SIZE, 1, factor)
        grids = _grids(size, inset, factors)
        side, first, is_turned = pack_in_pairs(np.column_stack([grids.box, grids.box]))
        if side.max() < LARGEST:
            return factors, grids, (side + np.array([0, 1]), first, is_turned)
    raise ValueError(f"{len(size)} faces do not fit into a texture of {LARGEST} texels")


def _grids(size: np.ndarray, inset: np.ndarray, factor: np.ndarray) -> _Grids:
    """Args:
    size, inset: (f,): see `Texels`.
    factor: (f,) int: side of the blocks of samples that are averaged.
    """
    reduced = -(-size // factor)
    inner = 1 - 3 * inset
    # Samples from the first one to a corner with the barycentric weight 0, and 1, along a leg.
    ends = [(size * (weight - inset) / inner - 1 / 3 - (factor - 1) / 2) / factor for weight in (0, 1)]
    margin = np.ceil(-ends[0]).astype(np.int64) + 1
    for n in np.unique(reduced):
        margin[reduced == n] = margin[reduced == n].max()
    none, whole = ends
    corner_at = np.stack([np.stack(at, axis=-1) for at in ((whole, none), (none, whole), (none, none))], axis=1)
    return _Grids(reduced, margin, corner_at)


def _averaged(values: np.ndarray, factor: int) -> np.ndarray:
    """Means of blocks of factor x factor samples of a triangle (p,) or (p, c); NaN where none of a block is known."""
    if factor == 1:
        return values
    n = round((np.sqrt(8 * len(values) + 1) - 1) / 2)
    reduced = -(-n // factor)
    image = np.full((reduced * factor, reduced * factor, *values.shape[1:]), np.nan)
    rows, columns = np.nonzero(np.add.outer(np.arange(n), np.arange(n)) < n)
    image[rows, columns] = values
    blocks = image.reshape(reduced, factor, reduced, factor, *values.shape[1:])
    count = (~np.isnan(blocks)).sum(axis=(1, 3))
    mean = np.divide(np.nansum(blocks, axis=(1, 3)), count, out=np.full(count.shape, np.nan), where=count > 0)
    return mean[np.add.outer(np.arange(reduced), np.arange(reduced)) < reduced]


def _nearest_samples(n: int, margin: int) -> tuple[np.ndarray, np.ndarray]:
    """The texels of a square that a face with n samples along a leg owns, a mask, and the sample of each of them, by index."""
    box = n + 3 * margin + 2
    place = np.arange(box)
    is_own = np.add.outer(place, place) < box - 1
    row, column = (at - margin for at in np.nonzero(is_own))
    row, column = np.maximum(row, 0), np.maximum(column, 0)
    beyond = np.maximum(row + column - (n - 1), 0)  # of the longest side: back at right angles to it
    row, column = row - beyond // 2, column - (beyond - beyond // 2)
    row, column = np.clip(row, 0, n - 1), np.clip(column, 0, n - 1)
    return is_own, row * n - row * (row - 1) // 2 + column
