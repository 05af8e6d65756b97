"""What stands in the 3D view, in a real browser: colours, shapes, photos behind the mesh, dark and light."""

import pytest

from app.server import start
from demo_scenes import load_demo
from fairing.options import FairingOptions, ScheduleOptions
from fairing.session import Session
from tests.browser.driver import CHROMIUM, Visitor, chromium

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium on the PATH; install it to test the page"),
]

OPTIONS = FairingOptions(
    schedule=ScheduleOptions(blur=(3.6, 2.0), order="joint", max_sweeps=(1,), max_iterations=(3,), start="first")
)


@pytest.fixture(scope="module")
def scene():
    return load_demo("cube")


@pytest.fixture(scope="module")
def app(scene):
    session = Session(scene, OPTIONS)
    session.step()
    app = start(session, port=0)
    yield app
    app.stop()


@pytest.fixture(scope="module")
def visitor_for_all(app):
    with chromium() as browser:
        yield Visitor(browser, app)


@pytest.fixture
def visitor(visitor_for_all: Visitor):
    visitor_for_all.app.controller.wait_until_idle()
    visitor_for_all.page.get_by_role("tab", name="Layers").click()
    yield visitor_for_all
    assert visitor_for_all.troubles == []


def test_the_theme_switches_and_the_browser_remembers_it(visitor: Visitor):
    def ground() -> str:
        return visitor.page.evaluate("getComputedStyle(document.querySelector('.ef')).getPropertyValue('--button')")

    dark = ground()
    visitor.page.keyboard.press("t")
    visitor.page.wait_for_selector("html[data-mantine-color-scheme=light]")
    assert ground() != dark
    visitor.open()
    visitor.page.wait_for_selector("html[data-mantine-color-scheme=light]")
    visitor.page.keyboard.press("t")
    visitor.page.wait_for_selector("html[data-mantine-color-scheme=dark]")
    assert ground() == dark
