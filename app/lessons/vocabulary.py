"""Vocabulary of lesson actions, one action per line. Lessons can do nothing else.

start accurate as main: locked_vertices=1,2     a named run from the start, with options
start accurate as far, vertex 0 off 0.2 0 0: ...                  the same, with vertices at offsets from their true positions
go on as sharp: eigenspace.dimensions=1                           a branch from the current moment with other options
put vertex 0 off 0.2 0 0                                          place a vertex manually
step 3 iterations | step one vertex | step one sweep | step one stage | step one level
run to the end | run until level == 2
go to start | go to end | go to moment 12
race paper as a against accurate as b: locked_vertices=1,2        two alternating runs; the options apply to both
take main | take main at start | take main at end                 switch to an existing run
select vertex 0 | select vertices 3, 0 | select nothing           the last one becomes the current vertex
face 2
look at mesh | look at front | look at cameras | look through photo 3
show truth, start | hide cameras                                  layers
surface flat | shape truth | magnify 10                           surface and its vertices; magnification of paths
page cells | columns photo, weight | k 5 | k own | arrows 30 | pair 1 8 | crops path     the cells
plot residual | plot step of the vertex
compare with a | compare with nothing
tab Runs
"""

import re
from collections.abc import Callable
from dataclasses import replace

from app.debugger.commands import Command, Extent, Forward, JumpTo, Run
from app.debugger.option_fields import changed_options, option_fields
from app.debugger.quantities import parse_step_condition
from app.debugger.series import QUANTITIES, RESIDUAL
from app.lessons.engine_actions import (
    Advance,
    Changes,
    Continue,
    EngineAction,
    PlaceVertex,
    RacedRuns,
    StartRun,
    SwitchRun,
)
from app.lessons.page_settings import AT_CAMERAS, AT_FRONT, AT_MESH, SettingsChange
from app.page_state.cells_state import ARROW_SCALES, KINDS, PAGES, SPANS
from app.page_state.page_state import LAYERS, MAX_MAGNIFICATION, NOW_SHAPE, START_SHAPE, SURFACES, TRUE_SHAPE, PlotView
from app.pictures.coloring import COLORINGS
from fairing.errors import InputError
from fairing.experiments import experiments
from fairing.option_check import check_options
from fairing.options import PRESETS, FairingOptions

MAX_STEPS_AT_ONCE = 100
EXTENTS = {
    "iteration": Extent.ITERATION,
    "vertex": Extent.BLOCK,
    "sweep": Extent.SWEEP,
    "stage": Extent.STAGE,
    "level": Extent.LEVEL,
}
SHAPES = {"start": START_SHAPE, "now": NOW_SHAPE, "truth": TRUE_SHAPE}
TABS = ("Vertex", "Breakpoints", "Layers", "Options", "Cells", "Experiments", "Timeline", "Runs", "Bookmarks")
HEADINGS = {"cells": "Cells by photo", "basis": "Basis images"}
_NUMBER = r"-?\d+(?:\.\d+)?"
_PUT_SHAPE = rf"vertex \d+ off {_NUMBER} {_NUMBER} {_NUMBER}"
_PUT = rf"vertex (\d+) off ({_NUMBER}) ({_NUMBER}) ({_NUMBER})"

Action = EngineAction | SettingsChange


def understand_action(line: str, names: set[str]) -> Action:
    """The action of one line.

    Args:
        names: of the lesson's runs so far; a line that starts a run adds its name.

    Raises:
        InputError: the line is not in the vocabulary.
    """
    for pattern, read in _ACTIONS:
        found = re.fullmatch(pattern, line.strip())
        if found:
            return read(found, names)
    raise InputError(f"expected an action such as {', '.join(_EXAMPLES)}; found {line!r:.80}")


# ---------------------------------------------------------------------- the engine


def _start(found: re.Match, names: set[str]) -> EngineAction:
    names.add(found["name"])
    puts = tuple(_put_of(put) for put in re.finditer(_PUT, found["puts"]))
    return StartRun(found["name"], _options(found["preset"], found["options"]), puts)


