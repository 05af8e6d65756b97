"""Whether a page fits its window and is accessible, measured in the browser."""

from axe_playwright_python.sync_playwright import Axe

from tests.browser.driver import WINDOW, Visitor

SIZES = (WINDOW, {"width": 1440, "height": 900})
TOO_WIDE = """() => {
    const found = [];
    for (const element of document.querySelectorAll('body *')) {
        const style = getComputedStyle(element);
        const cuts = style.overflowX !== 'visible' && style.textOverflow !== 'ellipsis';
        if (cuts && element.clientWidth > 40 && element.scrollWidth > element.clientWidth + 1 && !element.matches('input, svg *'))
            found.push(`${element.className}: ${element.scrollWidth} > ${element.clientWidth}`);
    }
    for (const element of document.querySelectorAll('.ef *')) {
        const box = element.getBoundingClientRect(), panel = element.closest('.ef').getBoundingClientRect();
        const isCut = element.closest('.one, .what, .suggestions, svg');
        if (!isCut && box.width > 0 && panel.width > 0 && box.right > panel.right + 1)
            found.push(`${element.tagName} ${element.className} ${element.textContent.slice(0, 30)} beyond its panel`);
    }
    return found;
}"""


def show(visitor: Visitor, tab: str) -> None:
    visitor.page.get_by_role("tab", name=tab, exact=True).click()
    visitor.page.wait_for_timeout(300)


def too_wide(visitor: Visitor) -> list[str]:
    """What overflows or scrolls sideways once the panels have taken their places in a window of another size."""
    for _ in range(40):
        if not visitor.page.evaluate(TOO_WIDE):
            return []
        visitor.page.wait_for_timeout(250)
    return visitor.page.evaluate(TOO_WIDE)


def serious_findings(visitor: Visitor) -> list[tuple[str, list]]:
    """What axe finds in the page as it is, of serious or critical impact."""
    found = Axe().run(visitor.page).response["violations"]
    serious = [item for item in found if item["impact"] in ("serious", "critical")]
    return [(item["id"], [(node["html"][:160], node["any"][:1]) for node in item["nodes"][:5]]) for item in serious]
