"""Run plan: the properties of a start mesh that a run determines once, before its first step."""

import json
from dataclasses import asdict, dataclass, fields

from fairing.errors import InputError


@dataclass(frozen=True)
class RunPlan:
    """Computed from scene and options by `fairing.run.planning`, and recorded in the trace.

    Attributes:
        first_level: coarsest level whose blur suits the size of the faces.
        is_smoothed: whether smoothing the start lowers the photo loss; the first step then smooths it.
        is_fitted_to_points: whether fitting the start to the sparse points lowers the photo loss; a step then fits it.
        start_error: distance of the vertices from their true positions, px; 0: no search and no restart.
        is_near_truth: whether trial searches found the unchanged start at its true position.
        start_sigma: standard deviation of the start in the prior to it, px; 0: no such prior.
        edge_reach: distance from a crease within which its image edge is sought, px.
        represents_surface: whether the sparse points lie so near the prepared start that its faces can follow the surface.
        has_second_fit: whether the last level ends with a second fit to the sparse points, see `fairing.run.phases.SecondFit`.
    """

    first_level: int
    is_smoothed: bool
    is_fitted_to_points: bool
    start_error: float
    is_near_truth: bool
    start_sigma: float = 0.0
    edge_reach: float = 2.0
    represents_surface: bool = False
    has_second_fit: bool = False

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
            further = values.keys() - {field.name for field in fields(cls)}
            plan = cls(**{name: values[name] for name in values.keys() - further})
        except (ValueError, TypeError, RecursionError):
            raise InputError(f"run plan: expected a JSON object of its fields, found {text!r:.80}") from None
        if further:
            raise InputError(f"run plan: expected no field {min(further)}; open the run with the version that wrote it")
        for field in fields(cls):
            value = getattr(plan, field.name)
            if type(value) is not field.type:
                raise InputError(f"run plan: {field.name}: expected {field.type}, found {value!r:.60}")
        distances = (plan.start_error, plan.start_sigma, plan.edge_reach)
        if plan.first_level < 0 or not all(0 <= px < float("inf") for px in distances):
            raise InputError(
                "run plan: expected first_level >= 0, and start_error, start_sigma and edge_reach finite and >= 0, "
                f"found {text!r:.200}"
            )
        return plan
