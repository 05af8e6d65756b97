"""Assets of exported pages: scripts, style sheets, data and theme colours as parts of one HTML file."""

import json
from collections.abc import Iterable
from importlib.resources import files
from typing import Any

from app.palette import BACKGROUND, BRAND, GROUND, NOW, SELECTED, START, TRUTH, dark_variables, light_variables, solid


def asset(name: str, package: str = "app.export") -> str:
    """The text of a file in the folder `web` of a package."""
    return (files(package) / "web" / name).read_text(encoding="utf-8")


def script_elements(names: Iterable[str], package: str = "app.export") -> str:
    """Script elements with the text of files."""
    return "".join(f"<script>{asset(name, package)}</script>" for name in names)


def json_element(data: dict[str, Any]) -> str:
    """Data as JSON for a script element; "<" is escaped because it could end the element."""
    return json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def theme_colors() -> dict[str, str]:
    """CSS variables of a page: `colors` of the dark theme, and `light_colors`, which replace them in the light theme."""
    colors = {
        "ground": BACKGROUND, "brand": BRAND, "selected": SELECTED, "start": START, "now": NOW, "truth": TRUTH,
    }  # fmt: skip
    return {
        "colors": dark_variables() + "".join(f"--{name}:{solid(color)};" for name, color in colors.items()),
        "light_colors": light_variables() + f"--ground:{solid(GROUND[1])};",
    }
