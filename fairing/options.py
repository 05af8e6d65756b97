"""Every choice of the engine, with its default, unit and meaning, in one place.

The command line's flags and the page's widgets are generated from these fields. Values "by level" are tuples; the last one
holds for all further levels.
"""

from dataclasses import asdict, dataclass, field, fields, is_dataclass, replace
from typing import Any, Literal, TypeVar

from fairing.errors import InputError

T = TypeVar("T")


def by_level(values: tuple[T, ...], level: int) -> T:
    """The value for a level: the level's own, or the last one given."""
    return values[min(level, len(values) - 1)]


@dataclass(frozen=True)
class CellOptions:
    """How a face's footprint in a photo becomes a cell."""

    warp: Literal["homography", "affine"] = "homography"
    """homography: exact for a plane. affine: the paper's; it moves the minimum itself (cube: 1.6 % with cameras 4 edges away)."""
    size: tuple[int, ...] = (64, 64, 64, 64, 64, 64, 256)
    """Largest cell, samples along an edge, by level."""
    adaptive: bool = True
    """Smaller cells where the footprint is smaller: one sample per `spacing` of the footprint. Off: always `size`."""
    spacing: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.7)
    """Distance of samples with `adaptive`, in units of max(1 px, the level's blur), by level."""
    inset: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0)
    """Border of the face left out, photo pixels, by level: there the neighbour's texture mixes in."""
    interpolation: tuple[Literal["bilinear", "cubic"], ...] = (
        "bilinear", "bilinear", "bilinear", "bilinear", "bilinear", "bilinear", "cubic",
    )  # fmt: skip
    """How photos are read between pixels, by level. cubic: B-spline, 3-4 x slower, no interpolation blur."""
    point_spread: tuple[Literal["as_seen", "common"], ...] = (
        "as_seen", "as_seen", "as_seen", "as_seen", "as_seen", "as_seen", "common",
    )  # fmt: skip
    """By level. common: the photos of a face are blurred so that they are equally sharp on it, and no more than that takes; the
    level's blur is their spot's least size, the lens's own included. as_seen: all are blurred alike, in pixels."""
    color: bool = False
    """Stack red, green and blue instead of using grey."""
    remove_bias: bool = False
    """Subtract each cell's mean, so that brightness offsets between photos do not count. Gains never do."""
    weighting: Literal["photo_area", "cell"] = "photo_area"
    """photo_area: a cell weighs as many photo pixels as it covers. cell: all cells weigh the same (the paper)."""


@dataclass(frozen=True)
class EigenspaceOptions:
    """The subspace that explains the cells of one face."""

    dimensions: tuple[int, ...] = (3, 3, 1, 1, 1, 1, 2)
    """k, by level. To first order misalignment spans three dimensions, so a large k absorbs it. At most views - 2."""
    significance: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 6.0)
    """By level: a face whose k-th singular value squared is less than this many times the mean of the later ones does with one
    dimension less: it would only learn noise. 0: never."""
    centered: bool = False
    """Take the mean cell off first (PCA). The paper does not."""


@dataclass(frozen=True)
class RobustOptions:
    """The norm rho of the residual."""

    norm: Literal["geman_mcclure", "geman_mcclure_printed", "huber", "least_squares"] = "geman_mcclure"
    """geman_mcclure: e^2 / (sigma^2 + e^2), turning at sigma / sqrt(3) as the paper's figure says.
    geman_mcclure_printed: e^2 / (sigma + e^2), the paper's formula, which turns at sqrt(sigma / 3)."""
    sigma_rule: tuple[Literal["paper", "convex", "mad", "fixed"], ...] = (
        "paper", "paper", "fixed", "fixed", "fixed", "fixed", "paper",
    )  # fmt: skip
    """By level. paper: max|e| / sqrt(3). convex: sqrt(3) max|e|. mad: a robust scale of the residual. fixed: `sigma`."""
    sigma: float = 20.0
    """Grey levels, for the rule `fixed`."""
    mad_factor: float = 4.0
    """sigma = mad_factor * 1.4826 * median|e| with the rule `mad`; residuals beyond sigma / sqrt(3) lose influence."""
    sigma_floor: float = 1.0
    """Smallest sigma, grey levels: photos are never better than their quantisation and noise."""