def _options(preset: str, written: str | None) -> FairingOptions:
    options = changed_options(PRESETS[_one_of(preset, PRESETS, "preset")], dict(read_changes(written)))
    check_options(options)
    return options


def read_changes(written: str | None) -> Changes:
    """The changed options of a text such as `step.points=0 step.creases=0`.

    Raises:
        InputError: there is no such option or value.
    """
    fields = {option.name: option for option in option_fields()}
    changes = []
    for piece in (written or "").split():
        name, _, value = piece.partition("=")
        option = fields[_one_of(name, fields, "option")]
        if option.kind == "switch":
            changes.append((option.path, _one_of(value, ("on", "off"), name) == "on"))
        else:
            changes.append((option.path, option.read(value)))
    return tuple(changes)


def _go_on(found: re.Match, names: set[str]) -> EngineAction:
    names.add(found["name"])
    return Continue(found["name"], read_changes(found["options"]))


def _put_of(found: re.Match) -> PlaceVertex:
    x, y, z = (float(part) for part in found.groups()[1:])
    return PlaceVertex(int(found[1]), (x, y, z))


def _step(found: re.Match, _: set[str]) -> EngineAction:
    times = 1 if found[1] == "one" else int(found[1])
    if not 1 <= times <= MAX_STEPS_AT_ONCE:
        raise InputError(f"step: expected 1 to {MAX_STEPS_AT_ONCE}, found {times}")
    unit = {"vertices": "vertex"}.get(found[2], found[2].removesuffix("s"))
    return Advance((Forward(EXTENTS[_one_of(unit, EXTENTS, "step")]),) * times)


def _go_to(found: re.Match, _: set[str]) -> EngineAction:
    command: Command = JumpTo({"start": 0, "end": -1}[found[1]] if found[2] is None else int(found[2]))
    return Advance((command,))


def _race(found: re.Match, names: set[str]) -> EngineAction:
    names |= {found["first"], found["second"]}
    first, second = (_options(found[key], found["options"]) for key in ("preset1", "preset2"))
    return RacedRuns(StartRun(found["first"], first), StartRun(found["second"], second))


def _take(found: re.Match, names: set[str]) -> EngineAction:
    moment = {None: None, "start": 0, "end": -1}[found[2]]
    return SwitchRun(_one_of(found[1], names, "run"), moment)


# ---------------------------------------------------------------------- the page


def _select(found: re.Match, _: set[str]) -> SettingsChange:
    vertices = tuple(int(part) for part in re.findall(r"\d+", found[0]))
    return lambda page: replace(page, vertices=vertices)


def _look(found: re.Match, _: set[str]) -> SettingsChange:
    eye = int(found[2]) - 1 if found[2] else {"mesh": AT_MESH, "front": AT_FRONT, "cameras": AT_CAMERAS}[found[1]]
    return lambda page: replace(page, eye=eye)


def _layers(found: re.Match, _: set[str]) -> SettingsChange:
    wanted = {_one_of(name, LAYERS, "layer"): found[1] == "show" for name in _listed(found[2])}
    return lambda page: replace(page, layers=page.layers | wanted)


def _setting(name: str, value: object) -> SettingsChange:
    return lambda page: replace(page, settings=page.settings | {name: value})


def _cells(name: str, value: object) -> SettingsChange:
    return lambda page: replace(page, cells=page.cells | {name: value})


def _surface(found: re.Match, _: set[str]) -> SettingsChange:
    return _setting("surface", _one_of(found[1], {**SURFACES, **COLORINGS}, "surface"))


def _magnify(found: re.Match, _: set[str]) -> SettingsChange:
    times = int(found[1])
    if not 1 <= times <= MAX_MAGNIFICATION:
        raise InputError(f"magnify: expected 1 to {MAX_MAGNIFICATION}, found {times}")
    return _setting("magnification", float(times))


def _columns(found: re.Match, _: set[str]) -> SettingsChange:
    chosen = {_one_of(name, KINDS, "column") for name in _listed(found[1])}
    return _cells("columns", tuple(kind for kind in KINDS if kind in chosen))


