"""The algorithm in ten lines, for lessons to point at."""

LINES: dict[str, str] = {
    "level": "for each level: blur the photos by σ, coarse to fine",
    "visible": "  for each sweep: find which photos show each face",
    "cells": "    warp the face's area in photo i to its cell Iᵢ",
    "eigenspace": "    U, c ← the k largest components of the cells",
    "residual": "    e ← Iᵢ − U cᵢ;  w ← ρ′(e) / e",
    "jacobian": "    J ← ∇Iᵢ · ∂υ/∂η",
    "solve": "    solve (Σ w JᵀJ) δη = −Σ w Jᵀe",
    "accept": "    η ← η + δη if E falls and no face folds",
    "stop": "    until no vertex moves",
}
