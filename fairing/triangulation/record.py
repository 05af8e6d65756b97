"""Flip records: how points became a start mesh, face splits, and every edge flip, appended to a file and readable after a crash.

Moment 0 is the mesh before the first flip, moment k that after k flips. A flip changes the corners of the quad's two faces;
vertices and the number and order of faces stay the same.

On disk it is a `fairing.util.block_file`.
"""

import json
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from fairing.errors import InputError
from fairing.mesh import Mesh
from fairing.trace_check import Field, check_counts, check_fields, check_ids, naming_block, read_header
from fairing.triangulation.carving import Carving
from fairing.triangulation.carving_file import carving_arrays, carving_names, read_carving
from fairing.triangulation.quads import Quads, Verdict
from fairing.triangulation.split_record import SplitRound, read_split, split_arrays
from fairing.util.block_file import BlockFile, blocks_budget, pack, read_blocks, unpack
from fairing.util.budget import Budget

MAGIC = b"EIGENFAIRING FLIPS 1\n"


@dataclass(frozen=True, eq=False)
class FlipRecord:
    """One edge replaced by the other diagonal of its quad.

    Attributes:
        round: number of the round, from 0.
        edge: (2,) int: the vertices a, b of the removed edge.
        opposite: (2,) int: the vertices c, d of the new edge.
        faces: (2,) int: (a, b, c) and (b, a, d) became (a, d, c) and (d, b, c).
        energy: contribution of the two faces to the mesh's energy before and after: loss per pixel times area in
            pixels, over the photos that see each face.
        common_loss: loss per pixel (0 to 1) of both pairs over the photos that see all four faces; the
            criterion for the flip.
        n_views: number of those photos.
        round_energy: energy of the mesh before and after the whole round, each with its own visibility.
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
        """The quad as a list of one."""
        return Quads(self.edge[None], self.opposite[None], self.faces[None], 0)

    def apply_to(self, faces: np.ndarray) -> None:
        """Replace the two faces of the quad in faces (m, 3) int, in place.

        Raises:
            InputError: the faces are not those on either side of the edge.
        """
        (a, b), (c, d) = self.edge.tolist(), self.opposite.tolist()
        if [set(faces[face].tolist()) for face in self.faces] != [{a, b, c}, {a, b, d}]:
            raise InputError(
                f"expected the faces {self.faces.tolist()} beside the edge ({a}, {b}), found others; triangulate again"
            )
        (faces[self.faces[0]],), (faces[self.faces[1]],) = self.quads.flipped()

    @property
    def reason(self) -> str:
        """The reason of the flip as a sentence for users."""
        before, after = self.common_loss
        return f"{Verdict.FLIPPED.text} ({self.n_views} photos, loss {before:.3f} -> {after:.3f})"


class FlipTrace:
    """Start mesh, how it came about, and flips; optionally attached to a file.

    Attributes:
        header: facts of the triangulation that JSON can hold: options, scene.
        vertices: (n, 3) float, world units.
        flips: the records.
        carving: how points became the start mesh; None of a given mesh, and in older records.
        splits: the rounds of face splits, which led to `vertices`; none in older records.
    """

    def __init__(
        self, header: dict[str, Any], vertices: np.ndarray, faces: np.ndarray, carving: Carving | None = None
    ) -> None:
        self.header, self.carving = header, carving
        self.splits: tuple[SplitRound, ...] = ()
        self.vertices = np.array(vertices, dtype=np.float64)
        self._start = np.array(faces, dtype=np.int64)
        self.flips: list[FlipRecord] = []
        self._file: BlockFile | None = None

    def __len__(self) -> int:
        return len(self.flips)

    def faces_at(self, moment: int) -> np.ndarray:
        """(m, 3) int: the faces at a moment.

        Raises:
            IndexError: there is no such moment.
        """
        if not 0 <= moment <= len(self.flips):
            raise IndexError(f"moment {moment}: this record has moments 0 to {len(self.flips)}")
        faces = self._start.copy()
        for flip in self.flips[:moment]:
            flip.apply_to(faces)
        return faces

    def append(self, record: FlipRecord) -> None:
        """Add a flip and write it to the attached file, if any.

        Raises:
            InputError: the disk is full.
        """
        self.flips.append(record)
        if self._file is not None:
            self._file.append(_pack_flip(record))

    def attach(self, path: Path) -> None:
        """Write the record to `path`, replacing an existing file, and append further flips to it.

        Raises:
            InputError: the disk is full, or the folder is missing.
        """
        texts, before = {"header": json.dumps(self.header)}, []
        if self.carving is not None:
            texts[_CARVING] = carving_names(self.carving)
            before.append(pack({}, **carving_arrays(self.carving)))
        if self.splits:
            texts[_SPLITS] = str(len(self.splits))
            before += [pack({}, **split_arrays(done)) for done in self.splits]
        header = pack(texts, vertices=self.vertices, faces=self._start)
        self._file = BlockFile(path, MAGIC, [header, *before, *map(_pack_flip, self.flips)])

    def flush(self) -> None:
        """Write all flips to the disk, so that they survive a crash of the machine."""
        if self._file is not None:
            self._file.flush()

    def detach(self) -> None:
        """Flush and close the attached file."""
        if self._file is not None:
            self._file.close()
            self._file = None

    @classmethod
    def load(cls, path: str | Path) -> "FlipTrace":
        """Read a record; a truncated flip at its end is dropped.

        Raises:
            InputError: the file is missing, no such record, or holds a header or a flip that no triangulation can have
                written.
        """
        kind = "record of flips"
        blocks = read_blocks(Path(path), MAGIC, kind)
        budget = blocks_budget(blocks)
        with naming_block(f"{kind} {path}"):
            texts, arrays = unpack(blocks[0], budget)
            header = read_header(texts)
            check_fields(arrays, _MESH_FIELDS, {})
            mesh = Mesh(arrays["vertices"], arrays["faces"])
        trace, flips = cls(header, mesh.vertices, mesh.faces), blocks[1:]
        if _CARVING in texts and flips:
            with naming_block(f"{kind} {path}: carving"):
                trace.carving = read_carving(texts[_CARVING], unpack(flips.pop(0), budget)[1])
        if _SPLITS in texts:
            with naming_block(f"{kind} {path}: splits"):
                n_rounds = _read_count(texts[_SPLITS])
            for i, block in enumerate(flips[:n_rounds]):
                with naming_block(f"{kind} {path}: face splits, round {i + 1}"):
                    before = trace.splits[-1] if trace.splits else None
                    trace.splits += (read_split(unpack(block, budget)[1], before),)
            flips = flips[n_rounds:]
        faces = mesh.faces.copy()
        for i, block in enumerate(flips):
            with naming_block(f"{kind} {path}: flip {i + 1}"):
                flip = _unpack_flip(block, budget, len(mesh.vertices), len(faces))
                flip.apply_to(faces)
            trace.flips.append(flip)
        return trace


def is_flip_record(path: Path) -> bool:
    """Whether a file is a record of flips, by its first bytes."""
    if not path.is_file():  # a pipe would block
        return False
    try:
        with path.open("rb") as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError:
        return False


def _pack_flip(record: FlipRecord) -> bytes:
    return pack({}, **{field.name: np.asarray(getattr(record, field.name)) for field in fields(FlipRecord)})


_CARVING = "carving"
"""Name of the header's text that announces a carving in the second block."""
_SPLITS = "splits"
"""Name of the header's text with the number of rounds of face splits, a block each after the carving."""
_MESH_FIELDS = {"vertices": Field("f", ("n", 3)), "faces": Field("iu", ("m", 3))}
_FLIP_FIELDS = {
    "round": Field("iu"),
    "edge": Field("iu", (2,)),
    "opposite": Field("iu", (2,)),
    "faces": Field("iu", (2,)),
    "energy": Field("f", (2,), is_finite=True),
    "common_loss": Field("f", (2,), is_finite=True),
    "n_views": Field("iu"),
    "round_energy": Field("f", (2,), is_finite=True),
}


def _read_count(written: str) -> int:
    """Raises InputError: it is no whole number from 1."""
    if not (written.isascii() and written.isdigit() and len(written) < 10 and int(written)):
        raise InputError(f"expected the number of rounds, found {written!r:.40}")
    return int(written)


def _unpack_flip(block: bytes, budget: Budget, n_vertices: int, n_faces: int) -> FlipRecord:
    """The flip that a block holds.

    Raises:
        InputError: a field is missing, unknown, of another shape or type, or out of range.
        ValueError: the block is no archive of arrays.
    """
    _, values = unpack(block, budget)
    check_fields(values, _FLIP_FIELDS, {})
    for name in ("edge", "opposite"):
        check_ids(values[name], n_vertices, name)
    check_ids(values["faces"], n_faces, "faces")
    for name in ("round", "n_views"):
        check_counts(values[name], name)
    pairs = {name: tuple(values[name].tolist()) for name in ("energy", "common_loss", "round_energy")}
    numbers = {name: int(values[name]) for name in ("round", "n_views")}
    return FlipRecord(**{**values, **pairs, **numbers})
