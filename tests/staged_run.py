"""A finished run with stages of fits made by hand: what a record with one step for every iteration of a fit looks like.

The fits move all vertices out and back again, so that the steps by photos, which are real, fit where they were.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from fairing.run.session import Session
from fairing.stage_kind import StageKind
from fairing.trace import SchedulePosition, StepReason, StepRecord, Trace

Fit = tuple[StageKind, int, int]
"""A kind, the number of its sweeps (gates), and of the iterations of each."""
FITS: tuple[Fit, ...] = (
    (StageKind.POINTS, 20, 2),
    (StageKind.JUDGE, 1, 1),
    (StageKind.AXES, 1, 6),
    (StageKind.SURFACE_POINTS, 2, 8),
    (StageKind.CLOSEST_POINTS, 2, 6),
    (StageKind.JUDGE, 1, 1),
)
AGAIN: tuple[Fit, ...] = ((StageKind.POINTS, 8, 2), (StageKind.AXES, 1, 4), (StageKind.JUDGE, 1, 1))


def staged_trace(session: Session, first: Sequence[Fit] = FITS, again: Sequence[Fit] = AGAIN) -> Trace:
    """The trace of a finished session, with fits before its first step and before the first step of its last sweep of photos."""
    trace, old = Trace(session.trace.header, session.trace.start, session.trace.faces), session.trace.steps
    trace.plan = session.trace.plan
    last = [step.position for step in old if step.stage is StageKind.PHOTOS][-1]
    last_sweep = next(k for k, step in enumerate(old) if step.position[:2] == last[:2])
    sweeps_before = {step.position.level: 0 for step in old}
    for k, step in enumerate(old):
        level = step.position.level
        if fits := first if k == 0 else again if k == last_sweep else ():
            for record in fit_records(trace, level, step.position.sweep + sweeps_before[level], fits):
                trace.append(record)
                sweeps_before[level] = record.position.sweep + 1 - step.position.sweep
            trace.continue_at(_later(step.position, sweeps_before[level]))
        shift = len(trace) - k
        following = step.next_position
        trace.append(
            replace(
                step,
                position=_later(step.position, sweeps_before[level]),
                next_position=_later(following, sweeps_before.get(following.level, 0)),
                sweep_moment=step.sweep_moment + shift,
            )
        )
    return trace


def fit_records(trace: Trace, level: int, sweep: int, fits: Sequence[Fit]) -> Iterator[StepRecord]:
    """The records of fits, which follow those of the trace; every vertex is in the end where it was."""
    n, n_views = len(trace.start), len(trace.header["views"])
    home = trace.vertices_at(len(trace))
    reach = 0.01 * np.linalg.norm(np.ptp(home, axis=0))
    away = reach * np.stack([np.sin(np.arange(n)), np.cos(np.arange(n)), np.sin(2.0 * np.arange(n))], axis=1)
    total = sum(sweeps * iterations for _, sweeps, iterations in fits)
    done, now = 0, home
    for kind, sweeps, iterations in fits:
        for _ in range(sweeps):
            begun, objective = len(trace), 100.0 * len(fits)
            for iteration in range(iterations):
                done += 1
                is_judge = kind is StageKind.JUDGE
                ids = np.arange(min(4, n)) if is_judge else np.arange(n)
                place = home + away * np.sin(np.pi * done / total)
                after = home[ids] if done == total else place[ids]
                if done == total:
                    ids, after = np.arange(n), home
                reason = StepReason.RETURNED if is_judge else StepReason.ACCEPTED
                u, left = len(ids), objective * (1.0 if is_judge else 0.97)
                none, zeros = np.zeros(0), np.zeros(u)
                yield StepRecord(
                    position=SchedulePosition(level, sweep, 0, iteration),
                    next_position=SchedulePosition(level, sweep + (iteration + 1 == iterations), 0, (iteration + 1) % iterations),
                    sweep_moment=begun, vertices=ids, before=now[ids], proposed=after - now[ids], after=after,
                    step_px=np.full(u, 2.0 / done), damping=zeros, eigenvalues=np.zeros((u, 3)),
                    reasons=np.full(u, reason, dtype=np.int8), objective_before=0.0 if is_judge else objective,
                    objective_after=0.0 if is_judge else left, faces=np.zeros(0, dtype=int), face_energy_before=none,
                    face_energy_after=none, view_energy_before=np.zeros(n_views), view_energy_after=np.zeros(n_views),
                    damping_next=zeros, rejections=np.zeros(u, dtype=int), stage=kind,
                )  # fmt: skip
                objective = left
                now = now.copy()
                now[ids] = after
            sweep += 1


def _later(position: SchedulePosition, sweeps: int) -> SchedulePosition:
    return position._replace(sweep=position.sweep + sweeps)
