"""The whole engine in one call."""

from collections.abc import Callable

from fairing.options import FairingOptions
from fairing.run.session import Session
from fairing.scene import Scene
from fairing.trace import StepRecord


def fair(
    scene: Scene,
    options: FairingOptions | None = None,
    should_stop: Callable[[], bool] = lambda: False,
    on_step: Callable[[StepRecord], None] = lambda _: None,
) -> Session:
    """Fair the mesh of a scene: move its vertices to where the photos agree.

    Args:
        options: default: the preset `accurate`.
        should_stop: asked before every step.
        on_step: told of every step.

    Returns:
        The session at its end. `scene.unweld(session.vertices)` are the positions in the input's order,
        `session.trace` is the record of every step, `session.stop_reason` says why it ended.

    Raises:
        InputError: an option or the scene cannot be used.
    """
    session = Session(scene, options)
    session.run(should_stop, on_step)
    return session
