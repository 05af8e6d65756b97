"""Cases measured in processes of their own, so that neither the page nor its engine waits for them."""

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
LOOK_UP = 0.1  # s: how soon a wish to stop is noticed


def measure_all(
    experiment: Experiment,
    setting: Setting,
    cases: Sequence[Row],
    workers: int,
    on_row: Callable[[Row], None],
    should_stop: Callable[[], bool],
) -> bool:
    """Measure cases in up to so many processes; rows are the same for any number, only their order is not.

    The first result comes from one process alone: on a new machine it compiles the engine, and the others find that
    done. A wish to stop drops the cases in hand.

    Returns:
        Whether all were measured.

    Raises:
        InputError: a case cannot be measured, or a process died.
    """
    context = multiprocessing.get_context("spawn")
    # Every process has a core of its own; results do not depend on the number of threads.
    setting = Setting(setting.scene, setting.vertex, replace(setting.options, threads=1))
    waiting = list(cases)
    at_work: dict[Connection, BaseProcess] = {}

    def employ() -> None:
        ours, theirs = context.Pipe()
        process = context.Process(target=_work, args=(theirs, experiment, setting), daemon=True)
        with _deaf_to_ctrl_c():
            process.start()
        theirs.close()
        at_work[ours] = process
        ours.send(waiting.pop(0))

    try:
        if waiting:
            employ()
        while at_work:
            if should_stop():
                return False
            for connection in wait(list(at_work), timeout=LOOK_UP):
                assert isinstance(connection, Connection)
                on_row(_received(connection))
                if waiting:
                    connection.send(waiting.pop(0))
                else:
                    _dismiss(connection, at_work.pop(connection))
                while waiting and len(at_work) < workers:
                    employ()
        return True
    finally:
        for connection, process in at_work.items():
            process.terminate()
            _dismiss(connection, process)


def _received(connection: Connection) -> Row:
    try:
        answer = connection.recv()
    except (EOFError, OSError):
        raise InputError(
            "an experiment's process ended before its time; perhaps there is not enough memory: close other programs"
        ) from None
    if isinstance(answer, str):
        raise InputError(answer)
    return answer


def _dismiss(connection: Connection, process: BaseProcess) -> None:
    connection.close()
    process.join()


def _work(connection: Connection, experiment: Experiment, setting: Setting) -> None:
    """In the process: answer every case by its row, or by a line that says what is wrong, until nobody asks any more."""
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    with contextlib.suppress(EOFError, OSError):
        while True:
            case = connection.recv()
            try:
                answer: Row | str = measured(experiment, setting, case)
            except InputError as error:
                answer = str(error)
            except Exception as error:  # the page must learn of it, whatever it is
                answer = f"{type(error).__name__}: {error}"
            connection.send(answer)


@contextlib.contextmanager
def _deaf_to_ctrl_c():
    """Processes started here do not hear Ctrl-C, which goes to all of the terminal: their starter ends them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # when it starts it lets SIGINT in again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
