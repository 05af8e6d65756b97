"""Explanations of the kinds of steps and levels, for readers of a replay page."""

from typing import NamedTuple

from fairing.options import FairingOptions
from fairing.stage_kind import StageKind
from fairing.trace import StepReason, StepRecord

INTRO = (
    "Every face of the mesh is warped from each photo that sees it to a cell. A few basis images, the eigenspace of the "
    "face, approximate its cells. The energy is the residual of this approximation, summed over all faces and photos. "
    "Vertices move so that the energy falls: at the true surface, all photos of a face show the same texture; away from "
    "it, the averaged texture shows ghosting."
)


class Kind(NamedTuple):
    """A title and a paragraph."""

    title: str
    text: str


KINDS: tuple[Kind, ...] = (
    Kind(
        "Gauss-Newton step",
        "The residuals of all cells are linearised in the positions of the vertices. The step is the solution of a "
        "weighted least-squares problem. It is accepted only if the energy, evaluated with a new eigenspace, is lower.",
    ),
    Kind(
        "Local search",
        "Before Gauss-Newton starts on a level, positions around each vertex are evaluated, because Gauss-Newton "
        "converges only from nearby. A position is accepted if the photos agree clearly better there.",
    ),
    Kind(
        "Smoothing of the start",
        "The start mesh is noisy. Before the first level it is smoothed where the photos agree better with a smoother "
        "surface.",
    ),
    Kind(
        "Fit to sparse points",
        "The capture contains sparse points on the surface. The mesh is fitted to every second one of them, if the "
        "photos agree; the others are held out to evaluate the result. A weak prior on the points remains.",
    ),
    Kind(
        "Second fit to sparse points",
        "The photos have taken the mesh nearer to the surface. From there it is fitted to the sparse points once more, and the "
        "sweeps of this level are repeated. Where the photos do not agree with the fit, the vertices stay and the run ends.",
    ),
    Kind("Manual edit", "These vertices were moved manually. A new sweep begins from there."),
    Kind(
        "No vertex to move",
        "No vertex can move on this level: faces are too small for its blur, or too few photos see them.",
    ),
    *(Kind(kind.label.capitalize(), kind.text) for kind in StageKind),
)
NOTHING_MOVES = next(k for k, kind in enumerate(KINDS) if kind.title == "No vertex to move")
_OF_REASON = {
    StepReason.FOUND_PLACE: 1,
    StepReason.FOUND_TOGETHER: 1,
    StepReason.NO_BETTER_PLACE: 1,
    StepReason.SMOOTHED: 2,
    StepReason.FITTED_TO_POINTS: 3,
    StepReason.FITTED_AGAIN: 4,
    StepReason.REJECTED_FIT: 4,
    StepReason.MOVED_MANUALLY: 5,
    StepReason.RESET_MANUALLY: 5,
}


def kind_of(record: StepRecord) -> int:
    """Index into `KINDS`."""
    if record.stage in (StageKind.JUDGE, StageKind.SNAPSHOT) or (
        record.stage.is_fit and not set(record.reasons.tolist()) & _OF_REASON.keys()
    ):
        return NOTHING_MOVES + 1 + record.stage
    if len(record.reasons) == 0:
        return NOTHING_MOVES
    return max(_OF_REASON.get(StepReason(reason), 0) for reason in set(record.reasons.tolist()))


def level_text(options: FairingOptions, level: int) -> str:
    """One sentence about the purpose of a level."""
    blur = options.levels[level].blur
    if level == options.n_levels - 1:
        return f"The finest level: photos blurred by only {blur:g} px. It refines positions to hundredths of a pixel."
    return (
        f"Level {level + 1} of {options.n_levels}: photos blurred by {blur:g} px. Without finer detail, steps converge "
        "from errors of a few pixels."
    )
