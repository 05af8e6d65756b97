"""Segmented control: a group of buttons of which one is pressed."""

from typing import Any

from app.html import button, text


def choice(options: dict[Any, tuple[str, str]], chosen: object, name: str) -> str:
    """Markup of a segmented control.

    Args:
        options: for every value its label and the JavaScript of its button.
        chosen: the value whose button is pressed.
        name: accessible name of the group.
    """
    found = []
    for key, (label, press) in options.items():
        is_on = key == chosen
        one = button(label, press, hint=f"{name}: {label}", css_class="small on" if is_on else "small")
        found.append(one.replace("<button", f'<button aria-pressed="{text(str(is_on).lower())}"', 1))
    return f"<div class='segments' role='group' aria-label='{text(name)}'>{''.join(found)}</div>"
