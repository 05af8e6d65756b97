"""Runs: the list of runs of one debugger, each with its own record; one of them is the current run."""

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.debugger.option_fields import differing_fields
from app.debugger.session_snapshot import recorded_position
from fairing.errors import InputError
from fairing.options import PRESETS, FairingOptions
from fairing.run.session import Session
from fairing.trace import Trace

MAX_RUNS = 30
MAX_DIFFERENCES = 3  # listed; the others are counted


@dataclass(frozen=True, eq=False)
class RunInfo:
    """A run at one published state.

    Attributes:
        run_id: 1 for the first run; not reused after a run is deleted.
        parent: the run it was branched from; None if it began at the start.
        forked_at: the moment of the branch.
        differs: title: its options, or how it differs from its parent.
        trace: its record, which may grow; this info covers its first `length` steps.
        length: number of recorded steps.
        moment: its present moment.
        vertices: (n, 3) float, positions at `moment`, world units.
        options: of this run.
        finished: whether the schedule is completed at `moment`.
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
    """Used by the engine thread only, but for `file_of`. A run that is not the current one keeps its record only.

    Args:
        session: the first run.
        save_to: the file for its record; the files of other runs are created beside it.
        recorded_in: the file that the first run was read from and that is not written.
    """

    def __init__(self, session: Session, save_to: Path | None, recorded_in: Path | None = None) -> None:
        self._save_to = save_to
        title = run_title(session.options)
        self._kept: dict[int, _Kept] = {1: _Kept(session, None, 0, title, save_to or recorded_in)}
        self._next_id = 2
        self.run_id = 1
        if save_to is not None:
            session.trace.attach(save_to)

    @property
    def session(self) -> Session:
        """The session of the current run."""
        return self._kept[self.run_id].session

    @property
    def sessions(self) -> list[Session]:
        """The sessions of all runs."""
        return [kept.session for kept in self._kept.values()]

    def of(self, run_id: int) -> Session:
        """The session of a run.

        Raises:
            InputError: there is no run with this number.
        """
        if run_id not in self._kept:
            raise InputError(f"run {run_id}: does not exist; it may have been deleted")
        return self._kept[run_id].session

    def file_of(self, run_id: int) -> Path | None:
        """The file with the record of a run; None if there is none."""
        kept = self._kept.get(run_id)
        return None if kept is None else kept.file

    def from_start_with(self, options: FairingOptions) -> int | None:
        """The number of a run that began at the start with these options and has no manual steps; None if there is none."""
        for run_id, kept in self._kept.items():
            is_edited = bool(kept.session.trace.manual_moments)
            if kept.parent is None and kept.session.options == options and not is_edited:
                return run_id
        return None

    def add(self, session: Session, forked_at: int, note: str = "", keep: Collection[int] = ()) -> int:
        """Add a run and switch to it. The run that was current is kept, unless it has no steps.

        Args:
            forked_at: the moment up to which the new run shares the record of the current one; 0: it begins at the start.
            note: its title; default: its options.
            keep: runs that are kept although they have no steps yet.

        Raises:
            InputError: there are too many runs, or the file cannot be written.
        """
        before = self._kept[self.run_id]
        is_replaced = len(before.session.trace) == 0 and self.run_id not in keep
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
            before.session.forget_computed()
            del self._kept[self.run_id]
        else:
            self._free_current()
        self.run_id = self._next_id
        self._kept[self.run_id] = added
        self._next_id += 1
        return self.run_id

    def replace(self, session: Session) -> None:
        """Replace the session of the current run by one with the same record and other options."""
        kept = self._kept[self.run_id]
        kept.session.trace.detach()
        if self._save_to is not None and kept.file is not None:
            session.trace.attach(kept.file)
        session.cancel_requested = kept.session.cancel_requested
        kept.session.forget_computed()
        if kept.parent is None:
            kept.differs = run_title(session.options)
        kept.session, kept.info = session, None

    def switch(self, run_id: int) -> None:
        """Switch to another run.

        Raises:
            InputError: there is no run with this number.
        """
        self.of(run_id)
        if run_id != self.run_id:
            self._free_current()
            self.run_id = run_id

    def delete(self, run_id: int) -> None:
        """Delete a run from the list. Its file is kept.

        Raises:
            InputError: there is no run with this number, or it is the only one.
        """
        self.of(run_id)
        if len(self._kept) == 1:
            raise InputError("this is the only run; restart it instead")
        if run_id == self.run_id:
            parent = self._kept[run_id].parent
            others = [other for other in self._kept if other != run_id]
            self.switch(parent if parent in others else others[-1])
        deleted = self._kept.pop(run_id).session
        deleted.trace.detach()
        deleted.forget_computed()

    def renew(self) -> None:
        """Replace every session by a new one with a copy of its record, at the same moment.

        For the case that a thread which does not end still uses the old ones: what it does to them has no effect.
        """
        for kept in self._kept.values():
            old, moment = kept.session, kept.session.moment
            session = Session(old.scene, trace=old.trace.cut(len(old.trace)), terms=old.terms)
            session.go_to(min(moment, len(session.trace)))
            if self._save_to is not None and kept.file is not None:
                old.trace.detach()
                session.trace.attach(kept.file)
            kept.session, kept.info = session, None

    def infos(self) -> tuple[RunInfo, ...]:
        """All runs, the oldest first."""
        return tuple(self._info(run_id, kept) for run_id, kept in self._kept.items())

    def close(self) -> None:
        """Close all files, even if closing one fails.

        Raises:
            InputError: a file could not be written; the first failure.
        """
        failures = []
        for kept in self._kept.values():
            try:
                kept.session.trace.detach()
            except InputError as error:
                failures.append(error)
        if failures:
            raise failures[0]

    def _free_current(self) -> None:
        self.session.trace.flush()
        self.session.forget_computed()

    def _free_file(self) -> Path:
        assert self._save_to is not None
        number = self._next_id
        while (path := self._save_to.with_stem(f"{self._save_to.stem}-{number}")).exists():
            number += 1
        return path

    def _info(self, run_id: int, kept: _Kept) -> RunInfo:
        session = kept.session
        length, moment = len(session.trace), session.moment
        if kept.info is None or (kept.info.length, kept.info.moment) != (length, moment):
            is_finished = recorded_position(session.trace, moment).level >= session.options.n_levels
            kept.info = RunInfo(
                run_id, kept.parent, kept.forked_at, kept.differs, session.trace, length, moment, session.vertices,
                session.options, is_finished,
            )  # fmt: skip
        return kept.info


def run_title(options: FairingOptions) -> str:
    """A title for options: the nearest preset and the differences from it."""
    words = {name: _differences(preset, options) for name, preset in PRESETS.items()}
    nearest = min(words, key=lambda name: len(words[name]))
    return f"{nearest}, {_listed(words[nearest])}" if words[nearest] else nearest


def options_differing(before: FairingOptions, after: FairingOptions) -> str:
    """The differences between options, as a title."""
    return _listed(_differences(before, after)) or "the same options"


def _differences(before: FairingOptions, after: FairingOptions) -> list[str]:
    return [
        f"{field.label} {_short(field.shown(before))} → {_short(field.shown(after))}"
        for field in differing_fields(before, after)
    ]


def _listed(words: list[str]) -> str:
    more = len(words) - MAX_DIFFERENCES
    return "; ".join(words[:MAX_DIFFERENCES]) + (f"; and {more} more" if more > 0 else "")


def _short(value: object) -> str:
    return f"{value!s:.24}" if value != "" else "none"
