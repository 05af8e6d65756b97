"""Completion of names in text fields: a list of suggestions below the field, filtered by the name before the caret.

A field has the suggestions in its attribute `data-words`: a JSON list of [inserted text, meaning].
"""

import json
from collections.abc import Sequence

import viser

from app.viser_bridge.javascript import run_in_page

Word = tuple[str, str]
"""Text to insert, and its meaning."""

MOST = 8  # suggestions shown at once


def complete_names(client: viser.ClientHandle) -> None:
    """Install the script in this browser's page."""
    run_in_page(client.gui, "completion", "completeNames", most=MOST)


def insert_into(field: str, word: str) -> str:
    """JavaScript that inserts a word at the end of the text field of this name."""
    return f"eigenfairingComplete({json.dumps(field)},{json.dumps(word)})"


def words_attribute(words: Sequence[Word]) -> str:
    """Value of the attribute `data-words`, not escaped."""
    return json.dumps([list(word) for word in words])
