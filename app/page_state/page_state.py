"""Page state: what one browser shows, such as its selection and layers. All browsers share the engine."""

from dataclasses import dataclass, field, replace

from app.debugger.compare import Reference
from app.debugger.condition import Condition
from app.page_state.cells_state import CellsView
from app.page_state.selection import Selection
from fairing.scene import BoxCorners
from fairing.terms.names import PHOTOS

LAYERS: dict[str, str] = {
    "now": "Present mesh",
    "start": "Start mesh",
    "truth": "True mesh",
    "vertices": "Vertices",
    "paths": "Vertex paths",
    "certainty": "Certainty ellipsoids",
    "cameras": "Cameras",
    "given cameras": "Given cameras",
    "points": "Sparse points",
    "object box": "Object's box",
    "pulls": "Pulls of terms",
    "point feet": "Points and their faces",
    "image edges": "Image edges",
    "axes": "Edges along axes",
    "seen": "Seen by the photo",
}
ASSOCIATIONS = {"point feet", "image edges", "axes", "seen"}
"""Layers that show what the terms measure the mesh against."""
HIDDEN_AT_FIRST = {"certainty", "truth", "points", *ASSOCIATIONS}
HIDDEN_ON_LARGE_MESHES = {"now", "start"}
LARGE_MESH = 200  # vertices; wireframes of larger meshes hide the surface
MANY_SAMPLED = 10_000  # vertices; the samples of larger meshes may not fit into a texture (ledger: residuals per pixel)
MANY_VERTICES = 500  # marks of more hide the surface
MAX_MAGNIFICATION = 50
FLOW_SCALES: dict[int, str] = {0: "Auto", 10: "×10", 30: "×30", 100: "×100", 300: "×300"}
PULL_SCALES: dict[int, str] = {0: "Auto", 1: "×1", 10: "×10", 100: "×100", 1000: "×1000"}
SURFACES: dict[str, str] = {"none": "None", "flat": "Flat", "textured": "Textured"}
START_SHAPE, NOW_SHAPE, TRUE_SHAPE = 0.0, 1.0, 2.0


@dataclass(frozen=True)
class PlotView:
    """Settings of the plot.

    Attributes:
        name: of a quantity in `app.debugger.series`; None: the residual at the finest level.
        of_vertex: whether it is that of the selected vertex instead of the run.
        is_log: logarithmic scale; None: the default of the quantity.
    """

    name: str | None = None
    of_vertex: bool = False
    is_log: bool | None = None


@dataclass
class PageState:
    """The state of one browser's page.

    Attributes:
        selection: the selected vertices.
        point: the selected sparse point, whose photos are shown while no vertex is selected; None: none.
        face: the face whose cells are shown; None: the first face of the current vertex.
        picks_face: whether the face with the largest energy around the current vertex is shown as soon as it is known.
        entered: the camera whose view is shown; None: the free view.
        magnification: of displacements, 1 to `MAX_MAGNIFICATION`.
        adjustment_step: the iteration of the adjustment of cameras that the layer "given cameras" shows; 0: the given ones.
        reference: the moment compared with; None: no comparison.
        cells: settings of the cells panel.
        plot: settings of the plot.
        watches: watch expressions.
        viewed_moment: the past moment shown during a run; None: the present moment.
        speed: playback speed; 1 is four moments per second.
        strip: quantity in the timeline's strip, of `app.pictures.strip.KINDS`.
        surface: appearance of the faces, a key of `SURFACES` or of `app.pictures.coloring.COLORINGS`.
        flow_scale: factor by which the image flow is drawn longer on the surface, of `FLOW_SCALES`; 0: one that fits.
        pull_scale: factor by which the arrows of pulls are drawn longer, of `PULL_SCALES`; 0: chosen to fit the mesh.
        pull_term: the term whose pull colours the surface.
        is_per_pixel: whether residuals, or the flow of one photo, colour the surface at every sample of the cells instead of by
            face.
        residual_view: the photo whose residuals or flow colour the surface; None: all photos.
        is_view_dependent: whether the texture is view-dependent while the run is paused.
        shape: vertex positions of the surface: 0 at the start, 1 now, 2 the truth; values between are interpolated.
        is_divided: whether a divider separates the start, at its left, from now, where the surface is textured, or coloured per
            pixel, and at now.
        model_share: opacity of the model over the photo in a camera's view, 0 to 1.
        experiment: the experiment shown, of `fairing.experiments.experiments`.
        is_presenting: whether the page has the presenter layout.
        is_swipe: whether `model_share` is a fraction of the photo's width, from the right, instead of an opacity.
        shown: for each layer whether it is visible.
        box: corners of the box that is being chosen, whose points another run would triangulate; None: none.
    """

    selection: Selection = field(default_factory=Selection)
    point: int | None = None
    face: int | None = None
    picks_face: bool = False
    entered: int | None = None
    magnification: float = 1.0
    adjustment_step: int = 0
    reference: Reference | None = None
    cells: CellsView = field(default_factory=CellsView)
    plot: PlotView = field(default_factory=PlotView)
    watches: tuple[Condition, ...] = ()
    viewed_moment: int | None = None
    speed: float = 1.0
    strip: str = "energy"
    surface: str = "textured"
    flow_scale: int = 0
    pull_scale: int = 0
    pull_term: str = PHOTOS
    is_per_pixel: bool = True
    residual_view: int | None = None
    is_view_dependent: bool = False
    shape: float = NOW_SHAPE
    is_divided: bool = False
    model_share: float = 0.0
    experiment: str = "capture-range"
    is_presenting: bool = False
    is_swipe: bool = False
    shown: dict[str, bool] = field(default_factory=lambda: {name: name not in HIDDEN_AT_FIRST for name in LAYERS})
    box: BoxCorners | None = None

    @classmethod
    def of_mesh(cls, n_vertices: int) -> "PageState":
        """The first state on a mesh: without wireframes if it is large, without marks of very many vertices, and with residuals
        per pixel unless it is very large."""
        hidden = HIDDEN_AT_FIRST | (HIDDEN_ON_LARGE_MESHES if n_vertices > LARGE_MESH else set())
        hidden |= {"vertices"} if n_vertices > MANY_VERTICES else set()
        return cls(shown={name: name not in hidden for name in LAYERS}, is_per_pixel=n_vertices <= MANY_SAMPLED)

    def copy(self) -> "PageState":
        """The same state for another browser, in the free view, in the usual layout and at the present moment."""
        return replace(self, entered=None, is_presenting=False, viewed_moment=None, shown=dict(self.shown))

    @property
    def shows_divider(self) -> bool:
        has_both = self.surface == "textured" or self.shows_texels
        return self.is_divided and self.entered is None and has_both and self.shape == NOW_SHAPE

    @property
    def shows_texels(self) -> bool:
        """Whether the surface is coloured per pixel, by the residual or the flow of one photo. That of all has no direction."""
        has_texels = self.surface == "residual" or (self.surface == "flow" and self.residual_view is not None)
        return has_texels and self.is_per_pixel

    def shows(self, layer: str) -> bool:
        return self.shown[layer]

    @property
    def selected(self) -> int | None:
        """The current vertex of the selection, whose cells and variables are shown; None if nothing is selected."""
        return self.selection.current
