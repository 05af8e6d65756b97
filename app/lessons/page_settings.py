"""Page settings of a lesson step. Settings that a lesson does not mention stay as the user has set them."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from app.page_state.page_state import PageState
from app.page_state.selection import Selection

AT_MESH, AT_FRONT, AT_CAMERAS = "mesh", "front", "cameras"


@dataclass(frozen=True)
class PageSettings:
    """Attributes:
    vertices: selected vertices, the current one last.
    face: the face whose cells are shown.
    eye: viewpoint: AT_MESH, AT_FRONT, AT_CAMERAS or the number of the photo looked through.
    compared: name of the lesson's run used as reference; empty: no comparison.
    tab: the active tab.
    heading: the heading to which the cells panel scrolls.
    settings: fields of `PageState` by name.
    cells: fields of `CellsView` by name.
    layers: visibility by name.

    None, or a name missing from a mapping, leaves the page as it is.
    """

    vertices: tuple[int, ...] | None = None
    face: int | None = None
    eye: str | int | None = None
    compared: str | None = None
    tab: str | None = None
    heading: str | None = None
    settings: dict[str, object] = field(default_factory=dict)
    cells: dict[str, object] = field(default_factory=dict)
    layers: dict[str, bool] = field(default_factory=dict)

    def set_in(self, page_state: PageState) -> None:
        """Set them in a page state, except for `eye`, `compared`, `tab` and `heading`, which are not part of it alone."""
        if self.vertices is not None:
            page_state.selection, page_state.point = Selection(self.vertices), None
        if self.face is not None or self.vertices is not None:
            page_state.face, page_state.picks_face = self.face, False
        for name, value in self.settings.items():
            setattr(page_state, name, value)
        page_state.cells = replace(page_state.cells, **self.cells)  # pyright: ignore[reportArgumentType] - checked on reading
        page_state.shown.update(self.layers)

    def is_seen_in(self, page_state: PageState) -> bool:
        """Whether a page state matches the settings of vertices, face, page of cells and surface."""
        wanted = PageState(
            selection=page_state.selection, face=page_state.face, cells=page_state.cells, shown=dict(page_state.shown)
        )
        wanted.surface, wanted.shape = page_state.surface, page_state.shape
        self.set_in(wanted)
        same = all(
            getattr(wanted, name) == getattr(page_state, name) for name in ("selection", "face", "surface", "shape")
        )
        return same and wanted.cells.page == page_state.cells.page


SettingsChange = Callable[[PageSettings], PageSettings]
