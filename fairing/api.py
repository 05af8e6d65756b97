"""`fair`: a complete run in one call."""

from collections.abc import Callable, Sequence

from fairing.norms.norm import Norm
from fairing.options import FairingOptions
from fairing.run.session import Session
from fairing.run_plan import PlanStage
from fairing.scene import Scene
from fairing.terms.own import OwnTerm
from fairing.trace import StepRecord


def fair(
    scene: Scene,
    options: FairingOptions | None = None,
    should_stop: Callable[[], bool] = lambda: False,
    on_step: Callable[[StepRecord], None] = lambda _: None,
    terms: Sequence[OwnTerm] = (),
    norm: Norm | None = None,
    plan: Sequence[PlanStage] | None = None,
) -> Session:
    """Fair the mesh of a scene: move its vertices to the positions where the photos agree.

    Sparse points are found in the photos first where `Scene.points_choice` requires it, see `Session.choose_inputs`.

    Args:
        options: default: the preset `accurate`.
        should_stop: called before every step; True ends the run.
        on_step: called with the record of every step.
        terms: terms of one's own, beside the built-in ones, see `OwnTerm`.
        norm: a norm of one's own instead of that of the options, see `Norm`.
        plan: the stages of the run instead of those that the start calls for, see `PlanStage`.

    Returns:
        The session after its last step. `session.scene.unweld(session.vertices)` are the positions, (N, 3) float in world
        units, in the order of the input; `session.trace` holds the records of all steps; `session.stop_reason` is the reason
        for the end, as a sentence.

    Raises:
        InputError: an option, a term, the norm, the plan or the scene cannot be used.
    """
    session = Session(scene, options, terms=terms, norm=norm, plan=plan)
    session.run(should_stop, on_step)
    return session
