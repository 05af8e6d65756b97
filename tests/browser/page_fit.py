"""Whether a page fits its window and is accessible, measured in the browser."""

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import ViewportSize

from tests.browser.driver import WINDOW, Visitor
from tests.two_levels import two_levels

OPTIONS = two_levels("sequential", sweeps=1, iterations=2)
SIZES: tuple[ViewportSize, ViewportSize] = (WINDOW, {"width": 1440, "height": 900})
TABS = (
    *("Experiments", "Lessons", "Cells"),
    *("Breakpoints", "Layers", "Options", "Vertex"),
    *("Runs", "Bookmarks", "Timeline"),
)  # by panel
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
CUT = """() => [...document.querySelectorAll('.ef :not(.stage), [data-dock-tab] *')].filter(element => {
    const words = element.innerText?.trim().toLowerCase(), whole = element.closest('[title]')?.title.toLowerCase() ?? '';
    return element.checkVisibility() && words && getComputedStyle(element).textOverflow === 'ellipsis'
        && element.scrollWidth > element.clientWidth + 1 && !whole.includes(words);
}).map(element => `${element.className}: ${element.innerText}`)"""

_DRAWN = """async () => {
    const extent = () => JSON.stringify([...document.querySelectorAll('.ef')].map(
        panel => [panel.scrollWidth, panel.scrollHeight, panel.textContent.length]));
    const deadline = performance.now() + 10000;  // ms
    for (let last = '', same = 0; same < 3 && performance.now() < deadline;) {
        const now = extent();
        same = now === last ? same + 1 : 0;
        last = now;
        await new Promise(done => setTimeout(done, 40));
    }
}"""
_CALM = """() => document.getAnimations().every(({playState, effect}) =>
    playState === 'finished' || effect.getComputedTiming().endTime === Infinity)"""


def themes_and_sizes(case: int) -> list[tuple[str, ViewportSize]]:
    """Each theme at one size; with cases of both parities each pair of case, theme and size occurs."""
    return list(zip(("light", "dark"), SIZES if case % 2 == 0 else SIZES[::-1], strict=True))


def show(visitor: Visitor, tab: str) -> None:
    """Select a tab and wait until its panel is drawn and no longer changes."""
    visitor.page.get_by_role("tab", name=tab, exact=True).click()
    visitor.page.evaluate(_DRAWN)


def switch_theme(visitor: Visitor, theme: str) -> None:
    """Change to the other theme, which is this one, and wait until its colours are there."""
    visitor.page.keyboard.press("y")
    visitor.page.wait_for_selector(f"html[data-mantine-color-scheme={theme}]")
    wait_until_calm(visitor)


def wait_until_calm(visitor: Visitor) -> None:
    """Wait until the panels are drawn, their widgets have names and nothing fades: axe would measure colours on their way."""
    visitor.page.evaluate(_DRAWN)
    wait_for_names(visitor)
    visitor.page.wait_for_function(_CALM)


def wait_for_names(visitor: Visitor) -> None:
    """Wait until widgets that are there have their names: the page's own timer gives them 200 ms after a change."""
    visitor.page.evaluate("() => new Promise(done => setTimeout(done, 250))")


def enlarge_a_cell(visitor: Visitor) -> None:
    """Open the lens. In a low window it may cover the tabs of the timeline."""
    show(visitor, "Cells")
    visitor.page.get_by_role("button", name="Enlarge a cell in cube_00.png", exact=True).first.click()
    visitor.page.get_by_alt_text("enlarged cell").wait_for()


def too_wide(visitor: Visitor) -> list[str]:
    """What overflows or scrolls sideways once the panels have taken their places in a window of another size."""
    for _ in range(40):
        if not visitor.page.evaluate(TOO_WIDE):
            return []
        visitor.page.wait_for_timeout(250)
    return visitor.page.evaluate(TOO_WIDE)


def cut_texts(visitor: Visitor) -> list[str]:
    """Texts that end in an ellipsis and are not whole in a tooltip either; in the band of stages there is room for few names."""
    return visitor.page.evaluate(CUT)


def serious_findings(visitor: Visitor, within: str | None = None) -> list[tuple[str, list]]:
    """What axe finds in the page as it is, or in the elements that a selector matches, of serious or critical impact."""
    found = Axe().run(visitor.page, within).response["violations"]
    serious = [item for item in found if item["impact"] in ("serious", "critical")]
    return [(item["id"], [(node["html"][:160], node["any"][:1]) for node in item["nodes"][:5]]) for item in serious]
