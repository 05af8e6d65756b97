"""Edge flips: the flips with the largest gain first, until no flip makes the photos agree better.

Morris and Kanade, Image-Consistent Surface Triangulation, CVPR 2000. Flips are made in rounds. Within a round the occluding
surface is fixed: all candidates are measured, and flips are made in order of decreasing gain; faces adjacent to a flip wait for
the next round, so that each measured gain is the actual one. Then visibility is judged again. The energy of the mesh, with the
new visibility of each face, must have decreased; else only the better half of the round's flips is made.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fairing.errors import InputError
from fairing.scene import Scene
from fairing.solve.energy import Evaluator
from fairing.triangulation.inconsistency import FaceLosses, Judge, common_loss
from fairing.triangulation.options import TriangulationOptions
from fairing.triangulation.quads import Quads, Verdict, edge_keys, find_quads, judge_shapes
from fairing.triangulation.record import FlipRecord, FlipTrace

BATCH = 1500
"""Edges measured at a time; bounds memory and the latency of a stop request."""
LEAST_GAIN = 0.001
"""Least decrease of the loss: that of 0.6 grey levels where there was no residual; less is noise."""
MIN_COMMON_PHOTOS = 3
"""A flip is measured in at least this many photos that see all four faces."""


@dataclass(frozen=True, eq=False)
class FlipSummary:
    """Summary of a search for flips.

    Attributes:
        inconsistent_before, inconsistent_after: number of edges whose flip lowers the energy; the second is None if the
            search was stopped.
        energy_before, energy_after: energy of the mesh, see `FlipRecord`.
        rounds: number of rounds with flips.
        verdicts: number of edges by `Verdict`, in the first search and in the last.
        stop_reason: a sentence.
    """

    inconsistent_before: int
    inconsistent_after: int | None
    energy_before: float
    energy_after: float
    rounds: int
    verdicts: tuple[dict[Verdict, int], dict[Verdict, int]]
    stop_reason: str


@dataclass(frozen=True, eq=False)
class _State:
    """A mesh with its losses in the photos."""

    faces: np.ndarray
    losses: FaceLosses
    face_energy: np.ndarray
    depth_maps: list

    @property
    def energy(self) -> float:
        return float(self.face_energy.sum())


@dataclass(frozen=True, eq=False)
class _Search:
    """Edges examined, and those worth flipping in order of decreasing gain."""

    verdicts: np.ndarray
    n_other: int
    quads: Quads
    energy: np.ndarray
    common: np.ndarray
    n_views: np.ndarray

    def count(self) -> dict[Verdict, int]:
        counts = {Verdict(v): int((self.verdicts == v).sum()) for v in np.unique(self.verdicts)}
        return counts | ({Verdict.BOUNDARY: self.n_other} if self.n_other else {})


class EdgeFlipper:
    """Flips the edges of a scene's mesh.

    Args:
        evaluator: whose threads it uses; default: one of its own.

    Attributes:
        trace: the record so far; the mesh of its last moment is the current one.

    Raises:
        InputError: no face of the scene's mesh is seen by three photos.
    """

    def __init__(
        self, scene: Scene, options: TriangulationOptions | None = None, evaluator: Evaluator | None = None
    ) -> None:
        self._options = options or TriangulationOptions()
        self._judge = Judge(scene, self._options, evaluator or Evaluator(self._options.threads))
        self.trace = FlipTrace({}, scene.mesh.vertices, scene.mesh.faces)
        self._taken_back: set[tuple[int, ...]] = set()
        self._pixels_per_area = 1.0
        start = self._measure(self.trace.faces_at(0))
        seen = start.losses.n_views > 0
        if not seen.any():
            raise InputError(
                "triangulation: no face of the start mesh is seen by three photos, so no edge can be judged"
            )
        # Energies are in pixels of a typical photo of the start mesh, one factor for the whole run.
        pixels = start.losses.weight.sum(axis=1)[seen] / start.losses.n_views[seen]
        self._pixels_per_area = float(pixels.sum() / self._judge.surface(start.faces[seen]).sum())
        self._state = replace(start, face_energy=self._energies(start.faces, start.losses))

    def run(
        self,
        should_stop: Callable[[], bool] = lambda: False,
        on_progress: Callable[[int, int, float], None] = lambda flips, open_edges, energy: None,
    ) -> FlipSummary:
        """Flip until no edge is inconsistent.

        Args:
            should_stop: polled between batches; flips made before a stop remain.
            on_progress: callback after each search: flips made, inconsistent edges found, energy.
        """
        energy_before = self._state.energy
        first: _Search | None = None
        search, rounds = None, 0
        active: np.ndarray | None = None  # faces around which to search; None: everywhere
        stop_reason = "no further flip lowers the energy"
        while True:
            found = self._search(active, should_stop)
            if found is None:
                stop_reason = "stopped on request"
                break
            search = found
            first = first or search
            on_progress(len(self.trace), len(search.quads.edge), self._state.energy)
            if len(search.quads.edge) == 0:
                if active is None:
                    break
                active = None
                continue
            chosen = self._independent(search.quads)
            flipped = self._flip(search, chosen, rounds)
            if flipped is None:
                active = None
                continue
            rounds += 1
            complete = flipped == len(chosen)
            active = self._around(search.quads.of(chosen[:flipped])) if complete else None
        stopped = stop_reason.startswith("stopped")
        empty: dict[Verdict, int] = {}
        return FlipSummary(
            len(first.quads.edge) if first else 0,
            None if stopped or search is None else int((search.verdicts == Verdict.TAKEN_BACK).sum()),
            energy_before,
            self._state.energy,
            rounds,
            (first.count() if first else empty, search.count() if search else empty),
            stop_reason,
        )

    def _measure(self, faces: np.ndarray) -> _State:
        maps = self._judge.depth_maps(faces)
        own = np.repeat(np.arange(len(faces))[:, None], 2, axis=1)
        parts = [
            self._judge.losses(faces[i : i + BATCH], maps, own[i : i + BATCH]) for i in range(0, len(faces), BATCH)
        ]
        losses = FaceLosses(np.concatenate([p.weight for p in parts]), np.concatenate([p.loss for p in parts]))
        return _State(faces, losses, self._energies(faces, losses), maps)

    def _energies(self, faces: np.ndarray, losses: FaceLosses) -> np.ndarray:
        """(F,) float: energy of each face, loss per pixel times surface in pixels."""
        return self._pixels_per_area * self._judge.surface(faces) * losses.mean()

    def _search(self, active: np.ndarray | None, should_stop: Callable[[], bool]) -> _Search | None:
        """Find the edges worth flipping, at the faces `active` (m,) bool or all; None if stopped."""
        state = self._state
        quads = find_quads(state.faces)
        if active is not None:
            quads = quads.of(np.flatnonzero(np.logical_or.reduce(active[quads.faces], axis=1)))
        verdicts = judge_shapes(quads, state.faces, self.trace.vertices)
        known = np.array(
            [_key(e, o) in self._taken_back for e, o in zip(quads.edge, quads.opposite, strict=True)], bool
        )
        verdicts[(verdicts == Verdict.FLIPPED) & known] = Verdict.TAKEN_BACK
        energy, common = np.zeros((len(verdicts), 2)), np.zeros((len(verdicts), 2))
        n_views = np.zeros(len(verdicts), dtype=np.int64)
        open_edges = np.flatnonzero(verdicts == Verdict.FLIPPED)
        for start in range(0, len(open_edges), BATCH):
            if should_stop():
                return None
            rows = open_edges[start : start + BATCH]
            verdicts[rows], energy[rows], common[rows], n_views[rows] = self._compare(quads.of(rows))
        if should_stop():
            return None
        worth = np.flatnonzero(verdicts == Verdict.FLIPPED)
        # Largest gain first; edges are sorted, so the order of ties is fixed.
        worth = worth[np.argsort(energy[worth, 1] - energy[worth, 0], kind="stable")]
        return _Search(verdicts, quads.n_other, quads.of(worth), energy[worth], common[worth], n_views[worth])

    def _compare(self, quads: Quads) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Verdicts (Q,), energies (Q, 2) and losses in common photos (Q, 2) before and after, common photos (Q,)."""
        state = self._state
        one, two = quads.flipped()
        both = quads.faces.T.ravel()
        old, new_faces = state.losses.of(both), np.vstack([one, two])
        new = self._judge.losses(new_faces, state.depth_maps, np.vstack([quads.faces, quads.faces]))
        (loss_old, loss_new), n_views = common_loss([old, new])
        energy_old = state.face_energy[both].reshape(2, -1).sum(axis=0)
        energy_new = self._energies(new_faces, new).reshape(2, -1).sum(axis=0)
        verdict = np.full(len(n_views), Verdict.NO_GAIN, dtype=np.int8)
        # The loss in common photos compares equal pixels; the energy must not rise over all photos either.
        is_gain = loss_new < loss_old - np.maximum(self._options.gain * loss_old, LEAST_GAIN)
        verdict[is_gain & (energy_new < energy_old)] = Verdict.FLIPPED
        sides_old = self._judge.shown_side(state.faces[both]).reshape(2, len(n_views), -1)
        sides_new = self._judge.shown_side(new_faces).reshape(2, len(n_views), -1)
        takes_part = (old.weight > 0).reshape(2, len(n_views), -1).all(axis=0) & (sides_old > 0).all(axis=0)
        turns_away = takes_part & (sides_new <= 0).any(axis=0)
        # One such photo refuses the flip (ledger: flips that turn away).
        verdict[np.logical_or.reduce(turns_away, axis=1)] = Verdict.TURNED_AWAY
        few = (n_views < MIN_COMMON_PHOTOS) & (verdict != Verdict.TURNED_AWAY)
        verdict[few] = Verdict.TOO_FEW_PHOTOS
        return verdict, np.stack([energy_old, energy_new], 1), np.stack([loss_old, loss_new], 1), n_views

    def _independent(self, quads: Quads) -> np.ndarray:
        """Rows of flips, in order, whose faces are neither shared nor adjacent and that create no edge twice."""
        everything = find_quads(self._state.faces)
        neighbours: list[set[int]] = [set() for _ in range(len(self._state.faces))]
        for f, g in everything.faces.tolist():
            neighbours[f].add(g)
            neighbours[g].add(f)
        taken: set[int] = set()
        made: set[tuple[int, int]] = set()
        rows = []
        for row, ((f, g), edge) in enumerate(zip(quads.faces.tolist(), quads.opposite, strict=True)):
            new_edge = edge_keys(edge[None])
            if f in taken or g in taken or new_edge & made:
                continue
            rows.append(row)
            made |= new_edge
            taken |= {f, g} | neighbours[f] | neighbours[g]
        return np.array(rows)

    def _flip(self, search: _Search, chosen: np.ndarray, round_number: int) -> int | None:
        """Flip as many of `chosen`, from the first, as lower the energy (by halving); returns their number, or None for none."""
        before = self._state
        count = len(chosen)
        while count > 0:
            quads = search.quads.of(chosen[:count])
            faces = before.faces.copy()
            faces[quads.faces[:, 0]], faces[quads.faces[:, 1]] = quads.flipped()
            after = self._measure(faces)
            if after.energy < before.energy:
                break
            count //= 2
        else:
            first = chosen[0]
            self._taken_back.add(_key(search.quads.edge[first], search.quads.opposite[first]))
            return None
        for row in chosen[:count]:
            self.trace.append(
                FlipRecord(
                    round_number, search.quads.edge[row], search.quads.opposite[row], search.quads.faces[row],
                    tuple(search.energy[row].tolist()), tuple(search.common[row].tolist()), int(search.n_views[row]),
                    (before.energy, after.energy),
                )
            )  # fmt: skip
        self.trace.flush()
        self._state = after
        return count

    def _around(self, quads: Quads) -> np.ndarray:
        """(m,) bool: the flipped faces and all faces that share a vertex with them."""
        touched = np.zeros(len(self.trace.vertices), dtype=bool)
        touched[quads.edge] = touched[quads.opposite] = True
        return np.logical_or.reduce(touched[self._state.faces], axis=1)


def _key(edge: np.ndarray, opposite: np.ndarray) -> tuple[int, ...]:
    return tuple(edge.tolist() + sorted(opposite.tolist()))
