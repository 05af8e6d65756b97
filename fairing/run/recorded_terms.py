"""Terms of one's own in the header of a trace: their names, what they mean, and the code they were made by."""

from collections.abc import Sequence
from typing import Any

from fairing.errors import InputError
from fairing.terms.names import TERMS
from fairing.terms.own import OwnTerm
from fairing.trace import Trace
from fairing.trace_check import OWN_TERMS, TERM_FACTS, check_own_terms


def header_of_terms(terms: Sequence[OwnTerm]) -> dict[str, Any]:
    """The entry of a header."""
    return {OWN_TERMS: [{fact: getattr(term, fact) for fact in TERM_FACTS} for term in terms]}


def recorded_terms(trace: Trace) -> dict[str, str]:
    """Names of the recorded terms, and what adds to the energy of each."""
    return {term["name"]: term["meaning"] for term in _recorded(trace.header) if term["name"] not in TERMS}


def term_meanings(trace: Trace) -> dict[str, str]:
    """Names of the terms that a run may have, the built-in ones first, and what adds to the energy of each."""
    return TERMS | recorded_terms(trace)


def has_terms_of_trace(trace: Trace, terms: Sequence[OwnTerm]) -> bool:
    """Whether terms of one's own are those that a run was recorded with."""
    recorded = [(term["name"], term["digest"]) for term in _recorded(trace.header)]
    return recorded == [(term.name, term.digest) for term in terms]


def check_terms_of_trace(trace: Trace, terms: Sequence[OwnTerm]) -> None:
    """Refuse to continue a run without its own terms, or with others.

    Raises:
        InputError: it was recorded with others, which the message names.
    """
    if not has_terms_of_trace(trace, terms):
        names = ", ".join(f"{term['name']} ({term['file']})" for term in _recorded(trace.header)) or "none"
        raise InputError(
            f"trace: recorded with the own terms {names}, found {', '.join(term.name for term in terms) or 'none'} or other code; "
            "give it the same with --with FILE or terms=[...], or branch"
        )


def _recorded(header: dict[str, Any]) -> list[dict[str, str]]:
    check_own_terms(header)
    return header.get(OWN_TERMS, [])
