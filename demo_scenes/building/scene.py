"""Demo family `building:SEED`: the scene of a seed."""

import dataclasses
from pathlib import Path

import numpy as np

from demo_scenes.building.coats import building_coats
from demo_scenes.building.plan import Plan, draw_plan
from demo_scenes.building.points import sfm_points
from demo_scenes.building.starts import build_start
from demo_scenes.building.surroundings import build_surroundings, joined
from demo_scenes.cache import package_digest
from demo_scenes.outdoors import clothed, outdoor_stage
from demo_scenes.photography import Photography, Progress, take_photos
from demo_scenes.surface import Stage
from fairing.scene import Scene

LIGHT_STEPS = 10
SAMPLES = 2  # rays along a pixel's side: within 0.8 grey levels rms of 12, mostly at edges


def building_scene(photography: Photography | None = None, progress: Progress | None = None, seed: int = 0) -> Scene:
    """The member of the family that belongs to a seed.

    The mesh covers the front of one building. The photos show its surroundings as well.

    Args:
        photography: instead of what is drawn from the seed.
        seed: any integer.
    """
    return scene_of_plan(f"building:{seed}", draw_plan(seed), photography, progress)


def scene_of_plan(
    name: str, plan: Plan, photography: Photography | None = None, progress: Progress | None = None
) -> Scene:
    """The scene of a plan, with its start mesh and, where the plan has them, sparse points."""
    photography = photography or plan.photography
    shown, cameras = plan.true_sheet(), plan.cameras()
    surroundings = build_surroundings(plan, np.array([camera.center for camera in cameras]))
    everything = joined([shown, surroundings])

    def build_stage() -> Stage:
        surface = clothed(everything, building_coats(plan))
        return outdoor_stage(surface, photography, np.array(plan.sun), LIGHT_STEPS)

    variant = f"{dataclasses.astuple(plan)} {package_digest(Path(__file__).parent)}"
    views = take_photos(
        name.replace(":", "_"), cameras, build_stage, shown.vertices, photography, SAMPLES, progress, variant
    )
    needs_points = plan.has_points or plan.start == "points"
    points = sfm_points(plan, everything, len(shown.faces), views) if needs_points else None
    start = build_start(plan, shown, views, points)
    given = points.sparse if points is not None and plan.has_points else None
    return Scene.build(name, start.vertices, start.faces, views, truth=start.truth, sparse_points=given)
