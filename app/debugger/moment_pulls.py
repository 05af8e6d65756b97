"""Pulls at a moment, as pages show them and conditions use them. Computed on the engine thread."""

from dataclasses import dataclass

import numpy as np

from fairing.run.pulls import Pull, shares, shares_of_all
from fairing.run.recorded_terms import term_meanings
from fairing.run.session import Session


def term_word(name: str) -> str:
    """The word that names a term in conditions."""
    return name.replace(" ", "_")


@dataclass(frozen=True, eq=False)
class MomentPulls:
    """The pulls of all terms in the step after a moment.

    Attributes:
        pulls: one a term, in the order of `meanings`.
        meanings: of all terms of the run by name, in the order of tables and colours: what adds to the energy of each.
        step: (n, 3) float: the proposed step, which their steps add up to, world units.
        step_px: (n,) float: its length in the photo where it is longest, px.
        shares: (T, n) float: share of each term in the information along the step of a vertex; NaN without a step.
        shares_of_all: (T,) float: the same for the steps of all vertices together.
    """

    pulls: list[Pull]
    meanings: dict[str, str]
    step: np.ndarray
    step_px: np.ndarray
    shares: np.ndarray
    shares_of_all: np.ndarray

    def index_of(self, name: str) -> int | None:
        """Index of a term in `pulls`; None if it is not in use at this moment."""
        return next((k for k, pull in enumerate(self.pulls) if pull.name == name), None)

    def px_of(self, name: str) -> np.ndarray:
        """(n,) float: length of a term's part in the photo where it is longest, px; 0 for a term that is not in use."""
        k = self.index_of(name)
        return np.zeros(len(self.step)) if k is None else self.pulls[k].step_px

    def strongest(self) -> np.ndarray:
        """(n,) float: for each vertex the place in `meanings` of the term with the longest part; NaN where none pulls."""
        order = list(self.meanings)
        places = np.array([order.index(pull.name) for pull in self.pulls], dtype=float)
        lengths = np.array([np.linalg.norm(pull.step, axis=1) for pull in self.pulls])
        return np.where(lengths.any(axis=0), places[lengths.argmax(axis=0)], np.nan)


def moment_pulls(session: Session, moment: int) -> MomentPulls:
    """The pulls at a moment.

    Raises: as `Session.pulls`.
    """
    meanings = term_meanings(session.trace)
    order = list(meanings)
    pulls = sorted(session.pulls(moment), key=lambda pull: order.index(pull.name))
    step = np.sum([pull.step for pull in pulls], axis=0)
    return MomentPulls(
        pulls,
        meanings,
        step,
        session.pixels_moved(step, moment),
        shares(pulls),
        shares_of_all(pulls),
    )
