"""What the steps of a run are, explained to a reader who sees a replay and nothing else."""

from typing import NamedTuple

from fairing.options import FairingOptions
from fairing.trace import StepReason, StepRecord

INTRO = (
    "Every face of the mesh is cut out of each photo that sees it and warped to a cell. The cells of a face are "
    "explained by a few basis images, its eigenspace; what is left unexplained, summed over all faces and photos, "
    "is the energy. Vertices move so that it falls: at the true surface all photos of a face show the same texture."
    " Until then the texture ghosts."
)


class Kind(NamedTuple):
    """A title and a paragraph."""

    title: str
    text: str


KINDS: tuple[Kind, ...] = (
    Kind(
        "Gauss-Newton step",
        "The residuals of all cells are linearised in the positions of the vertices, and a weighted least-squares "
        "problem says where the vertices should go. The step counts only if the energy, measured again with a new "
        "eigenspace, has fallen.",
    ),
    Kind(
        "Search for better places",
        "Before Gauss-Newton starts on a level, each vertex tries places around it, so that it need not begin "
        "within the narrow valley that a step can see. A place is taken if the photos agree clearly better there.",
    ),
    Kind(
        "Smoothing of the start",
        "The start was full of noise. Where the photos agree better with a smoother surface, the noise is filtered "
        "out before anything else.",
    ),
    Kind(
        "Sparse points",
        "The capture came with points measured on the surface. Every second one draws the faces near it to itself, "
        "if the photos agree; the others are kept to judge the result by. A weak pull to them stays.",
    ),
    Kind(
        "Return of vertices",
        "At the finest level the energy had been lower where these vertices came from, so they went back. A run "
        "never ends worse than it began.",
    ),
    Kind("A step by hand", "Somebody moved these vertices; the sweep begins anew from there."),
    Kind(
        "Nothing to move",
        "On this level no vertex could move: faces are too small for its blur, or seen by too few photos.",
    ),
)
_OF_REASON = {
    StepReason.FOUND_PLACE: 1,
    StepReason.FOUND_TOGETHER: 1,
    StepReason.NO_BETTER_PLACE: 1,
    StepReason.SMOOTHED: 2,
    StepReason.FITTED_TO_POINTS: 3,
    StepReason.RETURNED: 4,
    StepReason.MOVED_MANUALLY: 5,
    StepReason.RESET_MANUALLY: 5,
}


def kind_of(record: StepRecord) -> int:
    """Index into `KINDS`."""
    if len(record.reasons) == 0:
        return len(KINDS) - 1
    return max(_OF_REASON.get(StepReason(reason), 0) for reason in set(record.reasons.tolist()))


def level_text(options: FairingOptions, level: int) -> str:
    """What a level is for."""
    blur = options.schedule.blur[level]
    if level == options.n_levels - 1:
        return f"The finest level: photos blurred by {blur:g} px only. Here the last hundredths of a pixel are found."
    return (
        f"Level {level + 1} of {options.n_levels} works on photos blurred by {blur:g} px: detail finer than that "
        "cannot mislead, and a vertex may be a few pixels off and still be drawn the right way."
    )
