"""Check of a capture before a run: cameras, coverage, sizes, texture, exposure and memory.

May import the data modules of `fairing`, `fairing.geometry` and `fairing.cells`.
"""
