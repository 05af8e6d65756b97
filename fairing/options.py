"""Options of the engine: defaults, units and meanings.

The flags of the command line and the widgets of the page are generated from these fields, with their texts. What differs
between levels is in `LevelOptions`, the rest in groups. The measurements behind the defaults are in the ledger
(`tests/ledger.md`).
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields, is_dataclass, replace
from typing import Annotated, Any, Literal, get_type_hints

from fairing.errors import InputError

FINE_BLUR = 1.2  # px: levels up to this blur are fine enough to judge vertices near the truth

FORMER_NAMES = {"options.schedule.start": "first_level"}
"""New names of renamed options, by their former path; traces and reports may hold the former ones."""
FORMER_OPTIONS: dict[str, str] = {
    **dict.fromkeys(
        ("schedule.search", "schedule.start_error", "schedule.search_gain", "schedule.sweeps_near_truth"),
        "runs make no local searches",
    ),
    **dict.fromkeys(
        ("step.prior_threshold", "step.normal_spread"),
        "the prior to the start (step.prior) holds vertices within planes and along edges",
    ),
    "eigenspace.significance": "every face keeps the eigenspace dimensions of its level",
}
"""Options of mechanisms that runs no longer have: accepted where they are read, without effect. Values: what runs do instead."""


@dataclass(frozen=True)
class CellOptions:
    """How a face's footprint in a photo becomes a cell."""

    warp: Literal["homography", "affine"] = "homography"
    """homography: exact for a plane. affine: the approximation of the paper, which biases the minimum."""
    adaptive: bool = True
    """Use smaller cells for smaller footprints: one sample per `spacing` of the footprint. Off: always `size`."""
    color: bool = False
    """Stack the red, green and blue channels instead of using grey levels."""
    remove_bias: bool = False
    """Subtract the mean of each cell, which makes the energy invariant to brightness offsets between photos. It is always
    invariant to gains."""
    weighting: Literal["photo_area", "cell"] = "photo_area"
    """photo_area: the weight of a cell is the number of photo pixels it covers. cell: all cells weigh the same (the paper)."""


@dataclass(frozen=True)
class EigenspaceOptions:
    """The subspace that explains the cells of one face."""

    centered: bool = False
    """Subtract the mean cell first (PCA). The paper does not."""


@dataclass(frozen=True)
class RobustOptions:
    """The robust loss rho of the residual."""

    norm: Literal["geman_mcclure", "geman_mcclure_printed", "huber", "least_squares", "own"] = "geman_mcclure"
    """geman_mcclure: e^2 / (sigma^2 + e^2); its outlier threshold is sigma / sqrt(3), as in the figure of the paper.
    geman_mcclure_printed: e^2 / (sigma + e^2), the formula as printed; its outlier threshold is sqrt(sigma / 3).
    own: a norm of your own, given with `norm=` or `--with FILE`."""
    sigma: float = 20.0
    """Scale for the rule `fixed`, grey levels."""
    mad_factor: float = 4.0
    """With the rule `mad`, sigma = mad_factor * 1.4826 * median|e|; the influence of residuals falls beyond sigma / sqrt(3)."""
    sigma_floor: float = 1.0
    """Lower bound of sigma, grey levels: the quantisation and noise of the photos."""


@dataclass(frozen=True)
class StepOptions:
    """Gauss-Newton steps: solver, damping, acceptance and priors."""

    solver: Literal["variable_projection", "alternating"] = "variable_projection"
    """variable_projection: the eigenspace is eliminated from the least squares problem (Golub and Pereyra 1973). alternating: U and
    c are fixed during a step, as in the paper; steps are then 10 to 200 times shorter."""
    max_step: float = 2.0
    """Longest step in a photo, in units of max(1 px, blur of the level)."""
    damping_always: bool = False
    """Use Levenberg-Marquardt damping from the first step on, instead of only after a rejection. It narrows the basin of
    attraction."""
    initial_damping: float = 1e-3
    """First damping after a rejection, as a fraction of the largest eigenvalue of the vertex's normal matrix."""
    max_rejections: int = 6
    """A vertex is not tried again in a sweep after more than this many rejections in a row."""
    tolerance: float = 0.001
    """A vertex has converged when a step moves it by less than this in every photo, px."""
    prior: float = 0.1
    """Strength of the prior to the start, unless points measure how far it is off. Without points it acts where the surface moves
    within itself (within a plane, along an edge), relative to the largest eigenvalue of the vertex's normal matrix; after a fit to
    points in all directions, relative to a start that is 2 px off. 0: none."""
    min_quality: float = 0.05
    """Smallest ratio of height to longest edge of a face after a step, unless the face was thinner before."""
    max_turn: float = 60.0
    """Largest rotation of a face normal in one step, degrees."""


