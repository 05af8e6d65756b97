"""What the tests of the page have in common. A module says which debugger it visits by a fixture `app`."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser

from app.server import App
from tests.browser.driver import Visitor, chromium

pytest_plugins = ["tests.remembered_steps"]


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as browser:
        yield browser


@pytest.fixture(scope="module")
def visitor_for_all(browser: Browser, app: App) -> Visitor:
    return Visitor(browser, app)


@pytest.fixture
def visitor(visitor_for_all: Visitor) -> Iterator[Visitor]:
    """A page that earlier tests of the module have used; fails a test that leaves trouble behind."""
    visitor_for_all.app.controller.wait_until_idle()
    yield visitor_for_all
    assert visitor_for_all.troubles == []
