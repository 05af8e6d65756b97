"""Run plan: the properties of a start mesh that a run determines once, before its first step."""

import json
from dataclasses import asdict, dataclass, fields

from fairing.errors import InputError

FORMER_FIELDS = {"start_error", "is_near_truth", "has_second_fit"}
"""Of plans in older traces: for trial searches and second fits, which runs no longer make."""


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
    """

    first_level: int
    is_smoothed: bool
    is_fitted_to_points: bool
    start_sigma: float = 0.0
    edge_reach: float = 2.0
    represents_surface: bool = False
    has_photos_of_points: bool = False
    records_fit: bool = False

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
            further = values.keys() - {field.name for field in fields(cls)} - FORMER_FIELDS
            plan = cls(**{name: values[name] for name in values.keys() - further - FORMER_FIELDS})
        except (ValueError, TypeError, RecursionError):
            raise InputError(f"run plan: expected a JSON object of its fields, found {text!r:.80}") from None
        if further:
            raise InputError(f"run plan: expected no field {min(further)}; open the run with the version that wrote it")
        for field in fields(cls):
            value = getattr(plan, field.name)
            if type(value) is not field.type:
                raise InputError(f"run plan: {field.name}: expected {field.type}, found {value!r:.60}")
        distances = (plan.start_sigma, plan.edge_reach)
        if plan.first_level < 0 or not all(0 <= px < float("inf") for px in distances):
            raise InputError(
                "run plan: expected first_level >= 0, and start_sigma and edge_reach finite and >= 0, "
                f"found {text!r:.200}"
            )
        return plan
