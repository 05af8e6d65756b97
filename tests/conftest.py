"""Fixtures of the whole suite. Nothing here imports the server or a browser: see tests/browser/conftest.py for those."""

pytest_plugins = ["tests.remembered_steps"]
