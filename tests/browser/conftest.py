"""Fixtures of the page tests. A module sets the debugger it visits by its OPTIONS or by a fixture `app` of its own."""

from collections.abc import Generator, Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from app.page.server import App, start
from demo_scenes import load_demo
from fairing.run.session import Session
from tests.browser.driver import CHEAP_FRAMES, WINDOW, Visitor, chromium
from tests.waiting import PATIENCE

expect.set_options(timeout=1000 * PATIENCE)


@pytest.fixture(scope="package")
def shared_browser() -> Iterator[Browser]:
    """One browser for all modules: each start takes 3 s of processor time."""
    with chromium() as browser:
        yield browser


@pytest.fixture(scope="module")
def browser(shared_browser: Browser) -> Iterator[Browser]:
    """The browser; tabs that a module leaves open would go on drawing beside those of the next."""
    yield shared_browser
    for context in shared_browser.contexts:
        context.close()


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """A tab of the test's own."""
    page = browser.new_page(viewport=WINDOW)
    page.add_init_script(CHEAP_FRAMES)
    page.set_default_timeout(1000 * PATIENCE)
    yield page
    page.close()


@pytest.fixture(scope="module")
def app(request: pytest.FixtureRequest) -> Iterator[App]:
    """The debugger on the cube with the module's OPTIONS, unless the module defines an `app` of its own."""
    app = start(Session(load_demo("cube"), request.module.OPTIONS), port=0)
    yield app
    app.stop()


@pytest.fixture(scope="module")
def module_visitor(browser: Browser, app: App) -> Visitor:
    return Visitor(browser, app)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """A test that fails reports what its page showed."""
    report = yield
    visitor = getattr(item, "funcargs", {}).get("module_visitor")
    if report.when == "call" and report.failed and visitor is not None:
        try:
            report.sections.append(("the page", visitor.situation()))
        except Exception as error:  # the page may be what failed
            report.sections.append(("the page", f"could not be asked: {error}"))
    return report


@pytest.fixture
def visitor(module_visitor: Visitor) -> Iterator[Visitor]:
    """A page that earlier tests of the module have used. A test that leaves console errors behind fails."""
    module_visitor.app.controller.wait_until_idle()
    # A test that failed while it typed must not take the keys of the next ones.
    module_visitor.page.evaluate("document.activeElement?.blur()")
    yield module_visitor
    troubles = module_visitor.troubles.copy()
    module_visitor.troubles.clear()  # of this test, not of the next one
    assert troubles == []
