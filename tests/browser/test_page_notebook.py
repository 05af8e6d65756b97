"""Frames of a notebook in a browser: the exported page without a network, and the live debugger until it is stopped."""

import socket
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser

from app import show
from app.notebook.frame import MAX_BYTES
from fairing.options import FairingOptions
from fairing.run.session import Session
from tests.browser.driver import IN_BROWSER, WINDOW
from tests.browser.lesson_reader import Reader
from tests.small_scene import corner_scene

pytestmark = IN_BROWSER

QUICK = FairingOptions().with_levels(blur=(2.0, 1.0), max_sweeps=1)


def test_a_shown_session_plays_in_its_frame_and_makes_no_request(browser: Browser):
    session = Session(corner_scene(), QUICK)
    session.run()
    html = show(session)._repr_html_()
    assert len(html.encode()) < MAX_BYTES
    reader = Reader(browser.new_context(viewport=WINDOW, offline=True))
    reader.page.set_content(f"<!doctype html><title>notebook</title><body>{html}</body>")
    frame = reader.page.frame_locator("iframe")
    frame.locator("#headline").get_by_text("The end").wait_for()
    frame.get_by_role("button", name="To the start").click()
    assert frame.locator("#headline").inner_text() == "The start"
    frame.get_by_role("button", name="To the end").click()
    frame.locator("#moment").get_by_text(f"{len(session.trace)}").wait_for()
    # The frame has no access to the notebook.
    inner = reader.page.frames[1]
    assert (
        inner.evaluate("(() => { try { return parent.document.title } catch (error) { return error.name } })()")
        == "SecurityError"
    )
    assert [url for url in reader.requests if not url.startswith(("data:", "blob:", "about:"))] == []
    assert reader.troubles == []
    reader.page.context.close()


@pytest.mark.slow
def test_a_live_debugger_opens_in_its_frame_and_frees_its_port_when_stopped(browser: Browser):
    live = show(Session(corner_scene(), QUICK), live=True)
    port = urlsplit(live.url).port
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.set_content(f"<!doctype html><title>notebook</title><body>{live._repr_html_()}</body>")
    page.frame_locator("iframe").get_by_role("button", name="Step one iteration").wait_for(timeout=120_000)
    live.stop()
    live.stop()  # a second time has no effect
    with socket.socket() as free:
        free.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # closed connections to the port may linger
        free.bind(("127.0.0.1", port))
    page.close()
