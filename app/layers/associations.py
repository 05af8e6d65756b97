"""Association layers: points and their faces, edges along axes, what a photo sees, and image edges beside the creases."""

import numpy as np
import viser

from app.debugger.run_state import RunState
from app.page_state.association_source import AssociationSource
from app.page_state.page_state import NOW_SHAPE, PageState
from app.palette import AXIS_COLORS, LOCKED, RGB, SEEN
from app.pictures.term_colors import COLOR_OF_TERM
from app.stage import Stage
from app.viser_bridge.line_node import LineNode
from fairing.camera import Camera
from fairing.judge.associations import AxisEdges, ImageEdges, PointFeet
from fairing.mesh import Mesh
from fairing.scene import Scene
from fairing.terms.names import IMAGE_EDGES, POINTS

BAR = 8.0  # px of the photo: length of a bar along an image edge

Lines = tuple[np.ndarray, np.ndarray]
"""Segments (n, 2, 3) float, world units, and their colours (n, 3) uint8."""


def point_lines(found: PointFeet) -> Lines:
    """From each point to its face; grey where the loss rejects the point."""
    return np.stack([found.positions, found.feet], axis=1), _colored(~found.rejected, COLOR_OF_TERM[POINTS])


def axis_lines(found: AxisEdges, vertices: np.ndarray) -> Lines:
    """The edges in the colours of their axes; vertices (n, 3), world units."""
    return vertices[found.edges], np.array(AXIS_COLORS, dtype=np.uint8)[found.axis]


def seen_lines(seen: np.ndarray, mesh: Mesh, vertices: np.ndarray) -> Lines:
    """Outlines of the faces (m,) bool that a photo sees; vertices (n, 3), world units."""
    sides = np.sort(mesh.faces[seen][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges = np.unique(sides, axis=0)
    return vertices[edges], np.tile(np.array(SEEN, dtype=np.uint8), (len(edges), 1))


def edge_lines(found: ImageEdges, camera: Camera, vertices: np.ndarray) -> Lines:
    """From each segment of a crease to its image edge, and a bar along the edge; grey where the loss rejects it.

    They lie at the depth of the crease; vertices (n, 3) are world units.
    """
    J = camera.J_image_wrt_point(found.places)
    moves = np.einsum("sij,sj->si", np.linalg.pinv(J), found.edge_px - found.crease_px)
    along = vertices[found.crease[:, 1]] - vertices[found.crease[:, 0]]
    length_px = np.linalg.norm(np.einsum("sij,sj->si", J, along), axis=1, keepdims=True)
    half = 0.5 * BAR * along / np.maximum(length_px, 1e-300)
    tips = found.places + moves
    lines = np.concatenate([np.stack([found.places, tips], 1), np.stack([tips - half, tips + half], 1)])
    return lines, np.tile(_colored(~found.rejected, COLOR_OF_TERM[IMAGE_EDGES]), (2, 1))


def _colored(is_held: np.ndarray, color: RGB) -> np.ndarray:
    return np.where(is_held[:, None], np.array(color), np.array(LOCKED)).astype(np.uint8)


class AssociationsLayer:
    """One node a layer. Lines that lie on the surface are drawn in front of it."""

    def __init__(self, client: viser.ClientHandle, stage: Stage, scene: Scene, source: AssociationSource) -> None:
        self._stage, self._scene, self._source = stage, scene, source
        self._nodes = {
            "seen": LineNode(client, "/associations/seen", None, 1.5, in_front=True),
            "axes": LineNode(client, "/associations/axes", None, 3.0),
            "point feet": LineNode(client, "/associations/points", None, 2.5, in_front=True),
            "image edges": LineNode(client, "/associations/image_edges", None, 2.5, in_front=True),
        }

    def show(self, state: RunState, page_state: PageState) -> None:
        is_shown = page_state.shape == NOW_SHAPE or page_state.entered is not None
        for layer, node in self._nodes.items():
            found = self._source.shown(layer, state, page_state) if is_shown else None
            if found is None:
                node.hide()
                continue
            lines, colors = self._lines(layer, found, state, page_state)
            node.show(self._stage.page_from_world(lines), np.repeat(colors[:, None], 2, axis=1))

    def _lines(self, layer: str, found, state: RunState, page_state: PageState) -> Lines:
        mesh, views, entered = self._scene.mesh, self._scene.views, page_state.entered
        if layer == "axes":
            return axis_lines(found, state.vertices)
        if layer == "point feet":
            return point_lines(found)
        assert entered is not None
        if layer == "seen":
            return seen_lines(found[:, entered], mesh, state.vertices)
        return edge_lines(found, views[entered].camera, state.vertices)
