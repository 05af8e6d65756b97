"""Worker processes: the cases of an experiment measured in separate processes."""

import contextlib
import multiprocessing
import os
import signal
from collections.abc import Callable, Sequence
from dataclasses import replace
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess

from fairing.errors import InputError
from fairing.experiments import Experiment, Row, Setting
from fairing.experiments.experiment import measured

NICENESS = 10
MOST_WORKERS = 8
POLL = 0.1  # s between two checks for cancellation


def measure_all(
    experiment: Experiment,
    setting: Setting,
    cases: Sequence[Row],
    workers: int,
    on_row: Callable[[Row], None],
    should_stop: Callable[[], bool],
) -> bool:
    """Measure cases in up to `workers` processes. The rows do not depend on their number, but the order does.

    A single process measures the first case: on a new machine it compiles the engine for all. Cancellation drops the
    cases in progress.

    Returns:
        Whether all cases were measured.

    Raises:
        InputError: a case cannot be measured, or a process ended unexpectedly.
    """
    context = multiprocessing.get_context("spawn")
    # One thread for each process; results do not depend on the number of threads.
    setting = Setting(setting.scene, setting.vertex, replace(setting.options, threads=1))
    waiting = list(cases)
    busy: dict[Connection, BaseProcess] = {}

    def start_process() -> None:
        ours, theirs = context.Pipe()
        process = context.Process(target=_work, args=(theirs, experiment, setting), daemon=True)
        with _sigint_blocked():
            process.start()
        theirs.close()
        busy[ours] = process
        ours.send(waiting.pop(0))

    try:
        if waiting:
            start_process()
        while busy:
            if should_stop():
                return False
            for connection in wait(list(busy), timeout=POLL):
                assert isinstance(connection, Connection)
                on_row(_received(connection))
                if waiting:
                    connection.send(waiting.pop(0))
                else:
                    _end(connection, busy.pop(connection))
                while waiting and len(busy) < workers:
                    start_process()
        return True
    finally:
        for connection, process in busy.items():
            process.terminate()
            _end(connection, process)


def rows_in_order(
    experiment: Experiment, setting: Setting, cases: Sequence[Row], on_progress: Callable[[float], None]
) -> list[Row]:
    """Measure all cases in one process per core; the rows in the order of the cases.

    Args:
        on_progress: called with the fraction that is done.

    Raises:
        InputError: as `measure_all`.
    """
    rows: list[Row] = []

    def take(row: Row) -> None:
        rows.append(row)
        on_progress(len(rows) / len(cases))

    measure_all(experiment, setting, cases, min(os.cpu_count() or 1, MOST_WORKERS), take, lambda: False)
    order = {tuple(case.items()): n for n, case in enumerate(cases)}
    return sorted(rows, key=lambda row: order[tuple((name, row[name]) for name in cases[0])])


def _received(connection: Connection) -> Row:
    try:
        answer = connection.recv()
    except (EOFError, OSError):
        raise InputError(
            "a process of the experiment ended unexpectedly, perhaps for lack of memory; close other programs"
        ) from None
    if isinstance(answer, str):
        raise InputError(answer)
    return answer


def _end(connection: Connection, process: BaseProcess) -> None:
    connection.close()
    process.join()


def _work(connection: Connection, experiment: Experiment, setting: Setting) -> None:
    """The main function of a process: answer every case with its row or an error line, until the connection is closed."""
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    with contextlib.suppress(EOFError, OSError):
        while True:
            case = connection.recv()
            try:
                answer: Row | str = measured(experiment, setting, case)
            except InputError as error:
                answer = str(error)
            except Exception as error:
                answer = f"{type(error).__name__}: {error}"
            connection.send(answer)


@contextlib.contextmanager
def _sigint_blocked():
    """Processes started here ignore Ctrl-C, which the terminal sends to all processes: the parent ends them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # it unblocks SIGINT when it starts
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