@dataclass(frozen=True)
class VisibilityOptions:
    """Visibility: the photos in which a face is used."""

    min_angle: float = 12.0
    """Smallest angle between the face and the line of sight, degrees."""
    min_footprint: float = 2.0
    """Smallest height of the footprint, in units of max(1 px, blur of the level)."""
    edge_margin: float = 2.0
    """Samples nearer than this to a depth edge are left out, in units of the blur of the level, at least one pixel: blurring a
    photo mixes colours across depth edges."""
    min_samples: float = 0.4
    """A cell is used if at least this fraction of its samples is visible."""
    reduction: int = 2
    """Photo pixels per pixel of the depth maps for the occlusion test."""
    max_views: int = 12
    """Largest number of photos per face: those with the largest footprints."""


@dataclass(frozen=True)
class ScheduleOptions:
    """Where a run begins, the order in which vertices move, and when a level ends."""

    first_level: Literal["auto", "first"] = "auto"
    """Where the run begins. auto: skip levels whose blur exceeds 1/12 of the median height of the faces' footprints, and
    coarse levels where sparse points measure the start. first: at the first level."""
    order: Literal["joint", "independent", "sequential", "worst_first"] = "joint"
    """joint: all vertices in one sparse system. independent: sets of vertices that share no face, one set after another.
    sequential: one vertex at a time, as in the paper. worst_first: one at a time, largest energy first."""
    sweep_tolerance: float = 0.02
    """A level ends when no vertex moved more than this in a sweep, in units of the blur of the level."""


@dataclass(frozen=True)
class LevelOptions:
    """The options of one level. Each belongs to a group, by which flags and widgets name it, such as `schedule.blur`."""

    blur: Annotated[float, "schedule"] = 1.2
    """sigma_smooth, photo pixels."""
    max_sweeps: Annotated[int, "schedule"] = 3
    """Largest number of Gauss-Newton sweeps; visibility is updated at the beginning of each."""
    max_iterations: Annotated[int, "schedule"] = 3
    """Largest number of Gauss-Newton iterations of a block of vertices within a sweep."""
    size: Annotated[int, "cells"] = 64
    """Size of the largest cell: samples along an edge. With `adaptive`, cells larger than 64 are made smaller if all cells
    together would have more than 10 million samples."""
    spacing: Annotated[float, "cells"] = 1.0
    """Distance between samples with `adaptive`, in units of max(1 px, blur of the level)."""
    inset: Annotated[float, "cells"] = 0.0
    """Width of the border of a face that is left out, photo px: the texture of the neighbouring face mixes in there."""
    interpolation: Annotated[Literal["bilinear", "cubic"], "cells"] = "bilinear"
    """Interpolation between photo pixels. cubic: B-spline without interpolation blur, 3 to 4 times slower."""
    point_spread: Annotated[Literal["as_seen", "common"], "cells"] = "as_seen"
    """Point spread function (PSF) of the photos on a face. common: each photo is blurred just enough that all photos of the face
    have the same PSF on it; the blur of the level is the smallest sigma of that PSF, the PSF of the lens included. as_seen: every
    photo is blurred by the same number of pixels."""
    dimensions: Annotated[int, "eigenspace"] = 1
    """k, at most views - 2. To first order a misalignment spans three dimensions, so a large k absorbs it."""
    sigma_rule: Annotated[Literal["paper", "convex", "mad", "fixed"], "robust"] = "fixed"
    """Scale parameter of the loss. paper: max|e| / sqrt(3). convex: sqrt(3) max|e|. mad: median absolute residual times
    `mad_factor`. fixed: `sigma`."""
    smoothing: Annotated[float, "step"] = 0.1
    """Strength of the smoothness prior for a start whose smoothed version fits the photos better; relative to the median of the
    vertices' largest eigenvalues. 0 on all levels: smooth nothing, not even the start."""
    points: Annotated[float, "step"] = 0.3
    """Strength of the prior to the sparse points, if fitting the start to them lowers the photo loss; relative to the median of the
    vertices' largest eigenvalues, for a direction that the points determine as well as an average one. Every second point is
    used. 0 on all levels: do not use the points."""
    creases: Annotated[float, "step"] = 0.0
    """Strength of image edges: creases of the mesh are drawn to edges in the photos, and edges of a building to its axes. 1: a
    deviation by a pixel weighs as much as the residuals of the photos there over 10,000 px. 0: none."""


