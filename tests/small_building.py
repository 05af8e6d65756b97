"""The plan of a small building, which runs take seconds on."""

from dataclasses import replace

from demo_scenes import Photography
from demo_scenes.building.cameras import Shoot
from demo_scenes.building.plan import Plan, draw_plan


def small_building() -> Plan:
    """Two bays of one storey with a projecting block, a pilaster and a window; 9 photos of 0.12 Mpx, noise 1."""
    plan = draw_plan(20)
    shoot = Shoot("arc", 9, (400, 300), focal=1.0, fill=0.9)
    px_per_metre = shoot.focal_px / shoot.distance(*plan.frame.extent)
    return replace(
        plan,
        shoot=shoot,
        photography=Photography(noise=1.0, exposure=0.05, seed=20),
        px_per_metre=px_per_metre,
        start="noise",
        start_px=4.0,
        has_points=False,
        trees=1,
    )
