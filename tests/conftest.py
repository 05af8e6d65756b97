"""Fixtures of the whole suite. Nothing here imports the server or a browser: see tests/browser/conftest.py for those."""

import pytest

pytest_plugins = ["tests.remembered_steps"]


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Two processes share the tests (pytest-xdist): a module's tests stay together, and so do all tests in the browser.

    First, because pytest-xdist reads the marker in the same hook.
    """
    for item in items:
        in_browser = item.get_closest_marker("browser") is not None
        item.add_marker(pytest.mark.xdist_group("browser" if in_browser else item.path.name))


def pytest_collection_finish(session: pytest.Session) -> None:
    """Stop if pytest-xdist has not read the groups: with pytest 9.2 it (3.8) divides modules without a word."""
    if getattr(session.config.option, "loadgroup", False):
        assert all("@" in item.nodeid for item in session.items), "pytest-xdist did not group the tests"