def _arrows(found: re.Match, _: set[str]) -> SettingsChange:
    return _cells("arrow_scale", int(_one_of(found[1], [str(scale) for scale in ARROW_SCALES], "arrows")))


def _plot(found: re.Match, _: set[str]) -> SettingsChange:
    return _setting(
        "plot", PlotView(_one_of(found[1], (RESIDUAL, *QUANTITIES), "plot"), of_vertex=found[2] is not None)
    )


def _compare(found: re.Match, names: set[str]) -> SettingsChange:
    compared = "" if found[1] == "nothing" else _one_of(found[1], names, "run")
    return lambda page: replace(page, compared=compared)


def _tab(found: re.Match, _: set[str]) -> SettingsChange:
    tab = _one_of(found[1], TABS, "tab")
    return lambda page: replace(page, tab=tab)


def _scroll(found: re.Match, _: set[str]) -> SettingsChange:
    heading = HEADINGS[_one_of(found[1], HEADINGS, "scroll")]
    return lambda page: replace(page, heading=heading)


def _listed(written: str) -> list[str]:
    return [part.strip() for part in written.split(",")]


def _one_of(found: str | None, known: object, what: str) -> str:
    names = [str(name) for name in known]  # pyright: ignore[reportGeneralTypeIssues] - any collection of names
    if found is None or found not in names:
        raise InputError(f"{what}: expected one of {', '.join(sorted(names))}; found {found!r:.40}")
    return found


_OPTIONS = r"(?:: *(?P<options>.+))?"
_ACTIONS: list[tuple[str, Callable[[re.Match, set[str]], Action]]] = [
    (rf"start (?P<preset>\w+) as (?P<name>\w+)(?P<puts>(?:, {_PUT_SHAPE})*){_OPTIONS}", _start),
    (rf"go on as (?P<name>\w+){_OPTIONS}", _go_on),
    (rf"put {_PUT}", lambda found, _: _put_of(found)),
    (r"step (one|\d{1,3}) (\w+)", _step),
    (r"run to the end", lambda found, _: Advance((Run(),))),
    (r"run until (.+)", lambda found, _: Advance((Run(parse_step_condition(found[1])),))),
    (r"go to (?:(start|end)|moment (\d{1,6}))", _go_to),
    (
        r"race (?P<preset1>\w+) as (?P<first>\w+) against (?P<preset2>\w+) as (?P<second>\w+)" + _OPTIONS,
        _race,
    ),
    (r"take (\w+)(?: at (start|end))?", _take),
    (r"select (?:nothing|vertex \d+|vertices \d+(?:, *\d+)*)", _select),
    (r"face (\d+)", lambda found, _: lambda page: replace(page, face=int(found[1]))),
    (r"look (?:at (mesh|front|cameras)|through photo ([1-9]\d*))", _look),
    (r"(show|hide) (.+)", _layers),
    (r"surface (\w+)", _surface),
    (r"shape (start|now|truth)", lambda found, _: _setting("shape", SHAPES[found[1]])),
    (r"magnify (\d+)", _magnify),
    (r"page (\w+)", lambda found, _: _cells("page", _one_of(found[1], PAGES, "page"))),
    (r"columns (.+)", _columns),
    (r"k (own|\d+)", lambda found, _: _cells("dimensions", None if found[1] == "own" else int(found[1]))),
    (r"arrows (\d+)", _arrows),
    (r"pair ([1-9]\d*) ([1-9]\d*)", lambda found, _: _cells("pair", (int(found[1]) - 1, int(found[2]) - 1))),
    (r"crops (\w+)", lambda found, _: _cells("span", _one_of(found[1], SPANS, "crops"))),
    (r"scroll to (\w+)", _scroll),
    (r"plot (\w+)( of the vertex)?", _plot),
    (r"compare with (\w+)", _compare),
    (r"experiment ([\w-]+)", lambda found, _: _setting("experiment", _one_of(found[1], experiments(), "experiment"))),
    (r"tab (\w+)", _tab),
]
_EXAMPLES = ("'start accurate as main'", "'step one sweep'", "'select vertex 0'", "'look at mesh'")
