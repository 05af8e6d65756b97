"""Run plan: what a run does, determined once, before its first step: by the properties of the start mesh, or by its user."""

import json
from dataclasses import asdict, dataclass, field, fields
from typing import Any

from fairing.errors import InputError

FORMER_FIELDS = {"start_error", "is_near_truth", "has_second_fit"}
"""Of plans in older traces: for trial searches and second fits, which runs no longer make."""


@dataclass(frozen=True, init=False)
class PlanStage:
    """A stage of a plan of one's own: `PlanStage("photos", blur=2.0, max_sweeps=3)`.

    A plan is a list of them; the run executes just these, in their order. The photos are one stage for each blur; their
    settings are fields of `LevelOptions`: what is not set is as at the level of the options whose blur is nearest, or at the
    last one without a blur. The priors `smoothing` and `points` act where a stage of smoothing or a fit is in the plan, or where
    they are set. Settings of the other stages, with their defaults:

    - "smoothing": max_iterations=5, passes of the filter.
    - "points": gates=(2.0, ..., 0.1), percent of the diagonal, one sweep each; max_iterations=1.
    - "surface points": the same, with points sought near the mesh.
    - "axes": max_sweeps=1, max_iterations=3, is_broad=False.
    - "closest points": max_sweeps=4, max_iterations=1.
    - "judge": by="photos", "points" or "end": keeps the smoothing or the fit before it, or goes back to where that began; "end":
      compares with the start, as the last stage. "photos" are those of the plan's first blur of at most 1.2 px, or of its last.
    """

    kind: str
    settings: dict[str, Any]

    def __init__(self, kind: str, **settings: Any) -> None:
        values = {name: tuple(value) if isinstance(value, list) else value for name, value in settings.items()}
        object.__setattr__(self, "kind", kind)
        object.__setattr__(self, "settings", values)

    @classmethod
    def recorded(cls, found: Any) -> "PlanStage":
        """The inverse of `dataclasses.asdict`.

        Raises:
            InputError: it is no stage.
        """
        try:
            return cls(found["kind"], **found["settings"])
        except (KeyError, TypeError):
            raise InputError(f"plan: expected stages with a kind and settings, found {found!r:.80}") from None


@dataclass(frozen=True)
class RunPlan:
    """Computed from scene and options by `fairing.run.planning`, and recorded in the trace.

    Attributes:
        first_level: coarsest level whose blur suits the size of the faces.
        is_smoothed: whether smoothing the start lowers the photo loss; the run then begins with it.
        is_fitted_to_points: whether fitting the start to the sparse points lowers the photo loss; the run then begins so.
        start_sigma: standard deviation of the start as points measured it, px; 0: they did not, see `StepOptions.start_sigma`.
        edge_reach: distance from a crease within which its image edge is sought, px.
        represents_surface: whether the sparse points lie so near the prepared start that its faces can follow the surface.
        has_photos_of_points: whether it is known which photos show the sparse points.
        records_fit: whether every iteration of smoothing and fits is a step; former versions recorded each as one.
        stages: of a plan of one's own, in their order; empty: those that the start calls for.
    """

    first_level: int
    is_smoothed: bool
    is_fitted_to_points: bool
    start_sigma: float = 0.0
    edge_reach: float = 2.0
    represents_surface: bool = False
    has_photos_of_points: bool = False
    records_fit: bool = False
    stages: tuple[PlanStage, ...] = field(default=(), hash=False)

    @property
    def follows_points(self) -> bool:
        """Whether the start was fitted to sparse points, and its faces can follow the surface."""
        return self.is_fitted_to_points and self.represents_surface

    def to_json(self) -> str:
        """The plan as JSON text; `from_json` returns an equal plan."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> "RunPlan":
        """The inverse of `to_json`.

        Raises:
            InputError: the text is no plan.
        """
        try:
            values = dict(json.loads(text))
            further = values.keys() - {each.name for each in fields(cls)} - FORMER_FIELDS
            if "stages" in values:
                values["stages"] = tuple(PlanStage.recorded(stage) for stage in list(values["stages"]))
            plan = cls(**{name: values[name] for name in values.keys() - further - FORMER_FIELDS})
        except (ValueError, TypeError, RecursionError):
            raise InputError(f"run plan: expected a JSON object of its fields, found {text!r:.80}") from None
        if further:
            raise InputError(f"run plan: expected no field {min(further)}; open the run with the version that wrote it")
        for each in fields(cls):
            value = getattr(plan, each.name)
            if each.name != "stages" and type(value) is not each.type:
                raise InputError(f"run plan: {each.name}: expected {each.type}, found {value!r:.60}")
        distances = (plan.start_sigma, plan.edge_reach)
        if plan.first_level < 0 or not all(0 <= px < float("inf") for px in distances):
            raise InputError(
                "run plan: expected first_level >= 0, and start_sigma and edge_reach finite and >= 0, "
                f"found {text!r:.200}"
            )
        return plan
