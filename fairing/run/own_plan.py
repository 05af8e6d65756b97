"""Plans of one's own: checked, and turned into the levels and stages of a run.

Each stage of photos is a level of the run, with the smoothing and fits before it. What follows the last photos is a level without.
"""

from collections.abc import Sequence
from dataclasses import asdict, fields, replace
from typing import Any

from fairing.cells.level_choice import first_fine_level
from fairing.errors import InputError
from fairing.options import FairingOptions, LevelOptions, options_from_dict, options_to_dict
from fairing.run.stages import ROUNDS, Axes, ClosestPoints, Judge, PointGates, Smoothing, Stage
from fairing.run_plan import PlanStage, RunPlan
from fairing.solve.point_split import fitting_points
from fairing.solve.problem import Problem
from fairing.stage_kind import StageKind
from fairing.terms.points import GATES, NEAR_GATES
from fairing.trace import Trace

OWN_PLAN = "own_plan"
"""Key of a header: the stages of a plan of one's own."""
OPTIONS_BEFORE = "options_before_own_plan"
"""Key of a header: the options from which those of the run were made by `options_of_plan`."""
_STAGES: dict[str, Stage] = {
    stage.kind.label: stage
    for stage in (
        Smoothing(),
        PointGates(StageKind.POINTS, gates=GATES),
        PointGates(StageKind.SURFACE_POINTS, gates=NEAR_GATES, is_wanted=True),
        Axes(),
        ClosestPoints(max_sweeps=ROUNDS),
        Judge(),
    )
}
"""By kind, with the default settings."""
_SETTINGS: dict[str, tuple[str, ...]] = {
    "photos": tuple(field.name for field in fields(LevelOptions)),
    "smoothing": ("max_iterations",),
    "points": ("gates", "max_iterations"),
    "surface points": ("gates", "max_iterations"),
    "axes": ("max_sweeps", "max_iterations", "is_broad"),
    "closest points": ("max_sweeps", "max_iterations"),
    "judge": ("by",),
}


def check_plan(plan: Any) -> None:
    """Refuse a plan that makes no sense.

    Raises:
        InputError: with the number of the stage, what was expected and what was found.
    """
    if not isinstance(plan, list | tuple) or not plan:
        raise InputError(f"plan: expected a list of fairing.PlanStage, found {plan!r:.60}")
    is_prepared = False
    for number, stage in enumerate(plan, 1):
        if not isinstance(stage, PlanStage):
            raise InputError(f"plan: stage {number}: expected a fairing.PlanStage, found {type(stage).__name__}")
        if not isinstance(stage.kind, str) or stage.kind not in _SETTINGS:
            raise InputError(f"plan: stage {number}: expected one of {', '.join(_SETTINGS)}; found {stage.kind!r:.60}")
        where, known = f"plan: stage {number}, {stage.kind}", _SETTINGS[stage.kind]
        for name, value in stage.settings.items():
            if name not in known:
                raise InputError(f"{where}: expected settings among {', '.join(known)}; found {name}")
            if stage.kind != "photos":
                _check_value(where, name, value)
            elif isinstance(value, tuple):
                raise InputError(f"{where}: expected one value of {name}, found {value!r:.60}")
        by = _judge(stage)
        if by == "end" and number < len(plan):
            raise InputError(f"{where}: expected the judge of the end as the last stage, found stages after it")
        if by in ("points", "photos") and not is_prepared:
            raise InputError(f"{where}: expected smoothing or a fit before it, found none to judge")
        is_prepared = stage.kind != "photos" and by != "photos" and (is_prepared or stage.kind != "judge")


def options_of_plan(plan: Sequence[PlanStage], options: FairingOptions) -> FairingOptions:
    """The options with the levels that a plan has.

    Raises:
        InputError: the plan makes no sense.
    """
    check_plan(plan)
    kinds = {stage.kind for stage in plan}
    unused = {"smoothing": 0.0} if "smoothing" not in kinds else {}
    if not kinds - {"photos", "smoothing", "judge"}:
        unused["points"] = 0.0
    levels: list[LevelOptions] = []
    for part in by_level(plan):
        photos = next((stage.settings for stage in part if stage.kind == "photos"), None)
        if photos is None:
            levels.append(levels[-1] if levels else replace(options.levels[first_fine_level(options)], **unused))
            continue
        blur = photos.get("blur")
        nearest = options.levels[-1]
        if isinstance(blur, int | float):
            nearest = min(options.levels, key=lambda level, wanted=blur: abs(level.blur - wanted))
        levels.append(replace(nearest, **unused | photos))
    return replace(options, levels=tuple(levels))


def by_level(plan: Sequence[PlanStage]) -> list[tuple[PlanStage, ...]]:
    """The stages of each level. The judge of the end belongs to the level before it."""
    levels: list[tuple[PlanStage, ...]] = []
    part: list[PlanStage] = []
    for stage in plan:
        part.append(stage)
        if stage.kind == "photos":
            levels.append(tuple(part))
            part = []
    if part and levels and _judge(part[0]) == "end":
        levels[-1] += tuple(part)
    elif part:
        levels.append(tuple(part))
    return levels


