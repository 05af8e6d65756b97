"""What several test processes would compile and render at the same time, made once beforehand: `python -m tests.first_uses`.

Beside it, `app.debugger.engine_compiler` compiles what a run and its page need.
"""

import numpy as np

from demo_scenes import load_demo
from demo_scenes.demos import DEMOS
from fairing.judge.render import Renderer
from fairing.triangulation import TriangulationOptions, start_mesh
from tests.bodies import AROUND, faces_of_sight, points_of
from tests.small_scene import corner_scene
from tests.terrain_scene import seen_points


def main() -> None:
    """Photos of the demos, a start mesh around a body, and a model seen through a camera."""
    for name in DEMOS:
        load_demo(name)
    points, normals = points_of("sphere", 3000, np.random.default_rng(1))
    start_mesh(AROUND, seen_points(points, faces_of_sight(points, normals), AROUND), TriangulationOptions())
    scene = corner_scene()
    Renderer(scene, scene.mesh.vertices).render(0)


if __name__ == "__main__":
    main()
