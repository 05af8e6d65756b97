"""Runs: the schedule of levels, sweeps and steps, and the session that works it off.

Holds the session, the stepper, Gauss-Newton steps, local search, restarts, preparations of the start and manual edits.
May import the data modules of `fairing`, `fairing.geometry`, `fairing.cells` and `fairing.solve`.
"""