@dataclass(frozen=True)
class StepOptions:
    """One Gauss-Newton step and what may be accepted."""

    solver: Literal["variable_projection", "alternating"] = "variable_projection"
    """variable_projection: the eigenspace answers to the vertex (Golub and Pereyra 1973). alternating: the paper's, U and c
    held fixed during a step, which makes it 10-200 times too short."""
    max_step: float = 2.0
    """Longest step in a photo, in units of max(1 px, the level's blur)."""
    damping_always: bool = False
    """Levenberg-Marquardt damping from the first step on, instead of only after a rejection. It shrank the capture
    range (from 20 % away 100 % -> 62 %)."""
    initial_damping: float = 1e-3
    """First damping after a rejection, as a fraction of the normal matrix's diagonal."""
    max_rejections: int = 6
    """A vertex rests after this many rejections in a row."""
    tolerance: float = 0.001
    """A vertex has converged when its step moves it by less than this in every photo, px."""
    prior: float = 0.1
    """Pull to the start along directions that the photos do not determine, relative to the largest eigenvalue. 0: none."""
    prior_threshold: float = 0.15
    """A direction is undetermined when its eigenvalue is below this fraction of the largest."""
    normal_spread: float = 0.01
    """Directions in which the incident normals vary by less than this (variance) count as undetermined, too."""
    smoothing: tuple[float, ...] = (0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.0)
    """By level, for a start that the photos find noisy: pull to where its faces would be smooth, relative to the median of
    the vertices' largest eigenvalues. 0 on all levels: never smooth, not even the start. (At the last level 0.03 flattens
    what is curved: dome 0.060 instead of 0.031 % from the true surface on average, where its best mesh has 0.030; two
    captures with noise ended alike, at 0.1255 instead of 0.1240 and 0.186.)"""
    points: tuple[float, ...] = (0.3,)
    """By level, for a scene with sparse points that the photos agree with: pull to half of them, relative to the median of the
    vertices' largest eigenvalues, in directions they know as well as others on average. 0 on all levels: never use them."""
    min_quality: float = 0.05
    """A face may not become thinner than this (height over longest edge) unless it was so before."""
    max_turn: float = 60.0
    """A face's normal may not turn by more than this in one step, degrees."""


@dataclass(frozen=True)
class VisibilityOptions:
    """Which photos a face takes part in."""

    min_angle: float = 12.0
    """Smallest angle between the face and the line of sight, degrees."""
    min_footprint: float = 2.0
    """Smallest height of the footprint, in units of max(1 px, the level's blur)."""
    edge_margin: float = 2.0
    """Samples nearer than this to a depth edge are left out, in units of the level's blur (at least one pixel): a photo
    blurred as a whole mixes colours across depth edges (facade, sigma 3.6: 1.14 % rms without, 0.15 with)."""
    min_samples: float = 0.4
    """A cell takes part if at least this fraction of its samples is seen."""
    reduction: int = 2
    """Photo pixels per pixel of the depth maps occlusion is judged by."""
    max_views: int = 12
    """At most so many photos a face, those with the largest footprints."""


