"""What the tests of the page have in common. A module says which debugger it visits by its OPTIONS or a fixture `app`."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser

from app.page.server import App, start
from demo_scenes import load_demo
from fairing.run.session import Session
from tests.browser.driver import Visitor, chromium

pytest_plugins = ["tests.remembered_steps"]


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as browser:
        yield browser


@pytest.fixture(scope="module")
def app(request: pytest.FixtureRequest) -> Iterator[App]:
    """The debugger on the cube with the module's OPTIONS, unless the module has an `app` of its own."""
    app = start(Session(load_demo("cube"), request.module.OPTIONS), port=0)
    yield app
    app.stop()


@pytest.fixture(scope="module")
def visitor_for_all(browser: Browser, app: App) -> Visitor:
    return Visitor(browser, app)


@pytest.fixture
def visitor(visitor_for_all: Visitor) -> Iterator[Visitor]:
    """A page that earlier tests of the module have used; fails a test that leaves trouble behind."""
    visitor_for_all.app.controller.wait_until_idle()
    yield visitor_for_all
    assert visitor_for_all.troubles == []
