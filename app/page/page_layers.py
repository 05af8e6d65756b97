"""The layers of the 3D view of one page."""

import viser

from app.debugger.run_state import RunState
from app.layers import Layer
from app.layers.associations import AssociationsLayer
from app.layers.cameras import CamerasLayer
from app.layers.certainty import CertaintyLayer
from app.layers.drag_handle import DragHandleLayer
from app.layers.flow_arrows import FlowArrowsLayer
from app.layers.given_cameras import GivenCamerasLayer
from app.layers.object_box import ChosenBoxLayer, ObjectBoxLayer
from app.layers.paths import PathsLayer
from app.layers.points import PointsLayer
from app.layers.pull_arrows import PullArrowsLayer
from app.layers.reference_mesh import ReferenceMeshLayer
from app.layers.step_arrow import StepArrowLayer
from app.layers.surface import SurfaceLayer
from app.layers.vertices import VerticesLayer
from app.layers.wireframe import WireframeLayer
from app.page.page_frame import PageFrame
from app.page.plugins import offered_layers
from app.page.resources import SessionResources
from app.page.vertex_interaction import VertexInteraction
from app.page_state.association_source import AssociationSource
from app.page_state.certainty_source import CertaintySource
from app.page_state.page_state import PageState
from app.page_state.pull_source import PullSource
from app.page_state.residual_source import ResidualSource


class PageLayers:
    """Attributes:
    surface: the layer that draws the mesh as a surface; its legend is shown by a panel.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        frame: PageFrame,
        resources: SessionResources,
        interaction: VertexInteraction,
        certainty: CertaintySource,
        pulls: PullSource,
        associations: AssociationSource,
        page_state: PageState,
    ) -> None:
        stage, scene = resources.stage, resources.scene
        click, background = frame.toasts(interaction.click_vertex), interaction.background
        begin, end = interaction.begin_drag, interaction.end_drag
        residuals = ResidualSource(resources.controller)
        self.surface = SurfaceLayer(client, stage, scene, resources.texturer, resources.controller, residuals, pulls)
        self._layers: list[Layer] = [
            self.surface,
            WireframeLayer(client, stage, scene),
            VerticesLayer(client, stage, scene.mesh, click, background),
            DragHandleLayer(client, stage, scene.mesh, click, background, begin, end),
            ReferenceMeshLayer(client, stage, scene.mesh),
            PathsLayer(client, stage, resources.paths),
            FlowArrowsLayer(client, stage, scene, residuals),
            StepArrowLayer(client, stage, scene),
            PullArrowsLayer(client, stage, scene.mesh, pulls),
            AssociationsLayer(client, stage, scene, associations),
            CertaintyLayer(client, stage, scene.mesh, certainty),
            PointsLayer(client, stage, scene),
            ObjectBoxLayer(client, stage, scene),
            GivenCamerasLayer(client, stage, scene, resources.refinement),
            CamerasLayer(client, stage, scene, resources.thumbnails, frame.toasts(frame.camera.enter), background),
            *offered_layers(client, stage, scene, frame.toasts),
        ]
        if scene.triangulated:
            republish = frame.toasts.without_event(resources.controller.republish)
            self._layers.append(ChosenBoxLayer(client, stage, page_state, republish))

    def show(self, state: RunState, page_state: PageState) -> None:
        """Bring all layers up to date."""
        for layer in self._layers:
            layer.show(state, page_state)

    def close(self) -> None:
        """The browser has disconnected."""
        self.surface.close()
