"""What one browser looks at: its selection, its layers. The engine is shared, this is not."""

from dataclasses import dataclass, field, replace

from app.debugger.compare import Reference
from app.debugger.condition import Condition
from app.page_state.cells_state import CellsView
from app.page_state.selection import Selection

LAYERS: dict[str, str] = {
    "now": "Mesh now",
    "start": "Mesh at the start",
    "truth": "True mesh",
    "vertices": "Vertices",
    "paths": "Vertex paths",
    "certainty": "What the photos determine",
    "cameras": "Cameras",
    "points": "Sparse points",
}
MAX_MAGNIFICATION = 50
SURFACES: dict[str, str] = {"none": "None", "flat": "Flat", "textured": "Textured"}
START_SHAPE, NOW_SHAPE, TRUE_SHAPE = 0.0, 1.0, 2.0


@dataclass(frozen=True)
class PlotView:
    """What the plot shows.

    Attributes:
        name: of a quantity in `app.debugger.series`.
        of_vertex: of the selected vertex instead of the run.
        is_log: scale by powers of ten; None: as suits the quantity.
    """

    name: str = "energy"
    of_vertex: bool = False
    is_log: bool | None = None


@dataclass
class PageState:
    """Attributes:
    selection: the vertices chosen.
    face: the face of it whose cells are shown; None for any.
    entered: the camera looked through, None outside.
    magnification: of displacements, 1 to 50.
    reference: what is compared with; None for nothing.
    cells: how the cells are looked at.
    plot: what the plot shows.
    watches: expressions whose values are shown.
    looks_at: a past moment shown while the run goes on; None follows it.
    speed: of playing the record; 1 is four moments a second.
    strip: what the timeline's strip shows, of `app.pictures.strip.KINDS`.
    surface: how the faces are shown: a key of `SURFACES` or of `app.pictures.coloring.COLORINGS`.
    by_eye: the texture of a resting surface follows the eye.
    shape: where the surface's vertices are: 0 at the start, 1 now, 2 at the truth, and anything between.
    model_share: of the model laid over a photo looked through, 0 to 1.
    experiment: the one shown, of `fairing.experiments.EXPERIMENTS`.
    swipes: that is the share of the photo's width, from the right, not of every pixel.
    shown: which layers are switched on.
    """

    selection: Selection = field(default_factory=Selection)
    face: int | None = None
    entered: int | None = None
    magnification: float = 1.0
    reference: Reference | None = None
    cells: CellsView = field(default_factory=CellsView)
    plot: PlotView = field(default_factory=PlotView)
    watches: tuple[Condition, ...] = ()
    looks_at: int | None = None
    speed: float = 1.0
    strip: str = "energy"
    surface: str = "textured"
    by_eye: bool = False
    shape: float = NOW_SHAPE
    model_share: float = 0.0
    experiment: str = "capture-range"
    swipes: bool = False
    shown: dict[str, bool] = field(
        default_factory=lambda: {name: name not in ("certainty", "truth", "points") for name in LAYERS}
    )

    def copy(self) -> "PageState":
        """The same for another browser, outside of any camera."""
        return replace(self, entered=None, looks_at=None, shown=dict(self.shown))

    def shows(self, layer: str) -> bool:
        return self.shown[layer]

    @property
    def selected(self) -> int | None:
        """The vertex whose cells and variables are shown: the current one of the selection."""
        return self.selection.current
