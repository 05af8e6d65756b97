"""How the surface is shown: plain, painted, coloured; before, now or as it truly is."""

from collections.abc import Callable

import viser

from app.debugger.run_state import RunState
from app.page_state.page_state import NOW_SHAPE, START_SHAPE, SURFACES, TRUE_SHAPE, PageState
from app.panels.choice import choice
from app.pictures.coloring import COLORINGS, available_colorings
from app.pictures.texturer import MOST_FACES, MOST_FACES_VIEW_DEPENDENT
from app.viser_bridge.html_panel import HtmlPanel
from app.viser_bridge.synced_widget import Followed
from fairing.errors import InputError
from fairing.scene import Scene

SHAPES = {START_SHAPE: "Start", NOW_SHAPE: "Now", TRUE_SHAPE: "Truth"}
TEXTURES = {False: "Static", True: "By the eye"}
STEP = 0.05


class SurfaceButtons:
    """What a click on the panel does."""

    def __init__(
        self,
        scene: Scene,
        view: PageState,
        button: Callable[[Callable[[], None]], str],
        republish: Callable[[], None],
    ) -> None:
        self._view, self._republish = view, republish
        has_truth = scene.truth is not None and scene.truth.vertices is not None
        self.last_shape = TRUE_SHAPE if has_truth else NOW_SHAPE
        self.press_surface = {
            name: button(lambda name=name: self.choose_surface(name))
            for name in (*SURFACES, *available_colorings(scene))
        }
        self.press_texture = {by_eye: button(lambda by_eye=by_eye: self.choose_texture(by_eye)) for by_eye in TEXTURES}
        self.press_shape = {
            shape: button(lambda shape=shape: self.choose_shape(shape)) for shape in SHAPES if shape <= self.last_shape
        }

    def choose_surface(self, name: str) -> None:
        self._view.surface = name
        self._republish()

    def choose_texture(self, by_eye: bool) -> None:
        """One image, or one that blends the photos taken near the eye; either way the surface is textured."""
        self._view.by_eye, self._view.surface = by_eye, "textured"
        self._republish()

    def static_or_by_eye(self) -> None:
        self.choose_texture(not self._view.by_eye)

    def choose_shape(self, shape: object) -> None:
        """0 to 2, see `PageState.shape`.

        Raises:
            InputError: it is something else.
        """
        if isinstance(shape, bool) or not isinstance(shape, int | float) or not 0 <= shape <= self.last_shape:
            raise InputError(f"shape: expected a number from 0 to {self.last_shape:g}")
        self._view.shape = round(float(shape), 3)
        self._republish()

    def before_or_now(self) -> None:
        """From now to the start, from anything else to now."""
        self.choose_shape(START_SHAPE if self._view.shape == NOW_SHAPE else NOW_SHAPE)


class SurfacePanel:
    """Rows of buttons of which one is down, and a slider through the shapes."""

    def __init__(
        self,
        gui: viser.GuiApi,
        n_faces: int,
        buttons: SurfaceButtons,
        guarded: Callable[[Callable[..., None]], Callable[..., None]],
    ) -> None:
        self._buttons, self._note = buttons, limit_note(n_faces)
        self._panel = HtmlPanel(gui)
        slider = gui.add_slider(
            "Shape",
            min=START_SHAPE,
            max=buttons.last_shape,
            step=STEP,
            initial_value=NOW_SHAPE,
            hint="Moves the surface from where it began to where it is now, and on to the truth where that is known.",
        )
        self._followed = Followed(slider, guarded(buttons.choose_shape))

    def show(self, state: RunState, page_state: PageState) -> None:
        press = self._buttons.press_surface
        how = choice({name: (label, press[name]) for name, label in SURFACES.items()}, page_state.surface, "Surface")
        textures = {by_eye: (TEXTURES[by_eye], js) for by_eye, js in self._buttons.press_texture.items()}
        texture = page_state.by_eye if page_state.surface == "textured" else None
        colors = {name: (COLORINGS[name].label, press[name]) for name in press if name in COLORINGS}
        shapes = {shape: (SHAPES[shape], js) for shape, js in self._buttons.press_shape.items()}
        self._panel.set(
            f"<h4>Surface</h4>{how}<div class='dim note'>texture</div>{choice(textures, texture, 'Texture')}{self._note}"
            f"<div class='dim note'>coloured by</div>{choice(colors, page_state.surface, 'Coloured by')}"
            f"<div class='dim note'>as it is</div>{choice(shapes, page_state.shape, 'Shape')}"
        )
        self._followed.follow(page_state.shape)


def limit_note(n_faces: int) -> str:
    """Which texture a mesh of so many faces is too fine for, if any."""
    if n_faces > MOST_FACES:
        what, most = "Textures hold", MOST_FACES
    elif n_faces > MOST_FACES_VIEW_DEPENDENT:
        what, most = "A texture by the eye holds", MOST_FACES_VIEW_DEPENDENT
    else:
        return ""
    return f"<div class='note'>{what} at most {most:,} faces; this mesh has {n_faces:,}.</div>".replace(",", "\u2009")
