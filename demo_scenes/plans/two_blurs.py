"""Photos at two blurs alone, without smoothing or fit: `eigenfairing view SCENE --with two_blurs.py`."""

from fairing import PlanStage

plan = [
    PlanStage("photos", blur=3.6, max_sweeps=2),
    PlanStage("photos", blur=1.2, max_sweeps=3, max_iterations=2),
    PlanStage("judge", by="end"),
]
