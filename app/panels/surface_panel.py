"""Surface panel: plain, textured or coloured surface, with its vertices at the start, now or at the truth."""

from collections.abc import Callable

import viser

from app.debugger.run_state import RunState
from app.html import button, icon, photo_title, text
from app.page_state.page_state import (
    FLOW_SCALES,
    MANY_SAMPLED,
    NOW_SHAPE,
    START_SHAPE,
    SURFACES,
    TRUE_SHAPE,
    PageState,
)
from app.panels.choice import arrow_scales, choice
from app.pictures.coloring import COLORINGS, PULL, available_colorings
from app.pictures.texturer import MOST_FACES, MOST_FACES_VIEW_DEPENDENT
from app.viser_bridge.html_events import Guarded, HtmlEvents, choice_of, integer, press
from app.viser_bridge.html_panel import HtmlPanel
from app.viser_bridge.synced_widget import SyncedSlider
from fairing.errors import InputError
from fairing.run.recorded_terms import term_meanings
from fairing.scene import Scene
from fairing.terms.names import TERMS

SHAPES = {START_SHAPE: "Start", NOW_SHAPE: "Now", TRUE_SHAPE: "Truth"}
TEXTURES = {False: "Static", True: "View-dependent"}
DETAILS = {False: "Per face", True: "Per pixel"}
DETAIL_HINTS = {
    "residual": {
        False: "one mean for each face",
        True: "at every sample of the cells: shows where in a face the photos disagree",
    },
    "flow": {
        False: "one vector for each face and photo, with arrows",
        True: "at every sample of the cells, in one photo: all photos together have no direction",
    },
}
STEP = 0.05


class SurfaceControls:
    """What a user can change about the surface; the choices as (label, JavaScript) by value."""

    def __init__(
        self, html_events: HtmlEvents, scene: Scene, page_state: PageState, republish: Callable[[], None]
    ) -> None:
        self._page_state, self._scene, self._republish = page_state, scene, republish
        self._terms = list(TERMS)  # those that are offered
        has_truth = scene.truth is not None and scene.truth.vertices is not None
        self.last_shape = TRUE_SHAPE if has_truth else NOW_SHAPE
        self._colorings = available_colorings(scene)
        self._surfaces = (*SURFACES, *self._colorings)
        self.has_detail = len(scene.mesh.vertices) <= MANY_SAMPLED
        self._shapes = [shape for shape in SHAPES if shape <= self.last_shape]
        self._events = html_events.named(
            {
                "surface": choice_of(self.choose_surface, lambda: self._surfaces, "surface"),
                "texture": choice_of(self.choose_texture, lambda: list(TEXTURES), "texture"),
                "detail": choice_of(self._choose_detail, lambda: list(DETAILS), "detail"),
                "divider": press(self.toggle_divider),
                "shape": choice_of(self.choose_shape, lambda: self._shapes, "shape"),
                "photo": integer(self._choose_photo, "photo", -1, len(scene.views) - 1),
                "term": choice_of(self._choose_term, lambda: self._terms, "term"),
                "scale": choice_of(self._choose_scale, lambda: list(FLOW_SCALES), "arrow length"),
            }
        )

    def surfaces(self) -> dict[str, tuple[str, str]]:
        return {name: (label, self._events("surface", k)) for k, (name, label) in enumerate(SURFACES.items())}

    def textures(self) -> dict[bool, tuple[str, str]]:
        return {
            is_view_dependent: (label, self._events("texture", k))
            for k, (is_view_dependent, label) in enumerate(TEXTURES.items())
        }

    def colorings(self) -> dict[str, tuple[str, str]]:
        numbers = {name: k for k, name in enumerate(self._surfaces)}
        return {name: (COLORINGS[name].label, self._events("surface", numbers[name])) for name in self._colorings}

    def shapes(self) -> dict[float, tuple[str, str]]:
        return {shape: (SHAPES[shape], self._events("shape", k)) for k, shape in enumerate(self._shapes)}

    def divider(self) -> str:
        """Markup of the button that switches the divider between start and now."""
        return button(
            "Before and now",
            self._events("divider"),
            hint="Start and current moment, textured, or by residual or flow per pixel, with a divider to drag",
            css_class="small on" if self._page_state.shows_divider else "small",
            pressed=self._page_state.shows_divider,
        )

    def photos(self) -> str:
        """Markup of a control that selects the photo whose residuals or flow are shown, or all photos; else empty."""
        state, last = self._page_state, len(self._scene.views) - 1
        if state.surface not in self._colorings or COLORINGS[state.surface].of_photo is None:
            return ""
        view = -1 if state.residual_view is None else state.residual_view
        name = "All photos" if view < 0 else photo_title(view, self._scene.views[view].name)
        previous, following = (
            button("", self._events("photo", at), hint=hint, icon=icon("one", mirrored=hint.startswith("Previous")),
                   css_class="small", enabled=view != at)
            for at, hint in ((view - 1 if view >= 0 else last, "Previous photo"),
                             (view + 1 if view < last else -1, "Next photo"))
        )  # fmt: skip
        scales = {scale: (label, self._events("scale", k)) for k, (scale, label) in enumerate(FLOW_SCALES.items())}
        has_arrows = state.surface == "flow" and not state.shows_texels
        arrows = arrow_scales(choice(scales, state.flow_scale, "Arrows"))
        return (
            f"<div class='dim note'>of the photo</div><div class='row'>{previous}<span class='grow one' "
            f"style='text-align:center'>{text(name)}</span>{following}</div>{arrows if has_arrows else ''}"
        )

    def detail(self) -> str:
        """Markup of a control that selects residuals or flow per face or per pixel; else empty."""
        state = self._page_state
        if state.surface not in DETAIL_HINTS or not self.has_detail:
            return ""
        options = {
            per_pixel: (label, self._events("detail", k)) for k, (per_pixel, label) in enumerate(DETAILS.items())
        }
        details = choice(options, state.shows_texels, "Detail", DETAIL_HINTS[state.surface])
        return f"<div class='dim note'>detail</div>{details}"

    def terms(self, state: RunState) -> str:
        """Markup of a control that selects the term of the run whose pull is shown; else empty."""
        if self._page_state.surface != PULL:
            return ""
        self._terms = list(term_meanings(state.trace))
        terms = {name: (name.capitalize(), self._events("term", k)) for k, name in enumerate(self._terms)}
        return f"<div class='dim note'>of the term</div>{choice(terms, self._page_state.pull_term, 'Term')}"

    def _choose_detail(self, is_per_pixel: bool) -> None:
        """Per pixel, the flow is that of one photo: the first one if none is chosen."""
        state = self._page_state
        state.is_per_pixel = is_per_pixel
        if is_per_pixel and state.surface == "flow" and state.residual_view is None:
            state.residual_view = 0
        self._republish()

    def toggle_per_pixel(self, surface: str) -> None:
        """Residuals or flow per pixel, or per face if they are shown per pixel already."""
        state = self._page_state
        is_shown = state.surface == surface and state.shows_texels
        state.surface = surface
        self._choose_detail(not is_shown)

    def _choose_term(self, term: str) -> None:
        self._page_state.pull_term = term
        self._republish()

    def _choose_photo(self, view: int) -> None:
        self._page_state.residual_view = None if view < 0 else view
        self._republish()

    def _choose_scale(self, scale: int) -> None:
        self._page_state.flow_scale = scale
        self._republish()

    def choose_surface(self, name: str) -> None:
        self._page_state.surface = name
        self._republish()

    def choose_texture(self, is_view_dependent: bool) -> None:
        """One image, or one that blends the photos taken near the eye; either way the surface is textured."""
        self._page_state.is_view_dependent, self._page_state.surface = is_view_dependent, "textured"
        self._republish()

    def toggle_view_dependent(self) -> None:
        self.choose_texture(not self._page_state.is_view_dependent)

    def choose_shape(self, shape: object) -> None:
        """0 to 2, see `PageState.shape`.

        Raises:
            InputError: it is something else.
        """
        if isinstance(shape, bool) or not isinstance(shape, int | float) or not 0 <= shape <= self.last_shape:
            raise InputError(f"shape: expected a number from 0 to {self.last_shape:g}")
        self._page_state.shape = round(float(shape), 3)
        self._republish()

    def toggle_divider(self) -> None:
        """Show the start at the left of a divider and now at its right, textured or coloured per pixel; or now alone."""
        state = self._page_state
        state.is_divided = not state.shows_divider
        if state.is_divided:
            state.shape = NOW_SHAPE
            if not state.shows_texels:
                state.surface = "textured"
        self._republish()

    def before_or_now(self) -> None:
        """From now to the start, from anything else to now."""
        self.choose_shape(START_SHAPE if self._page_state.shape == NOW_SHAPE else NOW_SHAPE)


