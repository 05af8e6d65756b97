"""Runs: the session, its plan, its schedule and the kinds of steps.

A session plans its run once (`planning`: `preparation`, `start_error`), which gives the levels and phases of its schedule
(`phases`, `schedule`). The `stepper` computes each step within the state of its sweep (`sweep`, `sweep_cache`): a Gauss-Newton
iteration (`gauss_newton_step`), a local search (`search_step`, `local_search`) or a restart (`restart`, `fusion`). `records`
builds the step records, `manual_edits` the steps of a user.

Imports the data modules of `fairing`, `fairing.geometry`, `fairing.cells` and `fairing.solve`. Other packages use `Session`,
`SweepState` and `with_locks`.
"""
