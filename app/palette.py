"""Palette: all colours of the page. Each colour has the same meaning everywhere.

Based on the palette of Okabe and Ito, which is distinguishable with any kind of colour vision. Start is green and now is
red, as in the paper's figures. Colours on the background of panels (text, lines, buttons) are CSS variables with a value
for the dark and one for the light theme; bright colours are darker on the light theme, to be readable as text.
"""

RGB = tuple[int, int, int]

START: RGB = (0, 178, 128)
NOW: RGB = (238, 86, 48)
SELECTED: RGB = (245, 222, 66)
TRUTH: RGB = (96, 184, 240)
LOCKED: RGB = (134, 142, 150)
HAND: RGB = (236, 238, 242)
FLOW: RGB = (226, 52, 190)  # arrows: on every colour of the scale, and beside the mesh in both themes
STEPPED: RGB = (80, 150, 255)
REJECTED: RGB = (204, 121, 167)
REFERENCE: RGB = (178, 160, 255)
CAMERA: RGB = (120, 138, 158)
CAMERA_ENTERED: RGB = (245, 222, 66)
GHOST: RGB = (176, 196, 222)
SURFACE: RGB = (128, 132, 140)
POINTS: RGB = (214, 218, 224)

# Curves with none of the meanings above: a sequence from blue to orange, distinguishable with any colour vision.
CURVES: tuple[RGB, ...] = (
    (70, 134, 232), (150, 190, 245), (200, 205, 212), (246, 206, 140), (232, 152, 36), (190, 108, 24),
    (62, 104, 176),
)  # fmt: skip
AXIS_CURVES = (CURVES[0], CURVES[4], CURVES[2])  # of x, y and z

# Terms of the objective, in the order of `fairing.terms.names.TERMS`. With any colour vision, any two of them are 25 apart in
# CIELAB or more, and all are 40 from both grounds of the 3D view.
TERM_COLORS: tuple[RGB, ...] = (
    (60, 128, 235), (234, 148, 19), (164, 41, 61), (230, 147, 220), (39, 199, 150), (120, 63, 150),
)  # fmt: skip

OWN_TERM_COLORS: tuple[RGB, ...] = ((120, 200, 60), (0, 170, 190), (200, 110, 100))  # of terms of one's own

# Kinds of stages, in the order of `fairing.stage_kind.StageKind`; those of a term have its colour. They are told apart by names
# and patterns, too (`app.pictures.stage_colors`).
STAGE_COLORS: tuple[RGB, ...] = (
    TERM_COLORS[0], TERM_COLORS[4], TERM_COLORS[1], (240, 200, 110), TERM_COLORS[3], (186, 130, 50), (150, 158, 168), HAND,
    (222, 128, 64), HAND,
)  # fmt: skip

# Edges that are parallel to the three axes of a building.
AXIS_COLORS: tuple[RGB, ...] = ((234, 148, 19), (230, 147, 220), (80, 150, 255))
SEEN: RGB = (245, 222, 66)  # faces that the entered photo sees

BACKGROUND: RGB = (24, 26, 30)
BRAND: RGB = (42, 108, 190)
BRAND_TEXT: RGB = (112, 170, 240)  # of the active tab; darker on the light theme

# Background of the 3D view in the dark and in the light theme.
GROUND: tuple[RGB, RGB] = (BACKGROUND, (232, 235, 239))

