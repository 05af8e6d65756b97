"""Smoothing between two blurs, kept where the photos agree with it: `eigenfairing view SCENE --with smooth_between.py`."""

from fairing import PlanStage

plan = [
    PlanStage("photos", blur=3.6),
    PlanStage("smoothing", max_iterations=3),
    PlanStage("judge", by="photos"),
    PlanStage("photos", blur=1.2),
]
