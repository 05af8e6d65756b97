"""The prior to the start of a sweep."""

import numpy as np

from fairing.optimize.rows import Anchor
from fairing.run.sweep import SweepState
from fairing.terms.names import START


def origin_of(sweep: SweepState) -> np.ndarray:
    """(n, 3) float, world units: where the prior to the start holds the vertices."""
    (prior,) = [term for term in sweep.terms if term.name == START]
    assert isinstance(prior, Anchor)
    return prior.places
