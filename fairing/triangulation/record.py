"""The record of a triangulation: every flip, appended to a file as it happens and readable after a crash.

Moment 0 is the start mesh, moment k the mesh after k flips. A flip leaves the vertices, and the number and order of
faces, as they are: the two faces of the quad get other corners.

On disk it is a `fairing.util.block_file`.
"""

import json
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from fairing.triangulation.quads import Quads, Verdict
from fairing.util.block_file import BlockFile, pack, read_blocks, unpack

MAGIC = b"EIGENFAIRING FLIPS 1\n"


@dataclass(frozen=True, eq=False)
class FlipRecord:
    """One edge replaced by the other diagonal of its quad.

    Attributes:
        round: in which round, from 0.
        edge: (2,) int: the vertices a, b of the edge that went.
        opposite: (2,) int: the vertices c, d of the edge that came.
        faces: (2,) int: (a, b, c) and (b, a, d) became (a, d, c) and (d, b, c).
        energy: what the two faces add to the mesh's energy before and after: loss per pixel times surface in pixels,
            each over the photos that see it.
        common_loss: loss per pixel (0 to 1) of both pairs over the photos that see all four faces; this decides.
        n_views: how many photos those are.
        round_energy: energy of the mesh before the round and after all of it, with the visibility of each.
    """

    round: int
    edge: np.ndarray
    opposite: np.ndarray
    faces: np.ndarray
    energy: tuple[float, float]
    common_loss: tuple[float, float]
    n_views: int
    round_energy: tuple[float, float]

    @property
    def quads(self) -> Quads:
        """The quad, as the one of a list."""
        return Quads(self.edge[None], self.opposite[None], self.faces[None], 0)

    @property
    def reason(self) -> str:
        """A sentence for users."""
        before, after = self.common_loss
        return f"{Verdict.FLIPPED.text} ({self.n_views} photos, loss {before:.3f} -> {after:.3f})"


class FlipTrace:
    """Start mesh and flips; optionally mirrored to a file.

    Attributes:
        header: JSON-able facts: options, scene.
        vertices: (n, 3) float, world units.
        flips: the records.
    """

    def __init__(self, header: dict[str, Any], vertices: np.ndarray, faces: np.ndarray) -> None:
        self.header = header
        self.vertices = np.array(vertices, dtype=np.float64)
        self._start = np.array(faces, dtype=np.int64)
        self.flips: list[FlipRecord] = []
        self._file: BlockFile | None = None

    def __len__(self) -> int:
        return len(self.flips)

    def faces_at(self, moment: int) -> np.ndarray:
        """(m, 3) int: the mesh after so many flips.

        Raises:
            IndexError: there is no such moment.
        """
        if not 0 <= moment <= len(self.flips):
            raise IndexError(f"moment {moment}: this record has moments 0 to {len(self.flips)}")
        faces = self._start.copy()
        for flip in self.flips[:moment]:
            (faces[flip.faces[0]],), (faces[flip.faces[1]],) = flip.quads.flipped()
        return faces

    def append(self, record: FlipRecord) -> None:
        """Add a flip, and write it to the file if one is attached.

        Raises:
            InputError: the disk is full.
        """
        self.flips.append(record)
        if self._file is not None:
            self._file.append(_pack_flip(record))

    def attach(self, path: Path) -> None:
        """Write the record to `path` (replacing what is there by renaming) and keep it up to date from now on.

        Raises:
            InputError: the disk is full, or the folder is not there.
        """
        header = pack({"header": json.dumps(self.header)}, vertices=self.vertices, faces=self._start)
        self._file = BlockFile(path, MAGIC, [header, *map(_pack_flip, self.flips)])

    def flush(self) -> None:
        """Make sure that what was appended survives a crash of the machine."""
        if self._file is not None:
            self._file.flush()

    def detach(self) -> None:
        """Stop writing to the file."""
        if self._file is not None:
            self._file.close()
            self._file = None

    @classmethod
    def load(cls, path: Path) -> "FlipTrace":
        """Read a record; flips cut short at its end are dropped.

        Raises:
            InputError: the file is missing or no such record.
        """
        blocks = read_blocks(path, MAGIC, "record of flips")
        texts, arrays = unpack(blocks[0])
        trace = cls(json.loads(texts["header"]), arrays["vertices"], arrays["faces"])
        for block in blocks[1:]:
            trace.flips.append(_unpack_flip(block))
        return trace


def is_flip_record(path: Path) -> bool:
    """Whether a file is a record of flips, by its first bytes."""
    try:
        with path.open("rb") as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError:
        return False


def _pack_flip(record: FlipRecord) -> bytes:
    return pack({}, **{field.name: np.asarray(getattr(record, field.name)) for field in fields(FlipRecord)})


def _unpack_flip(block: bytes) -> FlipRecord:
    _, values = unpack(block)
    pairs = {name: tuple(values[name].tolist()) for name in ("energy", "common_loss", "round_energy")}
    numbers = {name: int(values[name]) for name in ("round", "n_views")}
    return FlipRecord(**{**values, **pairs, **numbers})
