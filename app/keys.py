"""Keys of the keyboard, and how they are displayed."""

Key = tuple[str, str | None]
"""A key, and its modifier ("shift" and the like) or None."""


def key_text(key: str, modifier: str | None) -> str:
    """A key as it is displayed, such as Shift+F11."""
    key = "Space" if key == "space" else key
    return f"{modifier.capitalize()}+{key}" if modifier else key
