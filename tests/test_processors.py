"""Emulated processors: their code is another, no cache mixes them, and NumPy and OpenCV follow."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.processors import PROCESSORS, ROOT, can_emulate, environment

PRODUCT = """
import json
import cv2
import numpy as np
from fairing.kernels.compiled import cached
from fairing.kernels.rows import dot

@cached
def product(a, b):
    return dot(a, b)

total = product(np.arange(1000, dtype=np.float32), np.full(1000, 0.1, np.float32))
hits = sum(product.stats.cache_hits.values())
code = "" if hits else "".join(product.inspect_asm().values())
words = [word for word in ("xmm", "ymm", "zmm", "vfmadd") if word in code]
optimal = [name for name in cv2.getCPUFeaturesLine().split() if name.startswith("*") and not name.endswith("?")]
print(json.dumps({"hits": hits, "words": words, "total": total, "opencv": optimal}))
"""


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[dict]]:
    """What each processor computes in two processes, by turns, with one cache for all; "host" as it comes."""
    folder = tmp_path_factory.mktemp("processors")
    script = folder / "product.py"
    script.write_text(PRODUCT)
    shared = {"NUMBA_CACHE_DIR": str(folder / "numba"), "PYTHONPATH": str(ROOT)}
    names = [name for name in PROCESSORS if can_emulate(name)]
    environments = {"host": os.environ | shared} | {name: environment(name, folder) | shared for name in names}
    found = {name: [] for name in environments}
    for _ in range(2):
        for name, variables in environments.items():
            done = subprocess.run([sys.executable, script], env=variables, capture_output=True, text=True, check=True)
            found[name].append(json.loads(done.stdout))
    return found


@pytest.mark.slow
def test_the_code_is_that_of_the_processor(found: dict[str, list[dict]]):
    """Two doubles fit into xmm, four into ymm, eight into zmm; vfmadd multiplies and adds."""
    if "generic" in found:
        assert found["generic"][0]["words"] == ["xmm"]
    if "haswell" in found:
        assert {"ymm", "vfmadd"} <= set(found["haswell"][0]["words"])
        assert "zmm" not in found["haswell"][0]["words"]


def test_opencv_follows(found: dict[str, list[dict]]):
    if "generic" in found:
        assert found["generic"][0]["opencv"] == []
    if "haswell" in found:
        assert not [name for name in found["haswell"][0]["opencv"] if "AVX512" in name]


def test_code_of_one_processor_is_never_loaded_on_another(found: dict[str, list[dict]]):
    for name, (first, second) in found.items():
        assert first["hits"] == 0, f"{name} loaded what another compiled"
        assert second["hits"] == 1, f"{name} compiled again"
        assert first["total"] == second["total"]


def test_features_that_this_machine_lacks_are_not_emulated(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("tests.processors.llvm.get_host_cpu_features", lambda: {"sse": True, "sse2": True})
    assert not can_emulate("haswell")


@pytest.mark.parametrize("name", PROCESSORS)
def test_caches_lie_in_the_folder_given(name: str, tmp_path: Path):
    variables = environment(name, tmp_path)
    assert Path(variables["NUMBA_CACHE_DIR"]).parent == Path(variables["EIGENFAIRING_CACHE"]).parent == tmp_path
