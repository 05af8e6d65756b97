"""Engine compilation: compiles the engine at its first start, in a process of its own beside the opening of the scene.

numba compiles one function at a time in a process, and keeps the result on disk. The process makes one step on a small scene;
this one finds the compiled functions on disk afterwards.
"""

import hashlib
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import fairing
from app.debugger.work_report import WorkReport
from fairing.camera import Camera
from fairing.errors import Cancelled
from fairing.photo import ArrayPhoto
from fairing.scene import Scene, View

POLL = 0.1  # s
SIDE = 200  # px of a photo of the small scene


class Compiled(NamedTuple):
    """What the process has reported so far.

    Attributes:
        done: number of functions that have been begun.
        total: number of functions of a step; 0 before it is known.
    """

    done: int = 0
    total: int = 0


class EngineCompilation:
    """The process, from its start. It ends with this one; if it fails, functions are compiled where they are used."""

    def __init__(self) -> None:
        self.compiled = Compiled()
        self._began = time.monotonic()
        self._finished, self._paints = threading.Event(), threading.Event()
        self._process = subprocess.Popen(
            [sys.executable, "-m", __name__],
            stdin=subprocess.PIPE,  # its end ends the process
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        threading.Thread(target=self._follow, name="engine compilation", daemon=True).start()

    @property
    def report(self) -> WorkReport | None:
        """What is done; None once it is finished."""
        if self._finished.is_set():
            return None
        seconds, (done, total) = round(time.monotonic() - self._began), self.compiled
        which = f": {done} of {total}" if total else ""
        return WorkReport(f"compiling the engine, first start{which}", done / max(1, total), seconds=seconds)

    def wait(self, cancelled: Callable[[], bool]) -> None:
        """Wait for the end.

        Raises:
            Cancelled: `cancelled` returned True.
        """
        while not self._finished.wait(POLL):
            if cancelled():
                raise Cancelled

    def wait_for_painting(self) -> None:
        """Wait until what paints the mesh is compiled, too: compiled twice at a time, it would delay the first step."""
        self._paints.wait()

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._finished.wait(5)

    def _follow(self) -> None:
        assert self._process.stdout is not None
        with self._process:
            for line in self._process.stdout:
                if line.strip() == DONE:
                    self._finished.set()  # what the process compiles further is not needed for a step
                elif line.strip() == PAINTS:
                    self._paints.set()
                done, _, count = line.strip().partition(" ")
                if done.isdigit() and count.isdigit():
                    self.compiled = Compiled(int(done), int(count))
            self._finished.set()
            self._paints.set()


DONE, PAINTS = "done", "paints"


def is_compiled() -> bool:
    """Whether this engine has been compiled on this machine."""
    return _marker().exists()


def _marker() -> Path:
    """The file beside the compiled functions that is written when all of them are there."""
    import numba
    from llvmlite.binding import get_host_cpu_name

    from fairing.kernels.faces import evaluate_faces

    sources = sorted(Path(str(fairing.__file__)).parent.rglob("*.py"))
    parts = [path.read_bytes() for path in sources]
    parts.append(f"{numba.__version__} {sys.version} {get_host_cpu_name()}".encode())
    digest = hashlib.sha256(b"".join(parts)).hexdigest()[:16]
    return Path(evaluate_faces._cache.cache_path) / f"engine-{digest}.compiled"  # pyright: ignore


def small_scene() -> Scene:
    """Six triangles around a vertex in four photos of noise."""
    rng = np.random.default_rng(0)
    angle = np.arange(6) * np.pi / 3
    rim = np.stack([np.cos(angle), np.sin(angle), np.zeros(6)], axis=1)
    faces = np.array([[0, 1 + k, 1 + (k + 1) % 6] for k in range(6)])
    K = np.array([[3.0 * SIDE, 0, SIDE / 2], [0, 3.0 * SIDE, SIDE / 2], [0, 0, 1]])
    views = []
    for k, (x, y) in enumerate([(-1.5, 0.0), (1.5, 0.3), (0.0, 1.5), (0.2, -1.5)]):
        eye = np.array([x, y, 8.0])
        z = -eye / np.linalg.norm(eye)
        right = np.cross(z, [0.0, 1.0, 0.1])
        right /= np.linalg.norm(right)
        R = np.stack([right, np.cross(z, right), z])
        photo = np.kron(rng.integers(0, 255, (SIDE // 8, SIDE // 8, 3), dtype=np.uint8), np.ones((8, 8, 1), np.uint8))
        views.append(View(f"photo{k}", Camera.from_krt(K, R, -R @ eye, SIDE, SIDE), ArrayPhoto(photo)))
    return Scene.build("small", np.vstack([[0.05, 0.05, 0.05], rim]), faces, tuple(views))


def functions_of_a_step() -> set[Callable[..., object]]:
    """The Python functions that are compiled for a step: those of visibility, cells and closest points, and all they call."""
    from numba.core.dispatcher import Dispatcher

    import fairing.run.session  # noqa: F401 - imports the modules
    from fairing.kernels.faces import evaluate_faces

    found: set[Callable[..., object]] = set()
    pending = [evaluate_faces]
    for name, module in list(sys.modules.items()):
        if name.startswith(("fairing.cells.", "fairing.geometry.closest_point")):
            pending += [value for value in vars(module).values() if isinstance(value, Dispatcher)]
    while pending:
        dispatcher = pending.pop()
        function = dispatcher.py_func
        if function in found or dispatcher.targetoptions.get("inline") == "always":
            continue
        found.add(function)
        used = [function.__globals__.get(name) for name in function.__code__.co_names]
        used += [cell.cell_contents for cell in function.__closure__ or ()]
        pending += [value for value in used if isinstance(value, Dispatcher)]
    return found


def _compile() -> None:
    """The process: compile, report each function, and end when the input ends."""
    from numba.core import event

    from fairing.features.surface_sweep import SurfaceSweep
    from fairing.geometry.closest_point import SurfaceTree
    from fairing.judge.inspect import face_cells
    from fairing.run.session import Session
    from fairing.texture import textured_model

    expected, begun = functions_of_a_step(), set()

    class Reporter(event.Listener):
        def on_start(self, event: Any) -> None:
            begun.add(event.data["dispatcher"].py_func)
            print(len(begun & expected), len(expected), flush=True)  # noqa: T201

        def on_end(self, event: Any) -> None:
            pass

    event.register("numba:compile", Reporter())
    session = Session(small_scene())
    session.step()
    SurfaceTree(session.scene.mesh).closest(session.vertices)  # the plan fits the mesh to sparse points
    print(DONE, flush=True)  # noqa: T201
    with ThreadPoolExecutor(1) as pool:  # plans of starts that the points move use it after a fit to the points
        SurfaceSweep(session.scene.views, pool).points(session.scene.mesh, 3.0)
    textured_model(session.scene, session.vertices)  # the page paints the mesh as soon as the scene is open
    print(PAINTS, flush=True)  # noqa: T201
    face_cells(session, 0)
    _marker().touch()


def _end_with_input() -> None:
    sys.stdin.read()
    import os

    os._exit(1)


if __name__ == "__main__":
    threading.Thread(target=_end_with_input, daemon=True).start()
    _compile()
