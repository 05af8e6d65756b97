"""Pseudo-code of the algorithm, of which lessons highlight a line."""

LINES: dict[str, str] = {
    "level": "for each level: blur the photos by σ",
    "visible": "  for each sweep: which photos show which face?",
    "cells": "    warp the face's areas to cells Iᵢ",
    "eigenspace": "    U, c ← k largest components of the cells",
    "residual": "    e ← Iᵢ − U cᵢ;  w ← ρ′(e) / e",
    "jacobian": "    J ← ∇Iᵢ · ∂υ/∂η",
    "solve": "    solve (Σ w JᵀJ) δη = −Σ w Jᵀe",
    "accept": "    η ← η + δη if E falls and no face folds",
    "stop": "    until no vertex moves",
}
