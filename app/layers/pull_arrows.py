"""Pull layer: at the selected vertices the parts of all terms in the next step, head to tail, and the step they add up to."""

import numpy as np
import viser

from app.debugger.moment_pulls import MomentPulls
from app.debugger.run_state import RunState
from app.page_state.page_state import NOW_SHAPE, PageState
from app.page_state.pull_source import PullSource, arrow_scale, chosen_vertices
from app.palette import SELECTED
from app.pictures.term_colors import colors_of_terms
from app.stage import Stage
from app.viser_bridge.line_node import LineNode
from fairing.mesh import Mesh

HEAD = 0.25  # length of a head, in lengths of its arrow
LONGEST_HEAD = 0.12  # in lengths of the longest arrow of its vertex
NEGLIGIBLE = 0.005  # parts shorter than this share of the vertex's longest part are not drawn


def arrow_lines(tails: np.ndarray, tips: np.ndarray, longest_head: float) -> np.ndarray:
    """(3 a, 2, 3) float: shafts and heads of arrows (a, 3) to (a, 3), three segments each.

    Args:
        longest_head: in the unit of the ends.
    """
    along = tips - tails
    length = np.linalg.norm(along, axis=1, keepdims=True)
    unit = along / np.maximum(length, 1e-300)
    across = np.cross(unit, np.eye(3)[np.argmin(np.abs(unit), axis=1)])
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    head = np.minimum(HEAD * length, longest_head)
    wings = [tips - head * unit + side * 0.5 * head * across for side in (1, -1)]
    return np.stack([np.stack([tails, tips], 1), *(np.stack([tips, wing], 1) for wing in wings)], 1).reshape(-1, 2, 3)


def pull_lines(found: MomentPulls, vertex: int, place: np.ndarray, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """Segments (q, 2, 3) float of a vertex's arrows, and their colours (q, 3) uint8.

    The arrow of the whole step is there only if it has several parts.

    Args:
        place: (3,) float: of the vertex, world units.
        scale: length of the arrows, in lengths of the parts.
    """
    steps = scale * np.array([pull.step[vertex] for pull in found.pulls])
    length = np.linalg.norm(steps, axis=1)
    ends = place + np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    kept = np.flatnonzero(length > NEGLIGIBLE * length.max(initial=0))
    if len(kept) == 0:
        return np.zeros((0, 2, 3)), np.zeros((0, 3), dtype=np.uint8)
    tails, tips = ends[kept], ends[kept + 1]
    color_of, names = colors_of_terms(found.meanings), [pull.name for pull in found.pulls]
    colors = [color_of[names[k]] for k in kept]
    if len(kept) > 1:
        tails, tips, colors = np.vstack([place, tails]), np.vstack([ends[-1], tips]), [SELECTED, *colors]
    lines = arrow_lines(tails, tips, LONGEST_HEAD * float(length.max()))
    return lines, np.repeat(np.array(colors, dtype=np.uint8), 3, axis=0)


class PullArrowsLayer:
    """All arrows in one node, in front of the surface: half of them point into it."""

    def __init__(self, client: viser.ClientHandle, stage: Stage, mesh: Mesh, source: PullSource) -> None:
        self._stage, self._mesh, self._source = stage, mesh, source
        self._lines = LineNode(client, "/pulls", None, 3.5, in_front=True)

    def show(self, state: RunState, page_state: PageState) -> None:
        is_shown = page_state.shape == NOW_SHAPE or page_state.entered is not None
        found = self._source.drawn(state, page_state) if is_shown else None
        if found is None:
            self._lines.hide()
            return
        scale = arrow_scale(found, page_state, self._mesh, state.vertices)
        drawn = [pull_lines(found, v, state.vertices[v], scale) for v in chosen_vertices(page_state)]
        lines, colors = (np.concatenate(each) for each in zip(*drawn, strict=True))
        self._lines.show(self._stage.page_from_world(lines), np.repeat(colors[:, None], 2, axis=1))