_ON_LIGHT: dict[RGB, tuple[str, RGB]] = {
    START: ("start", (0, 114, 82)),
    NOW: ("now", (188, 52, 18)),
    BRAND_TEXT: ("brand-text", (30, 94, 174)),
    SELECTED: ("selected", (128, 90, 0)),
    TRUTH: ("truth", (16, 110, 180)),
    LOCKED: ("locked", (98, 106, 114)),
    REJECTED: ("rejected", (164, 72, 122)),
    REFERENCE: ("reference", (104, 80, 206)),
    POINTS: ("points", (112, 120, 130)),
    STAGE_COLORS[6]: ("judge", (112, 120, 130)),
    HAND: ("hand", (58, 64, 72)),
    CURVES[0]: ("curve-1", (20, 80, 186)),
    CURVES[1]: ("curve-2", (92, 146, 222)),
    CURVES[2]: ("curve-3", (118, 125, 134)),
    CURVES[3]: ("curve-4", (222, 160, 62)),
    CURVES[4]: ("curve-5", (184, 106, 0)),
    CURVES[5]: ("curve-6", (116, 60, 0)),
    CURVES[6]: ("curve-7", (8, 36, 104)),
}

# As text and lines on panels; in the 3D view these colours are darker.
_ON_DARK: dict[RGB, RGB] = {NOW: (255, 118, 82), REJECTED: (226, 150, 192), START: (20, 192, 140)}

_GREYS: dict[str, tuple[str, str]] = {
    "text": ("#d5d9df", "#2b3138"),
    "dim": ("#a3acb7", "#565f69"),
    "strong": ("#f1f3f5", "#0f1317"),
    "faint": ("#59626c", "#a3abb4"),
    "button": ("#2e333a", "#f3f5f7"),
    "edge": ("#3d444d", "#c5ccd4"),
    "hover": ("#3a4149", "#e6eaee"),
    "hover-edge": ("#59636f", "#98a2ad"),
    "pressed": ("#242930", "#d9dfe5"),
    "off": ("#25282c", "#ffffff"),
    "off-text": ("#99a2ac", "#5f6872"),
    "line": ("#31363c", "#dde2e7"),
    "well": ("#1f2226", "#f3f5f7"),
    "row": ("#2b3036", "#edf0f3"),
    "ink": ("#16181c", "#ffffff"),
}


def grey(name: str) -> str:
    """Value of a variable such as `text` or `line` in the dark theme, for pictures that are drawn outside the page."""
    return _GREYS[name][0]


def css(color: RGB, opacity: float = 1.0) -> str:
    """The colour as a CSS expression that follows the theme."""
    r, g, b = color
    solid = f"rgb({r},{g},{b})"
    if color in _ON_LIGHT:
        solid = f"var(--{_ON_LIGHT[color][0]},{solid})"
    return solid if opacity == 1 else f"color-mix(in srgb,{solid} {100 * opacity:g}%,transparent)"


def variables(elements: str, in_light_theme: str) -> str:
    """CSS rules that define every variable in both themes.

    Args:
        elements: selector of the elements that get them.
        in_light_theme: selector of an ancestor that is there in the light theme only.
    """
    dark = {name: value for name, (value, _) in _GREYS.items()} | {
        name: solid(_ON_DARK.get(c, c)) for c, (name, _) in _ON_LIGHT.items()
    }
    light = {name: value for name, (_, value) in _GREYS.items()} | {name: solid(c) for name, c in _ON_LIGHT.values()}
    rules = [elements, f"{in_light_theme} :is({elements})"]
    return "\n".join(
        f"{rule} {{ {' '.join(f'--{name}: {value};' for name, value in values.items())} }}"
        for rule, values in zip(rules, (dark, light), strict=True)
    )


def dark_variables() -> str:
    """CSS declarations of the dark theme's greys, for exported pages."""
    return "".join(f"--{name}:{value};" for name, (value, _) in _GREYS.items())


def light_variables() -> str:
    """CSS declarations of the light theme's greys and of the colours that are darker on it, for exported pages."""
    greys = "".join(f"--{name}:{value};" for name, (_, value) in _GREYS.items())
    return greys + "".join(f"--{name}:{solid(color)};" for name, color in _ON_LIGHT.values())


def solid(color: RGB) -> str:
    """The colour as CSS text, independent of the theme, as in the 3D view."""
    return f"rgb({color[0]},{color[1]},{color[2]})"
