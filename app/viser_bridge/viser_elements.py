"""Style of viser's own elements, by the names they have in its page: the theme's variables, labels, tabs, palette, dialogs.

Notifications lie below a dialog of ours, whose z-index is 100. Two panels stay visible while the others are scrolled:
those whose content has the class `pinned`. In a narrow floating panel, whose content has the class `labels-above`, the labels
of viser's widgets stand above them, so that sliders are as wide as the panel.

A folder that is closed keeps its title on a line: viser 1.1.1 draws a box around an empty place.

In a window as narrow as a phone viser 1.1.1 shows the main panel alone, as a sheet at the bottom 20 em wide, which cuts the
buttons. It is as wide as the window here, and nothing in it is pinned: that would cover half of the view.
"""

from app.palette import BRAND, BRAND_TEXT, GROUND, css, solid, variables

LABELS_ABOVE = "labels-above"
DEBUG_BAR_HEIGHT = 134  # px; the status panel is pinned below the debug bar

_LIGHT = "[data-mantine-color-scheme=light]"
_CLOSED = ".mantine-Paper-root:has(> .mantine-Paper-root > svg[class*=chevron-down])"
_SHEET = ".mantine-Paper-root[style*='position: fixed'][style*='width: 20em']"

# On pure white, the bright colours of points and selection would be invisible on the transparent canvas.
STYLE = f"""
{variables(".ef, .mantine-Flex-root label, [role=tab], .mantine-Spotlight-action, .mantine-Badge-label", _LIGHT)}
{_LIGHT} .mantine-Button-root {{ --button-bg: {css(BRAND)}; --button-hover: {css(BRAND)}; }}
{_LIGHT} .mantine-Badge-label {{ color: {css(BRAND_TEXT)}; }}
[data-scene-node] > [role=button]:focus-visible {{ opacity: 1; }}
{_LIGHT} canvas[data-engine] {{ background: {solid(GROUND[1])} }}
.mantine-Flex-root label {{ color: var(--dim); }}
.mantine-Spotlight-action .mantine-Spotlight-actionDescription {{ color: var(--dim); opacity: 1; }}
[role=tab][aria-selected=true][role=tab] {{ color: {css(BRAND_TEXT)} !important; }}
[data-dock-tab] {{ padding: 0 0.55em !important; }} [data-dock-tab] > div:first-child {{ margin-right: 0.35em !important; }}
div:has(> .ef > .pinned) {{ position: sticky; top: 0; z-index: 5; background: var(--mantine-color-body);
  padding-top: 10px; margin-top: -10px; }}
div:has(> div > div > div > .ef > .pinned) {{ overflow: clip !important; }}
div:has(> .ef > .pinned) + div:has(> .ef > .pinned) {{ top: {DEBUG_BAR_HEIGHT}px; padding-top: 0; margin-top: 0; }}
[data-floating-window]:has(.ef > .{LABELS_ABOVE}) .mantine-Flex-root:has(> * > * > label) {{ display: block; }}
{_CLOSED} {{ border-width: 1px 0 0; padding: 0; }} {_CLOSED} > div:last-child > div {{ padding: 3px !important; }}
{_SHEET}, {_SHEET} div[style*='width: 20em'] {{ width: 100% !important; }} {_SHEET} {{ max-height: 54% !important; }}
{_SHEET} div:has(> .ef > .pinned) {{ position: static; }}
body:has(.ef .dialog) .mantine-Notifications-root {{ z-index: 99; }}
.mantine-Modal-content:has(.ef .keys) {{ flex: 0 1 820px; }}
.mantine-Modal-header:has(+ .mantine-Modal-body .ef .dialog) {{ padding-right: 56px; }}
"""
