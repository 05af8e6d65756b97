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