LEVEL_GROUPS: dict[str, str] = {
    name: hint.__metadata__[0] for name, hint in get_type_hints(LevelOptions, include_extras=True).items()
}
"""The group of each field of `LevelOptions`."""

ACCURATE_LEVELS = (
    LevelOptions(blur=6.0, dimensions=3, sigma_rule="paper", max_sweeps=12, max_iterations=4),
    LevelOptions(blur=3.6, dimensions=3, sigma_rule="paper", max_sweeps=5, max_iterations=4),
    LevelOptions(blur=2.0),
    LevelOptions(blur=1.2),
    LevelOptions(
        blur=0.5, dimensions=2, sigma_rule="paper", max_sweeps=5, size=256, inset=2.0, interpolation="cubic",
        point_spread="common", smoothing=0.0, creases=1.0,
    ),
)  # fmt: skip
PAPER_LEVELS = tuple(
    LevelOptions(
        blur, dimensions=5, sigma_rule="paper", max_sweeps=10, max_iterations=20, size=128, smoothing=0.0, points=0.0,
    )
    for blur in (6.0, 4.8, 3.6, 2.4, 1.2)
)  # fmt: skip


@dataclass(frozen=True)
class FairingOptions:
    """All options of a run."""

    cells: CellOptions = field(default_factory=CellOptions)
    eigenspace: EigenspaceOptions = field(default_factory=EigenspaceOptions)
    robust: RobustOptions = field(default_factory=RobustOptions)
    step: StepOptions = field(default_factory=StepOptions)
    visibility: VisibilityOptions = field(default_factory=VisibilityOptions)
    schedule: ScheduleOptions = field(default_factory=ScheduleOptions)
    levels: tuple[LevelOptions, ...] = ACCURATE_LEVELS
    """The levels, from coarse to fine; at least one."""
    lock_boundary: bool = False
    """Lock the vertices at the boundary of the mesh."""
    locked_vertices: tuple[int, ...] = ()
    """Locked vertices, by their number in the input mesh."""
    locked_boxes: tuple[float, ...] = ()
    """Boxes x0 y0 z0 x1 y1 z1, world units, one after another: vertices that start inside are locked."""
    region: tuple[float, ...] = ()
    """Region of interest x0 y0 z0 x1 y1 z1, world units: vertices that start outside are locked."""
    threads: int = 0
    """Number of threads; 0: one per core. The result does not depend on it."""

    def __post_init__(self) -> None:
        if not self.levels:
            raise _no_value("blur")

    @property
    def n_levels(self) -> int:
        return len(self.levels)

    @property
    def uses_points(self) -> bool:
        """Whether any level uses the sparse points."""
        return any(level.points for level in self.levels)

    def with_levels(self, **values: Any) -> "FairingOptions":
        """These options with other values at their levels, such as `with_levels(blur=(2.0, 1.0), dimensions=1)`.

        Args:
            values: by name of a field of `LevelOptions`: a list from the first level on, whose last value holds for the rest, or
                one value for all levels. There are as many levels as blurs, if they are given; more than before are like the last.

        Raises:
            InputError: there is no such field, or a list is empty.
        """
        lists = {name: value if isinstance(value, list | tuple) else (value,) for name, value in values.items()}
        for name, each in lists.items():
            if name not in LEVEL_GROUPS:
                raise InputError(f"unknown option of a level: {name}; known are {', '.join(LEVEL_GROUPS)}")
            if not each:
                raise _no_value(name)
        levels = (
            replace(_at(self.levels, k), **{name: _at(each, k) for name, each in lists.items()})
            for k in range(len(lists.get("blur", self.levels)))
        )
        return replace(self, levels=tuple(levels))

    def by_level(self, name: str) -> tuple[Any, ...]:
        """The values of a field of `LevelOptions`, as short as `with_levels` takes them; the blurs in full."""
        values = [getattr(level, name) for level in self.levels]
        while name != "blur" and len(values) > 1 and values[-1] == values[-2]:
            values.pop()
        return tuple(values)


