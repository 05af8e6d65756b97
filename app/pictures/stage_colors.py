"""Colours and patterns of the kinds of stages. Kinds that some eyes cannot tell apart by colour differ in their pattern."""

from app.palette import RGB, STAGE_COLORS, css
from fairing.stage_kind import StageKind

COLOR_OF_STAGE: dict[StageKind, RGB] = dict(zip(StageKind, STAGE_COLORS, strict=True))

_PATTERNS = {
    StageKind.SMOOTHNESS: "radial-gradient(circle,{line} 1px,transparent 1.5px) 0 0/5px 5px",
    StageKind.SURFACE_POINTS: "repeating-linear-gradient(45deg,{line} 0 1.5px,transparent 1.5px 5px)",
    StageKind.CLOSEST_POINTS: "repeating-linear-gradient(-45deg,{line} 0 1.5px,transparent 1.5px 5px)",
    StageKind.FIT: "repeating-linear-gradient(0deg,{line} 0 1px,transparent 1px 4px)",
    StageKind.SNAPSHOT: "radial-gradient(circle,{line} 2px,transparent 2.5px) 0 0/10px 10px",
    StageKind.AXES: "repeating-linear-gradient(90deg,{line} 0 1px,transparent 1px 5px)",
}
_SOLID = frozenset({StageKind.JUDGE, StageKind.MANUAL})
"""Short stages, which have no room for a name: they stand out as posts between the others."""


def stage_ground(kind: StageKind) -> str:
    """The CSS background of a stage in a timeline: pale enough for a name on it, in both themes."""
    color = COLOR_OF_STAGE[kind]
    if kind in _SOLID:
        return css(color)
    pale = css(color, 0.3)
    ground = f"linear-gradient({pale},{pale})"
    return f"{_PATTERNS[kind].format(line=css(color, 0.25))},{ground}" if kind in _PATTERNS else ground
