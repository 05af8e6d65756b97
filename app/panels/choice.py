"""Selectable buttons: chips, and segmented controls of which one button is pressed."""

from collections.abc import Mapping
from typing import Any

from app.html import button, photo_title, text


def chip(label: str, press: str, hint: str, is_on: bool, css_class: str = "chip") -> str:
    """Markup of a small button that is highlighted while `is_on`."""
    return button(label, press, hint=hint, css_class=f"{css_class} on" if is_on else css_class, pressed=is_on)


def photo_link(view_id: int, name: str, press: str) -> str:
    """Markup of a photo's number and name that looks through its camera."""
    return button(photo_title(view_id, name), press, hint=f"Look through {name}", css_class="link")


def choice(
    options: dict[Any, tuple[str, str]], chosen: object, name: str, details: Mapping[Any, str] | None = None
) -> str:
    """Markup of a segmented control.

    Args:
        options: for every value its label and the JavaScript of its button.
        chosen: the value whose button is pressed.
        name: accessible name of the group.
        details: for values that need it, what the tooltip adds to the names of the group and the button.
    """
    found = []
    for key, (label, press) in options.items():
        is_on = key == chosen
        css_class = "small on" if is_on else "small"
        more = f" ({details[key]})" if details and key in details else ""
        found.append(button(label, press, hint=f"{name}: {label}{more}", css_class=css_class, pressed=is_on))
    return f"<div class='segments' role='group' aria-label='{text(name)}'>{''.join(found)}</div>"


def arrow_scales(segments: str) -> str:
    """Markup of a segmented control for the length of arrows, with its caption."""
    return f"<div class='dim note'>arrows longer by</div><div class='scales'>{segments}</div>"
