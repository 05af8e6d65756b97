"""Runs: the session, its plan, its stages and their steps. Read in this order:

`stages`: the parts of a run, as data. `phases`: the levels of the photos with their stages, made from options and plan.
`stepper`: one step after a moment, whatever its stage: an iteration of photos (`gauss_newton_step`, in the state of its `sweep`),
an iteration of smoothing or of a fit to points (`fit_step`, with the terms that `fits` finds), or the verdict of a judge.
`planning`: what a start calls for, once, by a `rehearsal` of its smoothing and fit. `session`: what users of a run call.

Beside them: `history` (where parts of a recorded run began), `sweep_cache`, `records` (builders of step records), `recorded_stages`
(a trace cut into stages), `recorded_refinement` (of the cameras), `own_files` (what files of a user define), `own_plan` (a plan of
one's own as levels and stages), `changed_plan` (what another one keeps of a run), `recorded_terms` and `recorded_norm` (of one's
own), `trace_header` (what a trace says about its run), `pulls` (the part of each term in a step), `manual_edits`, `snapshots`
(meshes of another program as a run).

Imports the data modules of `fairing`, `fairing.util`, `fairing.cameras`, `fairing.geometry`, `fairing.cells`, `fairing.norms`,
`fairing.terms`, `fairing.optimize`, `fairing.solve`.
Other packages use `Session`, `SweepState`, `recorded_stages` and `with_locks`.
"""
