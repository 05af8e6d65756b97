"""The site of the guides in a browser, from its files: search, pictures, formulas, no request to a host."""

import re
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from app.guides.site import write_site
from tests.browser.driver import IN_BROWSER, WINDOW

pytestmark = IN_BROWSER


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("guides") / "site"
    write_site(folder)
    return folder


def test_a_search_leads_to_the_section_of_a_guide_and_nothing_comes_from_elsewhere(site: Path, browser: Browser):
    page = browser.new_page(viewport=WINDOW)
    requests: list[str] = []
    page.on("request", lambda request: requests.append(request.url))
    page.goto((site / "index.html").as_uri())
    page.get_by_role("searchbox").fill("undistorted fisheye VisualSFM")
    page.get_by_role("link", name="Your own captures: Formats").click()
    page.wait_for_url(re.compile(r"guides/captures\.html#formats$"))
    assert page.locator("h2#formats").is_visible()
    page.goto((site / "guides" / "method.html").as_uri())
    widths = page.locator("main img").evaluate_all("images => images.map(image => image.naturalWidth)")
    assert len(widths) > 3
    assert min(widths) > 0
    assert page.locator("math").count() > 20
    assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    page.goto((site / "guides" / "extending.html").as_uri())
    step = page.locator("pre", has_text="Back, and two steps at once").inner_text()
    assert step.count("```") == 4
    assert "off(0) < begin" in step
    assert all(url.startswith(("file:", "data:")) for url in requests), requests
