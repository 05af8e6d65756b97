"""Buttons of which one is down."""

from typing import Any

from app.html import button, text


def choice(options: dict[Any, tuple[str, str]], chosen: object, name: str) -> str:
    """A group of buttons of which one is down.

    Args:
        options: a label and its JavaScript for every value.
        name: of the group, for screen readers.
    """
    found = []
    for key, (label, press) in options.items():
        is_on = key == chosen
        one = button(label, press, hint=f"{name}: {label}", css_class="small on" if is_on else "small")
        found.append(one.replace("<button", f'<button aria-pressed="{text(str(is_on).lower())}"', 1))
    return f"<div class='segments' role='group' aria-label='{text(name)}'>{''.join(found)}</div>"
