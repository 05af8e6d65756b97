"""Photo pages of the cells panel: the vertex in every photo (figures 4a, 4d), and a face in two photos (figure 2)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.debugger.controller import Controller
from app.debugger.history import last_step_about
from app.debugger.run_state import Activity, RunState
from app.debugger.step_text import slot_of
from app.html import number, text
from app.page_state.cells_controls import CellsControls
from app.page_state.cells_state import ARROW_SCALES, CROP, DIFFERENCE, PAIR_PICTURES, PAIR_TIMES, SPANS, CellsView
from app.palette import LOCKED, NOW, RGB, SELECTED, START, css, solid
from app.panels.choice import chip, photo_link
from app.pictures.cell_images import arrow_path, data_uri
from app.pictures.photo_crops import FacePair, Window, face_pair, mean_difference
from app.pictures.photo_store import PhotoStore
from app.pictures.term_colors import COLOR_OF_TERM
from app.query_cache import QueryCache
from fairing.camera import Camera
from fairing.errors import Cancelled
from fairing.judge.associations import ImageEdges, image_edges
from fairing.run.session import Session
from fairing.scene import Scene
from fairing.terms.names import IMAGE_EDGES

CROP_SIDE = 158  # px
PAIR_SIDE = 158
MAX_PATH = 200  # points
BAR = 9.0  # px of the crop: length of a bar along an image edge


@dataclass(frozen=True, eq=False)
class VertexInPhotos:
    """Geometry of a vertex and its one-ring at one moment, for drawing over photos.

    Attributes:
        views: ids of the photos that see a face of it.
        path: (n, 3) float, world units: positions from the start to the current moment.
        step: (2, 3) float, world units: positions before and after its last step; None if there was none.
        ring_start, ring_now: (F, 3, 3) float, world units: the corners of its F faces at the start and now.
        face_views: ids of the photos that see a face, by face id.
        edges: by photo, the image edges beside the creases around the vertex; empty if not requested.
    """

    views: list[int]
    path: np.ndarray
    step: np.ndarray | None
    ring_start: np.ndarray
    ring_now: np.ndarray
    face_views: dict[int, list[int]]
    edges: dict[int, ImageEdges]


def vertex_in_photos(session: Session, vertex: int, moment: int, with_edges: bool = False) -> VertexInPhotos:
    """Collect the geometry of a vertex at a moment from the session.

    Args:
        with_edges: find the image edges in all its photos, too.

    Raises:
        Cancelled: cancellation was requested.
    """
    context, mesh, trace = session.sweep_state(moment).context, session.scene.mesh, session.trace
    faces = mesh.one_rings[vertex]
    path = [trace.start[vertex]]
    for record in trace.steps[:moment]:
        slot = slot_of(record, vertex)
        if slot is not None and (record.after[slot] != path[-1]).any():
            path.append(record.after[slot])
    chosen = np.unique(np.linspace(0, len(path) - 1, min(len(path), MAX_PATH)).astype(int))
    found = last_step_about(trace.steps, moment, vertex)
    views = np.flatnonzero(context.vertex_views[vertex]).tolist()
    return VertexInPhotos(
        views=views,
        path=np.array(path)[chosen],
        step=None if found is None else np.stack([found[1].before[found[2]], found[1].after[found[2]]]),
        ring_start=trace.start[mesh.faces[faces]],
        ring_now=trace.vertices_at(moment)[mesh.faces[faces]],
        face_views={int(f): context.kernel.pair_view[context.pairs_of(int(f))].tolist() for f in faces},
        edges={view: edges_around(session, vertex, moment, view) for view in views} if with_edges else {},
    )


def edges_around(session: Session, vertex: int, moment: int, view: int) -> ImageEdges:
    """The image edges in a photo beside creases between a vertex and its neighbours, or between two of these.

    Raises:
        Cancelled: cancellation was requested.
    """
    if session.cancel_requested():
        raise Cancelled
    found, mesh = image_edges(session, moment, view), session.scene.mesh
    around = mesh.faces[mesh.one_rings[vertex]]
    return found.of(np.asarray(np.isin(found.crease, around).all(axis=1)))


PhotosKey = tuple[int, int, int, bool]
"""Run, moment, vertex, and whether image edges are included."""

_EDGES_NOTE = (
    f" <span style='color:{solid(COLOR_OF_TERM[IMAGE_EDGES])}'>—</span> image edges beside creases (grey: rejected)"
)
_BEHIND = "<div class='note'>A corner of the face lies behind one of these cameras.</div>"


class PhotoPages:
    """Queries the engine for the photo pages and draws them. The drawing methods run on the background worker."""

    def __init__(
        self, controller: Controller, scene: Scene, photos: PhotoStore, controls: CellsControls,
        enter: Callable[[str], str],
    ) -> None:  # fmt: skip
        self._scene, self._photos, self._controls, self._enter = scene, photos, controls, enter
        self._lookup: QueryCache[PhotosKey, VertexInPhotos] = QueryCache(controller.query)

    def newest(
        self, state: RunState, vertex: int, with_edges: bool
    ) -> tuple[PhotosKey, VertexInPhotos | Exception] | None:
        """The latest query result for a vertex, with its key. Posts a query while paused.

        Args:
            with_edges: whether image edges are shown.
        """
        if state.activity is Activity.PAUSED:
            moment = state.moment
            self._lookup.request(
                (state.run_id, moment, vertex, with_edges),
                lambda session: vertex_in_photos(session, vertex, moment, with_edges),
            )
        found = self._lookup.latest
        return found if found is not None and (found[0][0], found[0][2]) == (state.run_id, vertex) else None

    def crops(self, known: VertexInPhotos, cells_view: CellsView) -> str:
        """Markup of the page with a crop of every photo. Runs on the background thread."""
        if not known.views:
            return "<div class='note'>No photo sees a face of this vertex well enough.</div>"
        spans = _chips(SPANS.values(), list(SPANS).index(cells_view.span), self._controls.span, "Show {} in each photo")
        scales = _chips(
            [f"×{scale}" for scale in ARROW_SCALES], ARROW_SCALES.index(cells_view.arrow_scale), self._controls.scale,
            "Draw the step {}",
        )  # fmt: skip
        tiles = "".join(
            f"<div>{self._name(view_id)}<div role='button' tabindex='0' style='cursor:zoom-in' "
            f"aria-label='Enlarge {text(self._scene.views[view_id].name)}' "
            f"{self._controls.enlarged_by(str(self._controls.code(view_id, CROP)))}>"
            f"{self.crop(known, view_id, cells_view, CROP_SIDE)}"
            "</div></div>"
            for view_id in known.views
        )
        return (
            f"<div class='row chips'><span class='dim'>Show</span>{spans}</div>"
            f"<div class='row chips'><span class='dim'>Step</span>{scales}</div>"
            f"<div class='dim'><span class='start'>—</span> start <span class='now'>—</span> now and the path "
            f"<span class='selected'>→</span> its last step, ×{cells_view.arrow_scale}{_EDGES_NOTE if known.edges else ''}</div>"
            f"<div class='crops'>{tiles}</div>"
        )

    def crop(self, known: VertexInPhotos, view_id: int, cells_view: CellsView, side: int) -> str:
        """A crop of one photo with the faces at the start and now, the vertex path and the last step."""
        camera = self._scene.views[view_id].camera
        start, now, path = (camera.project(p)[0] for p in (known.ring_start, known.ring_now, known.path))
        arrow = np.zeros((0, 2, 2))
        if known.step is not None:
            tail, head = camera.project(known.step)[0]
            arrow = np.stack([tail, tail + cells_view.arrow_scale * (head - tail)])[None]
        if cells_view.span == "faces":
            window = Window.around(np.concatenate([start.reshape(-1, 2), now.reshape(-1, 2)]), side)
        else:
            window = Window.around(np.concatenate([path, arrow.reshape(-1, 2)]), side, margin=0.3)
        shown = window.cut(self._photos[view_id])
        step = "".join(arrow_path(window.place(a[:1]), window.place(a[1:])) for a in arrow)
        here = window.place(path[-1])
        return framed_picture(
            shown, side,
            _lines(window.place(start), START) + _lines(window.place(now), NOW)
            + _lines(window.place(path)[None], NOW, 2.4, closed=False)
            + f'<circle cx="{here[0]:.1f}" cy="{here[1]:.1f}" r="3" fill="{css(NOW)}"/>'
            + f'<path d="{step}" stroke="{css(SELECTED)}" style="stroke-width:2"/>' + _edge_marks(known.edges.get(view_id), window),
        )  # fmt: skip

    def pair(self, known: VertexInPhotos, face: int, slot: int, cells_view: CellsView, affine: bool) -> str:
        """Markup of the page with a pair of photos. Runs on the background thread.

        Args:
            slot: index of the face in the one-ring of the vertex.
        """
        views = known.face_views.get(face, [])
        if len(views) < 2:
            return "<div class='note'>Fewer than two photos see this face well enough.</div>"
        first, second = chosen_pair(views, cells_view.pair)
        i, j = (self._scene.views[v] for v in (first, second))
        names = [text(i.name), text(j.name)]
        picks = "".join(
            f"<div class='row chips'><span class='dim' style='width:14px'>{letter}</span>"
            + "".join(
                chip(
                    str(v + 1),
                    control(str(v)),
                    f"Photo {letter}: {self._scene.views[v].name}",
                    v == chosen,
                    "chip tight",
                )
                for v in views
            )
            + "</div>"
            for letter, control, chosen in (("i", self._controls.first, first), ("j", self._controls.second, second))
        )
        pairs = self._face_pairs(known, slot, (first, second), affine, PAIR_SIDE)
        if not pairs:
            return picks + _BEHIND
        photos, cameras = (self._photos.as_taken(first), self._photos.as_taken(second)), (i.camera, j.camera)
        columns = "".join(
            self._pair_column(when, pair, mean_difference(photos, cameras, corners, affine))
            for (when, pair), corners in zip(pairs.items(), (known.ring_start[slot], known.ring_now[slot]), strict=True)
        )
        warp = "the affine map" if affine else "the plane-induced homography"
        return (
            f"{picks}<div class='note dim'>{names[0]} warped into {names[1]} by {warp}. Doubled edges in the average "
            f"show that a vertex is misplaced.</div>"
            f"<div class='crops'>{columns}</div>"
        )

    def _face_pairs(
        self, known: VertexInPhotos, slot: int, pair: tuple[int, int], affine: bool, side: int
    ) -> dict[str, FacePair]:
        """By `PAIR_TIMES`; empty where a corner lies behind a camera."""
        i, j = (self._scene.views[v].camera for v in pair)
        corners = {"start": known.ring_start[slot], "now": known.ring_now[slot]}
        if not all(is_in_front(camera, c) for camera in (i, j) for c in corners.values()):
            return {}
        window = Window.around(np.concatenate([j.project(c)[0] for c in corners.values()]), side)
        photos = self._photos[pair[0]], self._photos[pair[1]]
        return {when: face_pair(photos, (i, j), c, window, affine) for when, c in corners.items()}

    def enlarged_pair(
        self, known: VertexInPhotos, face: int, slot: int, cells_view: CellsView, affine: bool, kind: str, side: int
    ) -> str:
        """Markup of one picture of the pair for the lens; `kind` is one of `PAIR_KINDS`. Runs on the background thread."""
        views = known.face_views.get(face, [])
        if len(views) < 2:
            return ""
        first, second = chosen_pair(views, cells_view.pair)
        pairs, (when, picture) = self._face_pairs(known, slot, (first, second), affine, side), kind.split()
        if not pairs:
            return _BEHIND
        names = [text(self._scene.views[v].name) for v in (first, second)]
        shown = _pair_picture(pairs[when], when, picture, side)
        return f"{shown}<div class='note dim'>i {names[0]} · j {names[1]}</div>"

    def _pair_column(self, when: str, pair: FacePair, difference: float) -> str:
        pictures = "".join(
            f"<div role='button' tabindex='0' style='cursor:zoom-in' aria-label='Enlarge {name}, {PAIR_TIMES[when].lower()}' "
            f"{self._controls.enlarged_by(str(self._controls.code(0, f'{when} {picture}')))}>"
            f"{_pair_picture(pair, when, picture, PAIR_SIDE)}</div><div class='dim'>{name}</div>"
            for picture, name in PAIR_PICTURES.items()
        )
        return (
            f"<div><div class='row'><b class='grow'>{PAIR_TIMES[when]}</b>"
            f"<span class='dim' title='{DIFFERENCE}'>|i − j| {number(difference, 3)}</span></div>{pictures}</div>"
        )

    def _name(self, view_id: int) -> str:
        name = self._scene.views[view_id].name
        return f"<div class='one'>{photo_link(view_id, name, self._enter(str(view_id)))}</div>"


def _edge_marks(found: ImageEdges | None, window: Window) -> str:
    """SVG: a tick from each segment of a crease to its image edge, which is drawn as a bar; grey where the loss rejects it."""
    if found is None:
        return ""
    crease, edge = window.place(found.crease_px), window.place(found.edge_px)
    along = 0.5 * BAR * found.along_px
    parts = {False: "", True: ""}
    for a, b, half, rejected in zip(crease, edge, along, found.rejected, strict=True):
        (x0, y0), (x1, y1) = b - half, b + half
        parts[bool(rejected)] += f"M{a[0]:.1f} {a[1]:.1f}L{b[0]:.1f} {b[1]:.1f}M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}"
    colors = {False: solid(COLOR_OF_TERM[IMAGE_EDGES]), True: css(LOCKED)}
    return "".join(
        f'<path d="{d}" stroke="{colors[rejected]}" style="stroke-width:2"/>' for rejected, d in parts.items() if d
    )


def chosen_pair(views: list[int], wanted: tuple[int | None, int | None]) -> tuple[int, int]:
    """Two different photos of those that see a face, preferably the ones in `wanted`."""
    second = wanted[1] if wanted[1] in views else None
    first = wanted[0] if wanted[0] in views and wanted[0] != second else next(v for v in views if v != second)
    return first, second if second is not None else next(v for v in views[len(views) // 2 :] + views if v != first)


def is_in_front(camera: Camera, points: np.ndarray) -> bool:
    return bool((camera.project(points)[1] > 0).all())


def _chips(names, chosen: int, press: Callable[[str], str], hint: str) -> str:
    return "".join(chip(name, press(str(n)), hint.format(name), n == chosen) for n, name in enumerate(names))


def _pair_picture(pair: FacePair, when: str, picture: str, side: int) -> str:
    image = {"average": pair.average, "warped": pair.warped, "own": pair.own}[picture]
    return framed_picture(image, side, _lines(pair.outline[None], START if when == "start" else NOW))


def framed_picture(pixels: np.ndarray, side: int, drawn: str) -> str:
    """Markup of a picture `side` px wide, or as wide as there is room, with SVG drawn over it."""
    return (
        f"<div class='tiles square' style='width:{side}px;cursor:inherit'>"
        f"<img src='{data_uri(pixels, jpeg=True)}' alt=''>"
        f"<svg class='over' viewBox='0 0 {side} {side}'>{drawn}</svg></div>"
    )


def _lines(shapes: np.ndarray, color: RGB, width: float = 1.2, *, closed: bool = True) -> str:
    """Polygons or open lines (n, p, 2), px."""
    kind = "polygon" if closed else "polyline"
    return "".join(
        f'<{kind} points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in shape)}" fill="none" stroke="{css(color)}" '
        f'stroke-width="{width}" vector-effect="non-scaling-stroke"/>'
        for shape in shapes
    )
