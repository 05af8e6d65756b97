"""Fixtures of the whole suite. Nothing here imports the server or a browser: see tests/browser/conftest.py for those."""

import os

import pytest

# Before NumPy is imported. Four processes share the tests, and threads of OpenBLAS that wait for each other's use up their
# processors: with one thread each, two lessons took 14 s of processor time instead of 29 s.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

pytest_plugins = ["tests.remembered_steps"]


BROWSERS = 2
"""Most browsers at once: each draws in software, and a page that waits too long for the others misses clicks."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Four processes share the tests (pytest-xdist): a module's tests stay together, and the modules in browsers take turns.

    First, because pytest-xdist reads the marker in the same hook.
    """
    in_browser = sorted({item.path.name for item in items if item.get_closest_marker("browser") is not None})
    lanes = {name: f"browser {k % BROWSERS}" for k, name in enumerate(in_browser)}
    for item in items:
        item.add_marker(pytest.mark.xdist_group(lanes.get(item.path.name, item.path.name)))


def pytest_collection_finish(session: pytest.Session) -> None:
    """Stop if pytest-xdist has not read the groups: with pytest 9.2 it (3.8) divides modules without a word."""
    if getattr(session.config.option, "loadgroup", False):
        assert all("@" in item.nodeid for item in session.items), "pytest-xdist did not group the tests"
