"""The runs kept side by side: each has a record of its own, one of them is at hand."""

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.debugger.option_fields import option_fields
from fairing.errors import InputError
from fairing.options import PRESETS, FairingOptions
from fairing.run.session import Session
from fairing.trace import Trace

MAX_RUNS = 30
MAX_DIFFERENCES = 3  # named; the others are counted


@dataclass(frozen=True, eq=False)
class RunInfo:
    """What there is to know of a run, at one time.

    Attributes:
        run_id: 1 for the first; never used again.
        parent: the run it forked from; None if it began at the start.
        forked_at: the moment of the fork.
        differs: what is its own, in words.
        trace: its record; what belongs to this info are its first `length` steps.
        length: recorded steps.
        moment: where it stands.
        vertices: (n, 3) float, positions there, world units.
        options: of this run.
        finished: whether its schedule is worked off where it stands.
    """

    run_id: int
    parent: int | None
    forked_at: int
    differs: str
    trace: Trace
    length: int
    moment: int
    vertices: np.ndarray
    options: FairingOptions
    finished: bool

    @property
    def name(self) -> str:
        return f"Run {self.run_id}"


@dataclass(eq=False)
class _Kept:
    session: Session
    parent: int | None
    forked_at: int
    differs: str
    file: Path | None
    info: RunInfo | None = None


class Runs:
    """Belongs to the thread that owns the sessions. A run that is put aside keeps its record only.

    Args:
        session: the first run.
        save_to: the file that keeps its record; those of others are put beside it.
        recorded_in: the file that it was read from and that is not written to.
    """

    def __init__(self, session: Session, save_to: Path | None, recorded_in: Path | None = None) -> None:
        self._save_to = save_to
        title = run_title(session.options)
        self._kept: dict[int, _Kept] = {1: _Kept(session, None, 0, title, save_to or recorded_in)}
        self._following = 2
        self.run_id = 1
        if save_to is not None:
            session.trace.attach(save_to)

    @property
    def session(self) -> Session:
        """The run at hand."""
        return self._kept[self.run_id].session

    def of(self, run_id: int) -> Session:
        """Another one.

        Raises:
            InputError: there is none of this number.
        """
        if run_id not in self._kept:
            raise InputError(f"run {run_id}: is not there any more")
        return self._kept[run_id].session

    def file_of(self, run_id: int) -> Path | None:
        """The file that has a run's record, if one does."""
        kept = self._kept.get(run_id)
        return None if kept is None else kept.file

    def from_start_with(self, options: FairingOptions) -> int | None:
        """The number of a run that has had these options all along, if there is one."""
        for run_id, kept in self._kept.items():
            by_hand = kept.session.trace.manual_moments
            if kept.parent is None and kept.session.options == options and not by_hand:
                return run_id
        return None

    def add(self, session: Session, forked_at: int, note: str = "", wanted: Collection[int] = ()) -> int:
        """Keep one more and take it to hand; what it forked from stays, unless nothing was recorded there.

        Args:
            forked_at: the moment up to which it shares the past of the run at hand; 0: it begins at the start.
            note: what is its own; default: its options.
            wanted: runs that stay although nothing is recorded in them yet.

        Raises:
            InputError: there are too many, or its file cannot be written.
        """
        before = self._kept[self.run_id]
        is_replaced = len(before.session.trace) == 0 and self.run_id not in wanted
        if not is_replaced and len(self._kept) >= MAX_RUNS:
            raise InputError(f"expected at most {MAX_RUNS} runs; delete some first")
        file = None
        if self._save_to is not None:
            file = before.file if is_replaced and before.file else self._free_file()
            session.trace.attach(file)
        differs = note or (
            options_differing(before.session.options, session.options) if forked_at else run_title(session.options)
        )
        added = _Kept(session, self.run_id if forked_at else None, forked_at, differs, file)
        if is_replaced:
            before.session.trace.detach()
            del self._kept[self.run_id]
        else:
            self._put_aside()
        self.run_id = self._following
        self._kept[self.run_id] = added
        self._following += 1
        return self.run_id

    def replace(self, session: Session) -> None:
        """Let the run at hand go on as this one, which shares all of its past but has other options."""
        kept = self._kept[self.run_id]
        kept.session.trace.detach()
        if self._save_to is not None and kept.file is not None:
            session.trace.attach(kept.file)
        session.cancel_requested = kept.session.cancel_requested
        if kept.parent is None:
            kept.differs = run_title(session.options)
        kept.session, kept.info = session, None

    def switch(self, run_id: int) -> None:
        """Take another to hand.

        Raises:
            InputError: there is none of this number.
        """
        self.of(run_id)
        if run_id != self.run_id:
            self._put_aside()
            self.run_id = run_id

    def delete(self, run_id: int) -> None:
        """Forget one. Its file stays where it is.

        Raises:
            InputError: there is none of this number, or it is the only one.
        """
        self.of(run_id)
        if len(self._kept) == 1:
            raise InputError("this is the only run; restart it instead")
        if run_id == self.run_id:
            parent = self._kept[run_id].parent
            others = [other for other in self._kept if other != run_id]
            self.switch(parent if parent in others else others[-1])
        self._kept.pop(run_id).session.trace.detach()

    def infos(self) -> tuple[RunInfo, ...]:
        """All of them, the oldest first."""
        return tuple(self._info(run_id, kept) for run_id, kept in self._kept.items())

    def close(self) -> None:
        """Close the files, all of them even if one fails."""
        failures = []
        for kept in self._kept.values():
            try:
                kept.session.trace.detach()
            except InputError as error:
                failures.append(error)
        if failures:
            raise failures[0]

    def _put_aside(self) -> None:
        self.session.trace.flush()
        self.session.forget_computed()

    def _free_file(self) -> Path:
        assert self._save_to is not None
        number = self._following
        while (path := self._save_to.with_stem(f"{self._save_to.stem}-{number}")).exists():
            number += 1
        return path

    def _info(self, run_id: int, kept: _Kept) -> RunInfo:
        session = kept.session
        standing = (len(session.trace), session.moment)
        if kept.info is None or (kept.info.length, kept.info.moment) != standing:
            kept.info = RunInfo(
                run_id, kept.parent, kept.forked_at, kept.differs, session.trace, *standing, session.vertices,
                session.options, session.finished,
            )  # fmt: skip
        return kept.info


def run_title(options: FairingOptions) -> str:
    """The options in a few words: a preset, or what differs from the nearest."""
    words = {name: _differences(preset, options) for name, preset in PRESETS.items()}
    nearest = min(words, key=lambda name: len(words[name]))
    return f"{nearest}, {_listed(words[nearest])}" if words[nearest] else nearest


def options_differing(before: FairingOptions, after: FairingOptions) -> str:
    """What changed, in words."""
    return _listed(_differences(before, after)) or "the same options"


def _differences(before: FairingOptions, after: FairingOptions) -> list[str]:
    changed = [field for field in option_fields() if field.of(before) != field.of(after)]
    return [f"{field.label} {_short(field.shown(before))} → {_short(field.shown(after))}" for field in changed]


def _listed(words: list[str]) -> str:
    more = len(words) - MAX_DIFFERENCES
    return "; ".join(words[:MAX_DIFFERENCES]) + (f"; and {more} more" if more > 0 else "")


def _short(value: object) -> str:
    return f"{value!s:.24}" if value != "" else "none"
