"""Pulls on the replay page: the part of each term in the next step of every vertex, at the beginning of stages and sweeps."""

from collections.abc import Callable
from typing import Any

import numpy as np

from app.debugger.moment_pulls import moment_pulls
from app.export.packing import packed
from app.export.run_facts import RunFacts
from app.palette import solid
from app.pictures.term_colors import colors_of_terms
from fairing.run.recorded_terms import has_terms_of_trace, term_meanings

MOST_MOMENTS = 24  # each costs about one iteration
PX = 1 / 1024  # unit of the lengths, px; an unsigned 16-bit number reaches 64 px
SHARE = 1 / 200  # unit of the shares


def pulls_of_run(facts: RunFacts, on_progress: Callable[[float], None]) -> dict[str, Any]:
    """The pulls at `moments`: lengths in the photo where they are longest and shares, packed (moments, terms, vertices).

    Shares are one higher than their number of units; 0: the vertex does not move.
    """
    moments, meanings = pull_moments(facts), term_meanings(facts.trace)
    names, colors = list(meanings), colors_of_terms(meanings)
    px = np.zeros((len(moments), len(names), len(facts.trace.start)), dtype=np.uint16)
    shares = np.zeros(px.shape, dtype=np.uint8)
    for k, moment in enumerate(moments):
        found = moment_pulls(facts.session, moment)
        for pull, share in zip(found.pulls, found.shares, strict=True):
            row = names.index(pull.name)
            px[k, row] = np.round(np.clip(pull.step_px / PX, 0, 65535))
            shares[k, row] = np.where(np.isfinite(share), 1 + np.round(np.nan_to_num(share) / SHARE), 0)
        on_progress((k + 1) / len(moments))
    used = np.flatnonzero(px.any(axis=(0, 2)) | shares.any(axis=(0, 2)))
    return {
        "moments": moments,
        "terms": [{"name": names[k], "color": solid(colors[names[k]]), "hint": meanings[names[k]]} for k in used],
        "px": packed(px[:, used]),
        "pxUnit": PX,
        "shares": packed(shares[:, used]),
        "shareUnit": SHARE,
    }


def pull_moments(facts: RunFacts) -> list[int]:
    """At most `MOST_MOMENTS` moments: where stages begin, and where sweeps do if there is room for them.

    None without the code of the run's own terms, whose pulls cannot be computed.
    """
    if facts.length == 0 or not has_terms_of_trace(facts.trace, facts.session.terms):
        return []
    stages = [stage.begin for stage in facts.energies.stages(facts.length)]
    sweeps = np.setdiff1d(np.unique(facts.energies.sweeps), stages).tolist()
    wanted = stages + sweeps if len(stages) + len(sweeps) <= MOST_MOMENTS else stages
    chosen = np.unique(np.linspace(0, len(wanted) - 1, min(len(wanted), MOST_MOMENTS)).astype(int))
    return sorted(wanted[k] for k in chosen)