@dataclass(frozen=True)
class ScheduleOptions:
    """Coarse to fine, and in which order vertices move."""

    blur: tuple[float, ...] = (6.0, 3.6, 2.0, 2.0, 1.2, 1.2, 0.5)
    """sigma_smooth by level, photo pixels."""
    start: Literal["auto", "first"] = "auto"
    """auto: skip levels whose blur exceeds 1/12 of the faces' median footprint. first: begin with the first level."""
    search: tuple[float, ...] = (0.0, 0.0, 1.0, 0.75, 0.6, 0.5, 0.9)
    """By level: before Gauss-Newton, look for a better place of each vertex so far away, in units of `start_error`. 0: do not.
    Where photos are equally sharp (`cells.point_spread`), only of those that fit worse than half of them; what then fits twice as
    badly as half of them is tried again together, from the first level that searched."""
    start_error: float = -1.0
    """How far the start's vertices may lie from their place, photo px. Negative: find out by trying. 0: never search."""
    search_gain: float = 0.05
    """A place found must lower the mean loss around the vertex by this fraction."""
    order: Literal["joint", "independent", "sequential", "worst_first"] = "joint"
    """joint: all vertices by one sparse system. independent: sets of vertices that share no face, one set after another.
    sequential: one vertex at a time, as the paper. worst_first: the same, largest energy first."""
    max_sweeps: tuple[int, ...] = (12, 8, 4, 2, 4, 2, 4)
    """Gauss-Newton sweeps, by level; visibility is refreshed at the beginning of each."""
    sweeps_near_truth: tuple[int, ...] = (1, 1, 1, 1, 1, 1, 2)
    """At most so many where trying found the start near its truth and no sparse points hold it: with every sweep vertices drift a
    little farther along what the photos hardly tell (three captures without their points, median distance of these to the
    surface: with as many sweeps as elsewhere -8, +7 and +4 %, so -8, -4 and -2 %; left-out photos better by 0.3 dB instead of
    0.5)."""
    max_iterations: tuple[int, ...] = (4, 4, 3)
    """Gauss-Newton iterations of a vertex (or of all, with joint) within a sweep, by level."""
    sweep_tolerance: float = 0.02
    """A level ends when no vertex moved more than this in a sweep, in units of the level's blur."""


@dataclass(frozen=True)
class FairingOptions:
    """All options of a run."""

    cells: CellOptions = field(default_factory=CellOptions)
    eigenspace: EigenspaceOptions = field(default_factory=EigenspaceOptions)
    robust: RobustOptions = field(default_factory=RobustOptions)
    step: StepOptions = field(default_factory=StepOptions)
    visibility: VisibilityOptions = field(default_factory=VisibilityOptions)
    schedule: ScheduleOptions = field(default_factory=ScheduleOptions)
    lock_boundary: bool = False
    """Keep the vertices at the mesh's boundary where they are."""
    locked_vertices: tuple[int, ...] = ()
    """Vertices that never move, by their number in the input mesh."""
    locked_boxes: tuple[float, ...] = ()
    """Vertices that start inside never move: x0 y0 z0 x1 y1 z1, world units; further boxes behind."""
    region: tuple[float, ...] = ()
    """Region of interest, x0 y0 z0 x1 y1 z1, world units: vertices that start outside never move."""
    threads: int = 0
    """Threads; 0: one per core. The result is the same for any number."""

    @property
    def n_levels(self) -> int:
        return len(self.schedule.blur)


PRESETS: dict[str, FairingOptions] = {
    "accurate": FairingOptions(),
    "paper": FairingOptions(
        cells=CellOptions(
            warp="affine",
            size=(128,),
            adaptive=False,
            inset=(0.0,),
            interpolation=("bilinear",),
            point_spread=("as_seen",),
            weighting="cell",
        ),
        eigenspace=EigenspaceOptions(dimensions=(5,), significance=(0.0,)),
        robust=RobustOptions(sigma_rule=("paper",)),
        step=StepOptions(solver="alternating", prior=0.0, smoothing=(0.0,), points=(0.0,)),
        schedule=ScheduleOptions(
            blur=(6.0, 4.8, 3.6, 2.4, 1.2),
            start="first",
            search=(0.0,),
            order="sequential",
            max_sweeps=(10,),
            max_iterations=(20,),
        ),
    ),
}


def options_to_dict(options: FairingOptions) -> dict[str, Any]:
    """Plain numbers, strings and lists, for JSON."""
    return asdict(options)


def options_from_dict(values: dict[str, Any]) -> FairingOptions:
    """The inverse of `options_to_dict`; unknown names raise InputError."""
    return _from_dict(FairingOptions(), values, "options")


def _from_dict(default: Any, values: dict[str, Any], where: str) -> Any:
    if not isinstance(values, dict):
        raise InputError(f"{where}: expected options by name, found {values!r:.60}")
    known = {f.name for f in fields(default)}
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
        else:
            changes[name] = tuple(value) if isinstance(current, tuple) else value
    return replace(default, **changes)
