"""Records of face splits: what each round found and how it was judged; as arrays for a file, and back, checked."""

from dataclasses import dataclass, fields

import numpy as np

from fairing.errors import InputError
from fairing.mesh import Mesh
from fairing.trace_check import Field, check_counts, check_fields, check_ids, check_positions
from fairing.triangulation.subdivision import divided_edges, subdivided


@dataclass(frozen=True, eq=False)
class SplitRound:
    """One round: the candidates are split and fitted, then each connected part of them is judged by held-out points.

    Attributes:
        vertices: (n, 3) float, world units: before the round.
        faces: (m, 3) int: before it.
        chosen: (k,) int: the candidates: faces off which the points that build lie together.
        offsets: (k,) float, px of a typical photo: how far, in the quarter of each face where they lie farthest.
        parts: (k,) int: the part that each belongs to.
        judges: (p,) int: number of held-out points of each part.
        errors: (p, 2) float: root mean square of their distances from the surface before and after all candidates are split, in
            standard deviations, each bounded; 0 without held-out points.
        significance: (p,) float: fall of their mean squares, in its standard errors.
        is_split: (p,) bool: parts that the held-out points confirm. The others stay as they were.
        after: (n + e, 3) float, world units: vertices after the round; each of the e edges that were divided has a new one.
    """

    vertices: np.ndarray
    faces: np.ndarray
    chosen: np.ndarray
    offsets: np.ndarray
    parts: np.ndarray
    judges: np.ndarray
    errors: np.ndarray
    significance: np.ndarray
    is_split: np.ndarray
    after: np.ndarray

    def mesh_with(self, parts: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The mesh with some of the split parts, (p,) bool, split.

        Returns:
            vertices (q, 3) float, world units; faces (r, 3) int; and for each of these the face before the round that it is part
            of, (r,) int.
        """
        n, is_chosen = len(self.vertices), self._faces_of(parts & self.is_split)
        vertices, faces, parent = subdivided(self.vertices, self.faces, is_chosen)
        every = divided_edges(n, self.faces, self._faces_of(self.is_split))
        vertices[n:] = self.after[n + np.searchsorted(every, divided_edges(n, self.faces, is_chosen))]
        corners = np.unique(self.faces[is_chosen])
        vertices[corners] = self.after[corners]
        return vertices, faces, parent

    def result(self) -> tuple[np.ndarray, np.ndarray]:
        """Vertices (n + e, 3) float, world units, and faces (r, 3) int after the round."""
        return self.mesh_with(self.is_split)[:2]

    def _faces_of(self, parts: np.ndarray) -> np.ndarray:
        """(m,) bool: the candidates of these parts (p,) bool."""
        result = np.zeros(len(self.faces), dtype=bool)
        result[self.chosen] = parts[self.parts]
        return result


_FIELDS = {
    "vertices": Field("f", ("vertices", 3)),
    "faces": Field("iu", ("faces", 3)),
    "chosen": Field("iu", ("candidates",)),
    "offsets": Field("f", ("candidates",), is_finite=True),
    "parts": Field("iu", ("candidates",)),
    "judges": Field("iu", ("parts",)),
    "errors": Field("f", ("parts", 2), is_finite=True),
    "significance": Field("f", ("parts",), is_finite=True),
    "is_split": Field("iu", ("parts",)),
    "after": Field("f", ("after", 3)),
}


def split_arrays(done: SplitRound) -> dict[str, np.ndarray]:
    """All arrays of a round by name."""
    arrays = {field.name: getattr(done, field.name) for field in fields(SplitRound)}
    return arrays | {"is_split": done.is_split.astype(np.uint8)}


def read_split(arrays: dict[str, np.ndarray], before: SplitRound | None) -> SplitRound:
    """The round with these `split_arrays`.

    Args:
        before: the round before it, if it is not the first.

    Raises:
        InputError: an array is missing, of another kind, or out of range, or the round does not continue the one before it.
    """
    lengths: dict[str, int] = {}
    check_fields(arrays, _FIELDS, lengths)
    mesh = Mesh(arrays["vertices"], arrays["faces"])
    check_ids(arrays["chosen"], len(mesh.faces), "chosen")
    check_ids(arrays["parts"], lengths["parts"], "parts")
    check_ids(arrays["is_split"], 2, "is_split")
    check_counts(arrays["judges"], "judges")
    check_positions(arrays["after"], "after")
    whole = {name: arrays[name].astype(np.int64) for name in ("chosen", "parts", "judges")}
    done = SplitRound(
        **arrays | whole | {"vertices": mesh.vertices, "faces": mesh.faces, "is_split": arrays["is_split"].astype(bool)}
    )
    divided = divided_edges(len(mesh.vertices), mesh.faces, done._faces_of(done.is_split))
    expected = len(mesh.vertices) + len(divided)
    if len(done.after) != expected:
        raise InputError(
            f"after: expected {expected} vertices, one more for each divided edge, found {len(done.after)}"
        )
    if before is not None:
        for name, wanted, found in zip(
            ("vertices", "faces"), before.result(), (mesh.vertices, mesh.faces), strict=True
        ):
            if not np.array_equal(wanted, found):
                raise InputError(f"{name}: expected those after the round before, found others; triangulate again")
    return done
