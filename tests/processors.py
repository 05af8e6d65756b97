"""Other processors, emulated: `python -m tests.processors` runs the tests marked `compiled` as on each of them.

numba compiles for the processor that it is told. NumPy, OpenBLAS and OpenCV hold loops for several and choose by what the
processor can do; their own variables restrict the choice.
"""

import os
import platform
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from llvmlite import binding as llvm
from numpy._core._multiarray_umath import __cpu_dispatch__ as numpy_dispatched
from numpy._core._multiarray_umath import __cpu_features__ as numpy_features

ROOT = Path(__file__).parents[1]


@dataclass(frozen=True)
class Processor:
    """A kind of x86-64 processor.

    Attributes:
        features: LLVM's names of what it can do. NUMBA_CPU_NAME alone would keep what the host can do.
        blas: OpenBLAS's name of it.
        lacks_in_numpy: prefixes of the groups of features that NumPy chooses loops by.
        lacks_in_opencv: the features that OpenCV chooses loops by.
    """

    features: tuple[str, ...]
    blas: str
    lacks_in_numpy: tuple[str, ...]
    lacks_in_opencv: tuple[str, ...]


PROCESSORS = {
    # Every x86-64 processor: two doubles in a register, no fused multiplication and addition.
    "generic": Processor(
        ("64bit", "cx8", "fxsr", "mmx", "sse", "sse2"),
        "Prescott",
        ("",),
        ("SSE4.1", "SSE4.2", "AVX", "FP16", "FMA3", "AVX2", "AVX512-SKX"),
    ),
    # Since 2013: four doubles, fused multiplication and addition, no AVX-512.
    "haswell": Processor(
        (
            "64bit", "avx", "avx2", "bmi", "bmi2", "cmov", "crc32", "cx16", "cx8", "f16c", "fma", "fsgsbase", "fxsr", "lzcnt",
            "mmx", "movbe", "pclmul", "popcnt", "sahf", "sse", "sse2", "sse3", "sse4.1", "sse4.2", "ssse3", "xsave", "xsaveopt",
        ),
        "Haswell",
        ("AVX512", "X86_V4"),
        ("AVX512-SKX",),
    ),
}  # fmt: skip


def can_emulate(name: str) -> bool:
    """Whether this machine can do all that the processor can."""
    host = llvm.get_host_cpu_features()
    return platform.machine() in ("x86_64", "AMD64") and all(host.get(feature) for feature in PROCESSORS[name].features)


def environment(name: str, folder: Path) -> dict[str, str]:
    """The variables of this process, changed so that a new one computes as on this processor.

    Args:
        folder: compiled code and rendered photos are kept there. numba tells processors apart; photos are rendered by
            compiled code, too, and their cache does not.
    """
    processor = PROCESSORS[name]
    without = [
        group
        for group in numpy_dispatched
        if numpy_features[group] and any(group.startswith(prefix) for prefix in processor.lacks_in_numpy)
    ]
    return os.environ | {
        "NUMBA_CPU_NAME": name,
        "NUMBA_CPU_FEATURES": ",".join(f"+{feature}" for feature in processor.features),
        "NUMBA_CACHE_DIR": str(folder / "numba"),
        "EIGENFAIRING_CACHE": str(folder / "cache"),
        "OPENBLAS_CORETYPE": processor.blas,
        "NPY_DISABLE_CPU_FEATURES": " ".join(without),
        "OPENCV_CPU_DISABLE": ",".join(processor.lacks_in_opencv),
    }


def run_each(arguments: Callable[[str], Sequence[str]], folder: Path) -> dict[str, subprocess.CompletedProcess[str]]:
    """Run Python as on each processor that this machine can emulate, all at once; output as text.

    Args:
        arguments: of Python, by the processor's name.
        folder: each has a folder for its caches there, with its name.
    """
    running = {
        name: subprocess.Popen(
            [sys.executable, *arguments(name)],
            cwd=ROOT,
            env=environment(name, folder / name),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        for name in PROCESSORS
        if can_emulate(name)
    }
    outputs = {name: process.communicate()[0] for name, process in running.items()}
    return {
        name: subprocess.CompletedProcess(process.args, process.returncode, outputs[name])
        for name, process in running.items()
    }


def main() -> int:
    """Run the tests of compiled code as on each processor; arguments go to pytest."""
    with TemporaryDirectory() as folder:
        pytest = ["-m", "pytest", "-n", "0", "-p", "no:cacheprovider", "-m", "compiled and not slow", *sys.argv[1:]]
        found = run_each(lambda _: pytest, Path(folder))
    for name in PROCESSORS:
        print(f"as on {name}: {found[name].stdout if name in found else 'this machine cannot emulate it'}")
    return max((run.returncode for run in found.values()), default=0)


if __name__ == "__main__":
    sys.exit(main())
