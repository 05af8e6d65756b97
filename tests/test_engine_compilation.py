"""The compilation of the engine at its first start: what waits for which part of it."""

import subprocess
import sys
import threading
from collections.abc import Iterator

import pytest

from app.debugger import engine_compilation
from app.debugger.engine_compilation import EngineCompilation
from app.debugger.engine_compiler import READY, Part
from app.debugger.work_report import WorkReport
from app.pictures.texturer import Texturer
from app.stage import Stage
from tests.small_scene import corner_scene
from tests.waiting import PATIENCE, wait_for

PROCESS = "import sys\nfor line in sys.stdin: print(line, end='', flush=True)"
"""In place of a process: it reports what it is told."""


class Told:
    """A compilation whose processes report what a test tells them."""

    def __init__(self) -> None:
        self.compilation = EngineCompilation()

    def report(self, part: Part, line: str) -> None:
        stdin = self.compilation._processes[part].stdin
        assert stdin is not None
        stdin.write(line + "\n")
        stdin.flush()


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> Iterator[Told]:
    real = subprocess.Popen
    monkeypatch.setattr(
        engine_compilation.subprocess, "Popen", lambda command, **how: real([sys.executable, "-c", PROCESS], **how)
    )
    told = Told()
    yield told
    told.compilation.close()


def test_steps_wait_for_the_engine_and_painting_waits_for_what_paints(told: Told):
    compilation = told.compilation
    steps = threading.Thread(target=compilation.wait, args=(lambda: False,), daemon=True)
    painting = threading.Thread(target=compilation.wait_for_painting, daemon=True)
    steps.start()
    painting.start()
    told.report(Part.STEPS, "3 50")
    wait_for(lambda: compilation.compiled == (3, 50))
    assert steps.is_alive()
    assert isinstance(compilation.report, WorkReport)
    told.report(Part.STEPS, READY)
    wait_for(lambda: not steps.is_alive())
    assert compilation.report is None
    assert painting.is_alive()
    told.report(Part.SURFACES, READY)
    wait_for(lambda: not painting.is_alive())


def test_nothing_waits_for_processes_that_ended(told: Told):
    waiting = [
        threading.Thread(target=told.compilation.wait, args=(lambda: False,), daemon=True),
        threading.Thread(target=told.compilation.wait_for_painting, daemon=True),
    ]
    for thread in waiting:
        thread.start()
    told.compilation.close()
    wait_for(lambda: not any(thread.is_alive() for thread in waiting))


def test_a_mesh_is_painted_once_painting_is_compiled():
    scene, compiled, ready = corner_scene(), threading.Event(), threading.Event()

    def wait() -> None:
        compiled.wait(PATIENCE)

    texturer = Texturer(scene, Stage.of(scene), ready.set, wait)
    try:
        vertices = scene.mesh.vertices
        assert texturer.static.painted("page", vertices) is None
        assert not ready.wait(0.3)
        compiled.set()
        assert ready.wait(PATIENCE)
        found = texturer.static.painted("page", vertices)
        assert found is not None
        assert found.vertices is vertices
    finally:
        compiled.set()
        texturer.close()
