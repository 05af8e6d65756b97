"""Condition field: a text field for a condition or expression, with completion of names and its mistakes below it."""

from collections.abc import Callable, Iterable, Mapping, Set

import viser

from app.debugger.moment_pulls import term_word
from app.debugger.quantities import FUNCTIONS, ITEMS, STAGE_WORDS, VALUES
from app.html import text
from app.page_state.page_state import PageState
from app.viser_bridge.completion import Word
from app.viser_bridge.html_events import HtmlEvents
from app.viser_bridge.html_panel import HtmlPanel
from app.viser_bridge.text_field import TextField
from fairing.errors import InputError
from fairing.terms.names import TERMS


class ConditionField:
    """A mistake stays below the field, marked by a caret, until another text is entered.

    Args:
        on_enter: called with the text and the names of the run's terms; raises InputError if it is wrong.
        without: names that are not offered.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        html_events: HtmlEvents,
        name: str,
        hint: str,
        on_enter: Callable[[str, Iterable[str]], None],
        without: Set[str] = frozenset(),
    ) -> None:
        self._on_enter, self._without = on_enter, without
        self._terms: Mapping[str, str] = TERMS
        self._line = TextField(gui, html_events, name, hint, self.enter, words=self._words(PageState(), TERMS))
        self._note = HtmlPanel(gui)

    def show(self, page_state: PageState, terms: Mapping[str, str]) -> None:
        """Offer names with the selected vertex and the photo looked through, and those of the run's terms."""
        self._terms = terms
        self._line.offer(self._words(page_state, terms))

    def enter(self, written: str) -> None:
        """Handle a text as if it had been typed; a wrong one stays in the field."""
        try:
            self._on_enter(written, self._terms)
        except InputError as error:
            self._note.set(mistake_html(str(error)))
            self._line.write(written)
        else:
            self._note.set("")

    def enter_draft(self) -> None:
        """Handle what was typed without Enter."""
        self.enter(self._line.take_draft())

    def _words(self, page_state: PageState, terms: Mapping[str, str]) -> list[Word]:
        return [word for word in words_for(page_state, terms) if word[0].partition("(")[0] not in self._without]


def words_for(page_state: PageState, terms: Mapping[str, str]) -> list[Word]:
    """All names with their meanings; functions with the selected vertex or the photo looked through as their argument.

    The names of terms and stages come last.

    Args:
        terms: of the run, by name: what adds to the energy of each.
    """
    chosen = {"vertex": page_state.selected, "view": None if page_state.entered is None else page_state.entered + 1}

    def call(function: str) -> str:
        item = ITEMS.get(function)
        if item is None:
            return f"{function}("
        if item == "term":
            return (
                f"{function}(photos)" if page_state.selected is None else f"{function}(photos, {page_state.selected})"
            )
        if item == "stage":
            return f"{function}(points)"
        return f"{function}({item if chosen[item] is None else chosen[item]})"

    of_terms = {term_word(name): f"term: {meaning}" for name, meaning in terms.items()}
    stages = ((word, f"stage: {kind.text}") for word, kind in STAGE_WORDS.items() if word not in of_terms)
    functions = ((call(name), meaning) for name, meaning in FUNCTIONS.items())
    return [*VALUES.items(), *functions, *of_terms.items(), *stages]


def mistake_html(mistake: str) -> str:
    """An error message, and above it what was typed with a caret below the position of the error."""
    message, _, written = mistake.partition(" (at: ")
    before, mark, after = written.removesuffix(")").partition("⟨here⟩")
    place = f"<pre>{text(before + after)}\n{' ' * len(before)}<b class='rejected'>^</b></pre>" if mark else ""
    return f"{place}<div class='note rejected' role='alert'>{text(message)}</div>"