def stages_of_level(part: Sequence[PlanStage], photos: Stage) -> tuple[Stage, ...]:
    """The stages of a level, with `photos` for those of photos; the numbers of their sweeps are not set."""
    stages, searches = [], 0
    for each in part:
        if each.kind == "photos":
            stages.append(photos)
            continue
        stage = replace(_STAGES[each.kind], **each.settings)
        if isinstance(stage, PointGates):
            stage = replace(stage, max_sweeps=len(stage.gates))
        if stage.kind is StageKind.SURFACE_POINTS:
            stage, searches = replace(stage, surface=searches), searches + 1
        if isinstance(stage, Judge) and stage.by == "photos":
            searches = 0  # the next fit begins
        stages.append(stage)
    return tuple(stages)


def run_plan_of(plan: Sequence[PlanStage], problem: Problem) -> RunPlan:
    """The run plan of a plan of one's own. Nothing is measured of the start.

    Raises:
        InputError: a stage needs sparse points that the scene does not have.
    """
    observed, positions = len(problem.observed_points), len(fitting_points(problem.scene))
    for number, stage in enumerate(plan, 1):
        is_broad = stage.settings.get("is_broad", False)
        if (stage.kind in ("points", "surface points") or _judge(stage) == "points") and not observed:
            needed = "sparse points with the photos that show them"
        elif (stage.kind == "closest points" or is_broad) and not positions:
            needed = "sparse points"
        else:
            continue
        raise InputError(f"plan: stage {number}, {stage.kind}: expected {needed}, found none in {problem.scene.name}")
    kinds = {stage.kind for stage in plan}
    return RunPlan(
        0,
        is_smoothed="smoothing" in kinds,
        is_fitted_to_points=bool(kinds - {"photos", "smoothing", "judge"}),
        has_photos_of_points=observed > 0,
        records_fit=True,
        stages=tuple(plan),
    )


def header_of_plan(plan: Sequence[PlanStage], options: FairingOptions) -> dict[str, Any]:
    """The entries of a header; none without a plan of one's own.

    Args:
        options: before `options_of_plan`.
    """
    if not plan:
        return {}
    return {OWN_PLAN: [asdict(stage) for stage in plan], OPTIONS_BEFORE: options_to_dict(options)}


def options_before_plan(trace: Trace, options: FairingOptions) -> FairingOptions:
    """The options of a run with the levels that they had before its plan; the default ones in older traces with a plan.

    Raises:
        InputError: the recorded ones make no sense.
    """
    if OWN_PLAN not in trace.header:
        return options
    recorded = trace.header.get(OPTIONS_BEFORE)
    before = FairingOptions() if recorded is None else options_from_dict(recorded)
    return replace(options, levels=before.levels)


def recorded_plan(trace: Trace, given: Sequence[PlanStage] | None = None) -> tuple[PlanStage, ...]:
    """The plan of one's own that a run was recorded with; empty without one.

    Args:
        given: a plan that the user asks for.

    Raises:
        InputError: the recorded one makes no sense, or another one is given.
    """
    found = trace.header.get(OWN_PLAN, [])
    if not isinstance(found, list):
        raise InputError(f"header: expected {OWN_PLAN} as a list of stages, found {found!r:.60}; record the run again")
    plan = tuple(PlanStage.recorded(stage) for stage in found)
    if plan:
        check_plan(plan)
    if trace.plan is not None and trace.plan.stages != plan:
        raise InputError(f"trace: expected the stages of {OWN_PLAN} in its plan, found others; record the run again")
    if given is not None and tuple(given) != plan:
        raise InputError("trace: recorded with another plan; leave the plan out to continue it, or begin a new run")
    return plan


def _judge(stage: PlanStage) -> str | None:
    return stage.settings.get("by", "photos") if stage.kind == "judge" else None


def _check_value(where: str, name: str, value: Any) -> None:
    most = 1000  # sweeps, iterations or gates
    if name == "gates":
        is_list = isinstance(value, tuple) and 0 < len(value) <= most
        if not is_list or not all(isinstance(gate, int | float) and 0 < gate <= 100 for gate in value):
            raise InputError(f"{where}: expected gates as a list of numbers of percent above 0, found {value!r:.60}")
    elif name == "by":
        if value not in ("points", "photos", "end"):
            raise InputError(f"{where}: expected by as one of points, photos, end; found {value!r:.60}")
    elif name == "is_broad":
        if not isinstance(value, bool):
            raise InputError(f"{where}: expected is_broad as True or False, found {value!r:.60}")
    elif not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= most:
        raise InputError(f"{where}: expected {name} as a whole number from 1 to {most}, found {value!r:.60}")
