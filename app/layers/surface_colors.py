"""Surface colours: the mesh coloured by a quantity, with its legend, and with the divider the start in the same colours."""

from dataclasses import dataclass, replace

import numpy as np
import viser

from app.debugger.commands import Query
from app.debugger.compare import distances, look_up
from app.debugger.controller import Controller
from app.debugger.run_state import RunState
from app.layers.surface_texels import PaintedTexels, SurfaceTexels
from app.page_state.page_state import PageState
from app.page_state.pull_source import PullSource
from app.page_state.residual_source import ResidualSource, flow_scale
from app.pictures.coloring import COLORINGS, DIFFERENCE, PER_PIXEL, PULL, Legend, color_mesh
from app.pictures.texel_picture import TexelPicture
from app.pictures.texturer import LARGEST, Texturer
from app.stage import Stage
from app.surface_offset import set_back
from app.viser_bridge.mesh_swap import DECODE_SECONDS, DoubleBufferedMesh, GlbMesh
from fairing.io.glb import write_glb
from fairing.run.recorded_terms import term_meanings
from fairing.scene import Scene
from fairing.trace import Trace

DECODE_COLORED = 0.25  # s: without a large texture


@dataclass(frozen=True)
class Wanted:
    """Key of a surface colouring: run, moment, quantity, the reference (run, moment) it is compared with, photo and term, whether
    it is by pixel, and whether with the start beside it."""

    run_id: int
    moment: int
    coloring: str
    reference: tuple[int, int] | None
    view: int | None = None
    term: str | None = None
    is_per_pixel: bool = False
    is_divided: bool = False

    @property
    def title(self) -> str:
        """Title of the legend."""
        return (PER_PIXEL if self.is_per_pixel else COLORINGS)[self.coloring].title