PRESETS: dict[str, FairingOptions] = {
    "accurate": FairingOptions(),
    "paper": FairingOptions(
        cells=CellOptions(warp="affine", adaptive=False, weighting="cell"),
        step=StepOptions(solver="alternating", prior=0.0),
        schedule=ScheduleOptions(first_level="first", order="sequential"),
        levels=PAPER_LEVELS,
    ),
}


def options_to_dict(options: FairingOptions) -> dict[str, Any]:
    """Options as nested dictionaries of numbers, strings and tuples, for JSON."""
    return asdict(options)


def options_from_dict(values: dict[str, Any], default: FairingOptions = PRESETS["accurate"]) -> FairingOptions:
    """The inverse of `options_to_dict`; former names (`FORMER_NAMES`, `FORMER_OPTIONS`) are accepted.

    Options that are not in `values` are as in `default`. A group may also hold lists by level, as `with_levels` takes them:
    {"schedule": {"blur": [2.0, 1.0]}}.

    Raises:
        InputError: unknown name, or a value of the wrong kind.
    """
    lists = {}
    for name, group in LEVEL_GROUPS.items():
        members = values.get(group) if isinstance(values, dict) else None
        if isinstance(members, dict) and name in members:
            lists[name] = members[name]
            values = values | {group: {key: value for key, value in members.items() if key != name}}
            if not isinstance(lists[name], list | tuple):
                raise InputError(f"options.{group}.{name}: expected a list of values, found {lists[name]!r:.60}")
    return _from_dict(default, values, "options").with_levels(**lists)


def _at(values: Sequence[Any], level: int) -> Any:
    return values[min(level, len(values) - 1)]


def _no_value(name: str) -> InputError:
    return InputError(f"option {LEVEL_GROUPS[name]}.{name}: expected at least one value, found none")


def _from_dict(default: Any, values: dict[str, Any], where: str) -> Any:
    if not isinstance(values, dict):
        raise InputError(f"{where}: expected options by name, found {values!r:.60}")
    known = {f.name for f in fields(default)}
    values = {
        FORMER_NAMES.get(f"{where}.{name}", name): value
        for name, value in values.items()
        if f"{where}.{name}".removeprefix("options.") not in FORMER_OPTIONS
    }
    unknown = set(values) - known
    if unknown:
        raise InputError(f"{where}: unknown option {min(unknown)}; known are {', '.join(sorted(known))}")
    changes = {}
    for name, value in values.items():
        current = getattr(default, name)
        if is_dataclass(current):
            changes[name] = _from_dict(current, value, f"{where}.{name}")
        elif isinstance(current, tuple) != isinstance(value, list | tuple):
            raise InputError(f"{where}.{name}: expected a value such as {current!r:.60}, found {value!r:.60}")
        elif name == "levels":
            changes[name] = tuple(_from_dict(LevelOptions(), level, f"{where}.levels") for level in value)
        else:
            changes[name] = tuple(value) if isinstance(current, tuple) else value
    return replace(default, **changes)
