"""Options of short runs: two levels from the first on, with few sweeps and iterations."""

from typing import Literal

from fairing.options import FairingOptions, ScheduleOptions


def two_levels(order: Literal["joint", "sequential"], *, sweeps: int, iterations: int) -> FairingOptions:
    """Options with blurs of 3.6 and 2 px."""
    options = FairingOptions(schedule=ScheduleOptions(order=order, first_level="first"))
    return options.with_levels(blur=(3.6, 2.0), max_sweeps=sweeps, max_iterations=iterations)
