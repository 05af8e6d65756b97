"""Where no browser can be opened, the command says how to reach the page."""

import webbrowser

import pytest

from app.cli.browser import can_open_browser, how_to_reach, open_page

URL = "http://127.0.0.1:8080"


@pytest.mark.parametrize(
    ("environment", "platform", "can"),
    [
        ({"DISPLAY": ":0"}, "linux", True),
        ({"WAYLAND_DISPLAY": "wayland-0"}, "linux", True),
        ({"DISPLAY": ""}, "linux", False),
        ({"SSH_CONNECTION": "a 1 b 22"}, "linux", False),
        ({"BROWSER": "wslview"}, "linux", True),
        ({}, "darwin", True),
        ({"SSH_CONNECTION": "a 1 b 22"}, "darwin", False),
        ({}, "win32", True),
    ],
)
def test_a_browser_needs_a_screen(environment, platform, can):
    assert can_open_browser(environment, platform) is can


def test_over_ssh_the_lines_name_the_tunnel_to_this_machine():
    lines = how_to_reach(URL, 8080, {"SSH_CONNECTION": "198.51.100.7 50000 203.0.113.9 22"}, in_container=False)
    assert any("ssh -N -L 8080:127.0.0.1:8080 " in line and "@203.0.113.9" in line for line in lines)
    assert URL in lines[-1]


def test_in_a_container_the_lines_name_the_port_to_publish():
    lines = how_to_reach(URL, 8080, {}, in_container=True)
    assert any("-p 127.0.0.1:8080:8080" in line for line in lines)
    assert any("--host 0.0.0.0" in line for line in lines)


@pytest.mark.parametrize("fails", [webbrowser.Error("no browser"), OSError("cannot run"), None])
def test_a_browser_that_does_not_start_is_no_failure(monkeypatch: pytest.MonkeyPatch, fails):
    def open_browser(url: str) -> bool:
        if fails is not None:
            raise fails
        return False

    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(webbrowser, "open", open_browser)
    assert any("To reach the page" in line for line in open_page(URL, 8080))


def test_without_a_screen_no_browser_is_started(monkeypatch: pytest.MonkeyPatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("app.cli.browser.sys.platform", "linux")
    monkeypatch.setattr(webbrowser, "open", lambda url: pytest.fail("a text browser would take over the terminal"))
    assert open_page(URL, 8080)