class SurfacePanel:
    """Segmented controls, and a slider that moves the surface between start, now and truth."""

    def __init__(
        self,
        gui: viser.GuiApi,
        n_faces: int,
        controls: SurfaceControls,
        guarded: Guarded,
    ) -> None:
        self._controls, self._note = controls, limit_note(n_faces)
        self._panel = HtmlPanel(gui)
        slider = gui.add_slider(
            f"Start – {SHAPES[controls.last_shape].lower()}",
            min=START_SHAPE,
            max=controls.last_shape,
            step=STEP,
            initial_value=NOW_SHAPE,
            hint="Moves the surface from its start through the current moment to the truth, if that is known.",
        )
        self._followed = SyncedSlider(slider, guarded(controls.choose_shape))

    def show(self, state: RunState, page_state: PageState) -> None:
        controls = self._controls
        how = choice(controls.surfaces(), page_state.surface, "Surface")
        texture = page_state.is_view_dependent if page_state.surface == "textured" else None
        textures = choice(controls.textures(), texture, "Texture")
        colorings = choice(controls.colorings(), page_state.surface, "Coloured by")
        shapes = choice(controls.shapes(), page_state.shape, "Vertices at")
        self._panel.set(
            f"<h4>Surface</h4>{how}<div class='dim note'>texture</div>{textures}{self._note}"
            f"<div class='dim note'>coloured by</div>{colorings}{controls.detail()}{controls.photos()}{controls.terms(state)}"
            f"<div class='dim note'>vertices at</div>{shapes}"
            f"<div class='row note'>{controls.divider()}</div>"
        )
        self._followed.follow(page_state.shape)


def limit_note(n_faces: int) -> str:
    """A note that the mesh has too many faces for a texture; empty if it has not."""
    if n_faces > MOST_FACES:
        what, most = "Textures hold", MOST_FACES
    elif n_faces > MOST_FACES_VIEW_DEPENDENT:
        what, most = "A view-dependent texture holds", MOST_FACES_VIEW_DEPENDENT
    else:
        return ""
    return f"<div class='note'>{what} at most {most:,} faces; this mesh has {n_faces:,}.</div>".replace(",", "\u2009")