class SurfaceColors:
    """Two meshes in the 3D view: now, and the start for the left of the divider.

    The colours shown last stay until those of another quantity, photo or moment are computed.

    Attributes:
        now, start: the nodes.
        legend: of the colours shown; None if there are none.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        stage: Stage,
        scene: Scene,
        texturer: Texturer,
        controller: Controller,
        residuals: ResidualSource,
        pulls: PullSource,
    ) -> None:
        self._stage, self._scene, self._controller = stage, scene, controller
        self._residuals, self._pulls = residuals, pulls
        self._texels = SurfaceTexels(residuals, texturer, controller)
        self.now, self.start = (
            DoubleBufferedMesh(client, f"/mesh/{name}", controller.republish, DECODE_COLORED)
            for name in ("colored", "colored_start")
        )
        self._wanted: Wanted | None = None
        self._answer: tuple[Wanted, np.ndarray | PaintedTexels | Exception] | None = None
        self._drawn: tuple[Wanted, np.ndarray, Legend] | None = None
        self.legend: Legend | None = None

    @property
    def before(self) -> DoubleBufferedMesh | None:
        """The nodes of the start in the colours of now; None unless they can be shown at the left of the divider."""
        is_drawn = self._drawn is not None and self._drawn[0].is_divided
        return self.start if is_drawn and self.start.shown is not None else None

    def show(
        self, state: RunState, page_state: PageState, vertices: np.ndarray, resting: bool
    ) -> DoubleBufferedMesh | None:
        """Colour the surface with its vertices at positions (n, 3), world units.

        Args:
            resting: whether the engine is paused.

        Returns:
            The nodes to show; None before the first colours.
        """
        name = page_state.surface
        compared = look_up(page_state.reference, state) if name == DIFFERENCE else None
        wanted = Wanted(
            state.run_id,
            state.moment,
            name,
            None if compared is None else (compared.run.run_id, compared.moment),
            page_state.residual_view if COLORINGS[name].of_photo is not None else None,
            page_state.pull_term if name == PULL else None,
            page_state.shows_texels,
            page_state.shows_texels and page_state.shows_divider,
        )
        if wanted != self._wanted:
            self._look_up(wanted, state, page_state, resting)
        if self._answer is not None and self._answer[0] == wanted and not isinstance(self._answer[1], Exception):
            self._draw(wanted, self._answer[1], vertices, state.trace)
        if self._drawn is not None:
            drawn, _, legend = self._drawn
            self.legend = replace(
                legend,
                note=self._note(drawn, state, page_state),
                why_unknown=_why_unknown(drawn),
                moment=None if drawn.moment == wanted.moment else drawn.moment,
                awaited=self._awaited(drawn, wanted),
            )
        return self.now if self.now.shown is not None else None

    def clear(self) -> None:
        """Hide the colours, which are out of date."""
        for mesh in (self.now, self.start):
            mesh.clear()
        self._wanted = self._drawn = self.legend = None

    def close(self) -> None:
        for mesh in (self.now, self.start):
            mesh.close()

    def _look_up(self, wanted: Wanted, state: RunState, page_state: PageState, resting: bool) -> None:
        """Take the values if they are known, else have them computed."""
        coloring, found = COLORINGS[wanted.coloring], None
        if wanted.is_per_pixel:
            found = self._texels.at(state, page_state)
        elif coloring.of_photo is not None:
            residuals = self._residuals.at(state, page_state)
            found = None if residuals is None else coloring.of_photo(residuals, wanted.view)
        elif coloring.of_pulls is not None:
            pulls = self._pulls.at(state)
            if pulls is not None:
                found = pulls if isinstance(pulls, Exception) else coloring.of_pulls(pulls, page_state.pull_term)
        elif resting:
            self._wanted = wanted
            compared = look_up(page_state.reference, state) if wanted.reference is not None else None
            if compared is None:
                self._query(wanted)
            else:
                found = 100 * distances(compared, state.vertices) / self._scene.mesh.diagonal
        if found is not None:
            self._wanted = wanted
            self._take(wanted, found)

    def _query(self, wanted: Wanted) -> None:
        self._controller.post(
            Query(
                key=(id(self), "colors"),
                compute=lambda session: COLORINGS[wanted.coloring].values(session, session.moment),
                callback=lambda found: self._take(wanted, found),
            )
        )

    def _draw(self, wanted: Wanted, values: np.ndarray | PaintedTexels, vertices: np.ndarray, trace: Trace) -> None:
        """Args:
        vertices: (n, 3), world units: where the mesh is drawn.
        """
        if self._drawn is not None and self._drawn[0] == wanted and self._drawn[1] is vertices:
            return
        if isinstance(values, PaintedTexels):
            self._drawn = (wanted, vertices, values.legend)
            for mesh, picture, at in ((self.now, values.now, vertices), (self.start, values.start, trace.start)):
                if picture is not None:
                    mesh.seconds = DECODE_SECONDS * max(1.0, picture.texels / LARGEST**2)
                    mesh.offer(self._textured(picture, at))
        else:
            points = set_back(vertices, self._scene, self._stage)
            faces, terms = self._scene.mesh.faces, term_meanings(trace)
            mesh = color_mesh(COLORINGS[wanted.coloring], values, points, faces, terms)
            self._drawn = (wanted, vertices, mesh.legend)
            self.now.seconds = DECODE_COLORED
            self.now.offer(GlbMesh(write_glb(mesh.vertices, mesh.faces, mesh.uv, mesh.picture, "image/png")))

    def _textured(self, picture: TexelPicture, vertices: np.ndarray) -> GlbMesh:
        corners = set_back(vertices, self._scene, self._stage)[self._scene.mesh.faces].reshape(-1, 3)
        faces = np.arange(len(corners)).reshape(-1, 3)
        return GlbMesh(write_glb(corners, faces, picture.uv.reshape(-1, 2), picture.picture, "image/png"))

    def _awaited(self, drawn: Wanted, wanted: Wanted) -> str:
        """What is being computed, where it is not the quantity or the photo that is drawn; else empty."""
        if drawn.title != wanted.title:
            return wanted.title
        if drawn.is_per_pixel and drawn.view != wanted.view:
            return self._photos(wanted)
        return ""

    def _photos(self, wanted: Wanted) -> str:
        return "All photos" if wanted.view is None else f"Photo {self._scene.views[wanted.view].name}"

    def _note(self, wanted: Wanted, state: RunState, page_state: PageState) -> str:
        """The photos or the term that the values come from, and what arrows show, with the factor by which they are longer."""
        if wanted.term is not None:
            return f"Term: {wanted.term}"
        if COLORINGS[wanted.coloring].of_photo is None:
            return ""
        if wanted.coloring != "flow" or wanted.is_per_pixel:
            answer = self._answer[1] if self._answer is not None and self._answer[0] == wanted else None
            return self._photos(wanted) + (answer.blur_note if isinstance(answer, PaintedTexels) else "")
        arrows = "how far each face is off" if wanted.view is None else "the flow"
        scale = flow_scale(self._residuals.at(state, page_state), page_state, self._scene.mesh, state.vertices)
        return f"{self._photos(wanted)}. Arrows: {arrows}, ×{scale:g}."

    def _take(self, wanted: Wanted, found: np.ndarray | PaintedTexels | Exception) -> None:
        self._answer = (wanted, found)


def _why_unknown(drawn: Wanted) -> str:
    """Why faces have no colour, where that of the colouring does not say it; else empty."""
    if drawn.view is None:
        return ""
    return "little texture, or not seen in this photo" if drawn.coloring == "flow" else "not seen in this photo"
