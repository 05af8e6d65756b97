"""Palette entries without keys: layers, surfaces, plots, columns, presets, options, exports and scenes, by their words."""

from collections.abc import Callable, Iterable
from dataclasses import replace

import viser

from app.debugger.commands import Restart
from app.debugger.controller import Controller
from app.debugger.option_fields import option_fields
from app.debugger.series import QUANTITIES, RESIDUAL
from app.lessons.scenes import LESSON_SCENES
from app.page.page_frame import Hotkey
from app.page.sharing import SHARE_KINDS
from app.page_state.cells_state import HEADS, KINDS
from app.page_state.page_state import LAYERS, SURFACES, PageState
from app.panels.layers_panel import available_layers
from app.pictures.coloring import COLORINGS, available_colorings
from app.viser_bridge.tabs import show_field, show_tab
from fairing.options import PRESETS
from fairing.scene import Scene


def view_entries(
    client: viser.ClientHandle, scene: Scene, page_state: PageState, republish: Callable[[], None]
) -> Iterable[Hotkey]:
    """What is shown: layers, surfaces, plots and the columns of the cells."""

    def toggle(name: str) -> None:
        page_state.shown[name] = not page_state.shown[name]
        republish()

    def paint(name: str) -> None:
        page_state.surface = name
        republish()

    def plot(name: str) -> None:
        page_state.plot = replace(page_state.plot, name=name, is_log=None)
        republish()

    def toggle_column(kind: str) -> None:
        page_state.cells = replace(page_state.cells.toggled(kind), page="cells")
        show_tab(client, "Cells")
        republish()

    for name in available_layers(scene):
        yield Hotkey(f"Layer: {LAYERS[name].lower()}, show or hide", lambda name=name: toggle(name))
    for name, label in SURFACES.items():
        yield Hotkey(f"Surface: {label.lower()}", lambda name=name: paint(name))
    for name in available_colorings(scene):
        coloring = COLORINGS[name]
        title = "" if coloring.title.lower() == coloring.label.lower() else f" ({_begun_small(coloring.title)})"
        yield Hotkey(f"Surface coloured by {_begun_small(coloring.label)}{title}", lambda name=name: paint(name))
    yield Hotkey("Plot: residual at the finest level", lambda: plot(RESIDUAL))
    for name, quantity in QUANTITIES.items():
        yield Hotkey(f"Plot: {quantity.title}", lambda name=name: plot(name))
    for kind, meaning in KINDS.items():
        words = _begun_small(meaning.split(":")[0].split(",")[0])
        yield Hotkey(f"Column of the cells: {words} ({HEADS[kind]})", lambda kind=kind: toggle_column(kind))


def option_entries(client: viser.ClientHandle, controller: Controller, compare: Callable[[], None]) -> Iterable[Hotkey]:
    """Presets, each in a new run, and the place of every option."""

    def start_over(name: str) -> None:
        options = replace(PRESETS[name], locked_vertices=controller.state.options.locked_vertices)
        controller.post(Restart(options))

    def show(folder: str, label: str) -> None:
        show_tab(client, "Options")
        show_field(client, folder, label)

    for name in PRESETS:
        yield Hotkey(f"Preset: {name}, start over with it", lambda name=name: start_over(name))
    yield Hotkey("Preset: compare both presets", compare)
    for field in option_fields():
        folder = field.group.capitalize()
        yield Hotkey(
            f"Option: {field.label} ({field.group})", lambda folder=folder, label=field.label: show(folder, label)
        )


def export_entries(show_result: Callable[[], None], make: Callable[[str], None]) -> Iterable[Hotkey]:
    """The result of the run, and the files that can be made of it."""
    yield Hotkey("Result of the run", show_result)
    for name, kind in SHARE_KINDS.items():
        yield Hotkey(f"Export: {kind.title.lower()} ({kind.ending})", lambda name=name: make(name))


def scene_entries(open_scene: Callable[[str], None]) -> Iterable[Hotkey]:
    """The demo scenes of the lessons."""
    for name, scene in LESSON_SCENES.items():
        yield Hotkey(f"Scene: {scene.title.removeprefix('the ')} ({name})", lambda name=name: open_scene(name))


def _begun_small(words: str) -> str:
    """With a small first letter, unless the word is a name or a symbol."""
    return words[:1].lower() + words[1:] if words[1:2].islower() else words
