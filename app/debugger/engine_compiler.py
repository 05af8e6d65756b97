"""Engine compiler: a process that compiles a part of the engine by using it on a small scene.

It prints `READY` once nothing waits for the rest; one that compiles a step also prints how many functions it has begun.
"""

import enum
import functools
import gc
import hashlib
import os
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

import fairing
from app.debugger.overload_memory import remember_overloads
from fairing.camera import Camera
from fairing.photo import ArrayPhoto
from fairing.scene import Scene, View

READY = "ready"
SIDE = 200  # px of a photo of the small scene
LESS_URGENT = 10  # niceness of what is waited for, though less than for a step, ...
NOT_URGENT = 15  # ... and of what is not waited for


class Part(enum.StrEnum):
    """What one process compiles.

    Attributes:
        STEPS: a step, then the last level and the cells of a face.
        SURFACES: closest points and surface sweeps, then what paints the mesh.
    """

    STEPS = "steps"
    SURFACES = "surfaces"


def is_compiled() -> bool:
    """Whether this engine has been compiled on this machine."""
    return all(_marker(part).exists() for part in Part)


def _marker(part: Part) -> Path:
    """The file beside the compiled functions that is written when all of a part are there."""
    from fairing.kernels.faces import evaluate_faces

    return Path(evaluate_faces._cache.cache_path) / f"engine-{_engine_key()}.{part}"  # pyright: ignore


@functools.cache
def _engine_key() -> str:
    """Changes with the engine's sources, the compiler and the processor."""
    import numba
    from llvmlite.binding import get_host_cpu_name

    sources = sorted(Path(str(fairing.__file__)).parent.rglob("*.py"))
    contents = [path.read_bytes() for path in sources]
    contents.append(f"{numba.__version__} {sys.version} {get_host_cpu_name()}".encode())
    return hashlib.sha256(b"".join(contents)).hexdigest()[:16]


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
    return Scene.build("small", np.vstack([[0.05, 0.05, 0.05], rim]), faces, tuple(views), points_choice="given")


def functions_of_a_step() -> set[Callable[..., object]]:
    """The Python functions that are compiled for a step: those of visibility and cells, and all they call."""
    from numba.core.dispatcher import Dispatcher

    import fairing.run.session  # noqa: F401 - imports the modules
    from fairing.kernels.faces import evaluate_faces

    found: set[Callable[..., object]] = set()
    pending: list[Any] = [evaluate_faces]
    for name, module in list(sys.modules.items()):
        if name.startswith("fairing.cells.") and name != "fairing.cells.point_spread":  # first used at the last level
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


def compile_part(part: Part) -> None:
    """Compile a part of the engine."""
    if part is Part.STEPS:
        _use_steps(small_scene())
    else:
        _yield_to_others(LESS_URGENT)
        _use_surfaces(small_scene())
    _marker(part).touch()


def _use_steps(scene: Scene) -> None:
    from fairing.judge.inspect import face_cells
    from fairing.run.session import Session

    _report_functions_of_a_step()
    session = Session(scene)
    session.step()
    print(READY, flush=True)  # noqa: T201
    _yield_to_others(NOT_URGENT)
    session.run()
    face_cells(session, 0)


def _report_functions_of_a_step() -> None:
    """Print from now on, whenever numba begins a function, how many of those of a step it has begun."""
    from numba.core import event

    expected, begun = functions_of_a_step(), set()

    class Reporter(event.Listener):
        def on_start(self, event: Any) -> None:
            begun.add(event.data["dispatcher"].py_func)
            print(len(begun & expected), len(expected), flush=True)  # noqa: T201

        def on_end(self, event: Any) -> None:
            pass

    event.register("numba:compile", Reporter())


def _use_surfaces(scene: Scene) -> None:
    from fairing.features.surface_sweep import SurfaceSweep
    from fairing.geometry.closest_point import SurfaceTree
    from fairing.texture import textured_model

    SurfaceTree(scene.mesh).closest(scene.mesh.vertices)
    with ThreadPoolExecutor(1) as pool:
        SurfaceSweep(scene.views, pool).points(scene.mesh, 3.0)
    textured_model(scene, scene.mesh.vertices)
    print(READY, flush=True)  # noqa: T201


def _yield_to_others(niceness: int) -> None:
    if hasattr(os, "nice"):
        os.nice(niceness)


def _end_with_input() -> None:
    sys.stdin.read()
    os._exit(1)


if __name__ == "__main__":
    remember_overloads()
    gc.disable()  # a tenth of the time to compile; the process is short-lived and grows from 360 to 480 MB
    threading.Thread(target=_end_with_input, daemon=True).start()
    compile_part(Part(sys.argv[1]))
