"""The page of `compare`, opened from disk in a real browser without a network."""

from pathlib import Path

import pytest
import trimesh
from playwright.sync_api import Browser, Page

from app.cli.main import run
from demo_scenes import load_demo
from tests.browser.driver import IN_BROWSER

pytestmark = IN_BROWSER


@pytest.fixture(scope="module")
def path(tmp_path_factory) -> Path:
    scene, folder = load_demo("cube"), tmp_path_factory.mktemp("compared")
    assert scene.truth is not None
    for name, vertices in (("start", scene.mesh.vertices), ("truth", scene.truth.vertices)):
        trimesh.Trimesh(vertices, scene.mesh.faces, process=False).export(folder / f"{name}.ply")
    assert (
        run(
            [
                "compare",
                "cube",
                *(str(folder / f"{name}.ply") for name in ("start", "truth")),
                "--out",
                str(folder / "page.html"),
            ]
        )
        == 0
    )
    return folder / "page.html"


def sources(page: Page) -> list[str]:
    return page.locator("#meshes img").evaluate_all("images => images.map((image) => image.src)")


@pytest.mark.parametrize("width", [390, 1280])
def test_one_slider_turns_all_meshes_and_a_button_shades_them(path: Path, browser: Browser, width: int):
    page = browser.new_page(viewport={"width": width, "height": 720})
    requests, troubles = [], []
    page.on("request", lambda request: requests.append(request.url))
    page.on("pageerror", lambda error: troubles.append(str(error)))
    page.goto(path.as_uri())
    begun = sources(page)
    assert len(begun) == 2
    assert page.locator("#meshes img").evaluate_all("images => images.every((image) => image.naturalWidth > 100)")
    assert page.locator("#meshes img").first.evaluate("image => getComputedStyle(image).objectFit") == "contain", (
        "whole"
    )
    assert page.locator("thead th").last.evaluate("head => head.clientWidth") >= 84
    page.keyboard.press("ArrowRight")
    turned = sources(page)
    assert all(now != before for now, before in zip(turned, begun, strict=True))
    page.keyboard.press("ArrowLeft")
    assert sources(page) == begun
    page.get_by_role("button", name="Shaded").click()
    assert all(now != before for now, before in zip(sources(page), begun, strict=True))
    page.get_by_role("slider").focus()
    page.keyboard.press("Home")
    page.get_by_role("button", name="Shaded").click()
    assert not set(sources(page)) & {*begun, *turned}
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert [url for url in requests if not url.startswith("data:")] == [path.as_uri()]
    assert not troubles
