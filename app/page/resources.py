"""Resources shared by all pages of a session: the controller, histories, caches and background workers."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import viser

from app.background_worker import BackgroundWorker
from app.debugger.compare import RunEnergies
from app.debugger.controller import Controller
from app.debugger.engine_compilation import EngineCompilation
from app.debugger.error_history import RunErrors, knows_truth
from app.debugger.history import EnergyHistory, PathHistory
from app.debugger.run_state import RunState
from app.experiments.experiment_runner import ExperimentRunner
from app.layers.cameras import Thumbnails
from app.pictures.photo_store import PhotoStore
from app.pictures.texturer import Texturer
from app.stage import Stage
from fairing.run.session import Session
from fairing.scene import Scene

ChangeScene = Callable[[viser.ClientHandle, str, str], None]


@dataclass(frozen=True, eq=False)
class SessionResources:
    """Attributes:
    run_errors: distances to the truth; None where it is not known.
    change_scene: shows another scene of the lessons, and opens a lesson in the browser that requested it; called with
        the browser, the scene's name and the lesson's name.
    """

    scene: Scene
    stage: Stage
    controller: Controller
    energies: EnergyHistory
    run_energies: RunEnergies
    run_errors: RunErrors | None
    paths: PathHistory
    thumbnails: Thumbnails
    texturer: Texturer
    background: BackgroundWorker
    photos: PhotoStore
    experiments: ExperimentRunner
    change_scene: ChangeScene

    @classmethod
    def open(
        cls,
        session: Session,
        save_to: Path | None,
        recorded_in: Path | None,
        change_scene: ChangeScene,
        compilation: EngineCompilation | None = None,
    ) -> "SessionResources":
        """Start the controller and the workers.

        Args:
            session: the run.
            save_to: file that the trace is written to.
            recorded_in: file that the trace was read from; its bookmarks lie beside it.
            compilation: see `Controller`.

        Raises:
            InputError: `save_to` cannot be written, or the bookmarks cannot be read.
        """
        scene = session.scene
        stage = Stage.of(scene)
        controller = Controller(session, save_to, recorded_in, compilation=compilation)
        return cls(
            scene,
            stage,
            controller,
            EnergyHistory(len(scene.mesh.faces)),
            RunEnergies(len(scene.mesh.faces)),
            RunErrors(scene) if knows_truth(scene) else None,
            PathHistory(len(scene.mesh.vertices)),
            Thumbnails(scene),
            Texturer(scene, stage, controller.republish),
            BackgroundWorker(controller.republish),
            PhotoStore(scene),
            ExperimentRunner(scene, scene.name, controller.republish),
            change_scene,
        )

    def update(self, state: RunState) -> None:
        """Bring the histories up to date."""
        self.energies.update(state)
        self.paths.update(state)

    def close(self) -> None:
        """End the controller, which closes the trace's file, and the workers."""
        self.controller.close()
        self.texturer.close()
        self.background.close()
        self.thumbnails.close()
        self.experiments.close()
