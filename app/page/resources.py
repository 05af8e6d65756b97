"""Resources shared by all pages of a session: the controller, histories, caches and background workers."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import viser

from app.background_worker import BackgroundWorker
from app.debugger.compare import FollowedEnergies, RunEnergies
from app.debugger.controller import Controller
from app.debugger.engine_compilation import EngineCompilation
from app.debugger.error_history import RunErrors, knows_truth
from app.debugger.history import EnergyHistory, PathHistory
from app.debugger.own_files import OwnFiles
from app.debugger.residual_history import ResidualHistory
from app.debugger.run_state import RunState
from app.experiments.experiment_runner import ExperimentRunner
from app.layers.cameras import Thumbnails
from app.lessons.progress import LastLesson
from app.pictures.photo_store import PhotoStore
from app.pictures.texturer import Texturer
from app.stage import Stage
from fairing.run.recorded_refinement import RecordedRefinement
from fairing.run.session import Session
from fairing.scene import Scene

ChangeScene = Callable[[viser.ClientHandle, str, str], None]


@dataclass(frozen=True, eq=False)
class SessionResources:
    """Attributes:
    energies, paths: of the run that a page shows; every page has its own, see `for_page`.
    run_errors: distances to the truth; None where it is not known.
    residuals: comparable residuals of all runs.
    refinement: of the cameras; None if they are the given ones.
    change_scene: shows another scene of the lessons, and opens a lesson in the browser that requested it; called with
        the browser, the scene's name and the lesson's name.
    last_lesson: the lesson that a page may go on with after another page was closed, or reloaded.
    """

    scene: Scene
    stage: Stage
    controller: Controller
    energies: EnergyHistory
    run_energies: RunEnergies
    run_errors: RunErrors | None
    residuals: ResidualHistory
    paths: PathHistory
    thumbnails: Thumbnails
    texturer: Texturer
    background: BackgroundWorker
    photos: PhotoStore
    experiments: ExperimentRunner
    change_scene: ChangeScene
    refinement: RecordedRefinement | None
    own_files: OwnFiles
    last_lesson: LastLesson

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
            compilation: see `Controller`; the mesh is painted once what paints it is compiled.

        Raises:
            InputError: `save_to` cannot be written, or the bookmarks cannot be read.
        """
        session.choose_inputs()
        scene = session.scene
        stage = Stage.of(scene)
        controller = Controller(session, save_to, recorded_in, compilation=compilation)
        run_energies = RunEnergies(len(scene.mesh.faces))
        return cls(
            scene,
            stage,
            controller,
            FollowedEnergies(run_energies, len(scene.mesh.faces)),
            run_energies,
            RunErrors(scene) if knows_truth(scene) else None,
            ResidualHistory(
                session,
                run_energies,
                lambda: controller.activity,
                compilation.wait if compilation else lambda cancelled: None,
                controller.republish,
            ),
            PathHistory(len(scene.mesh.vertices)),
            Thumbnails(scene),
            Texturer(
                scene, stage, controller.republish, compilation.wait_for_painting if compilation else lambda: None
            ),
            BackgroundWorker(controller.republish),
            PhotoStore(scene),
            ExperimentRunner(scene, scene.name, controller.republish),
            change_scene,
            RecordedRefinement.of(scene, session.trace.header),
            OwnFiles(session.own_files, controller.post),
            LastLesson(),
        )

    def for_page(self) -> "SessionResources":
        """The same resources with histories for one page: pages show states at different times."""
        mesh = self.scene.mesh
        energies, paths = FollowedEnergies(self.run_energies, len(mesh.faces)), PathHistory(len(mesh.vertices))
        return replace(self, energies=energies, paths=paths)

    def follow(self, state: RunState) -> None:
        """Bring this page's histories up to a state."""
        self.energies.update(state)
        self.paths.update(state)
        self.residuals.follow(state)

    def forget_deleted_runs(self, state: RunState) -> None:
        run_ids = [run.run_id for run in state.runs]
        self.residuals.keep(run_ids)
        self.run_energies.keep(run_ids)
        if self.run_errors is not None:
            self.run_errors.keep(run_ids)

    def close(self) -> None:
        """End the controller, which closes the trace's file, and the workers."""
        self.own_files.close()
        self.residuals.close()
        self.controller.close()
        self.texturer.close()
        self.background.close()
        self.thumbnails.close()
        self.experiments.close()
