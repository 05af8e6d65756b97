"""The commands that write files and end: everything but the debugger."""

from collections.abc import Callable, Sequence

from app.cli.arguments import chosen_preset
from app.cli.cameras import cameras
from app.cli.check import check
from app.cli.compare import compare
from app.cli.convert import convert
from app.cli.demos import demos
from app.cli.docs import docs
from app.cli.experiment import experiment
from app.cli.export import export
from app.cli.fair import fair_command
from app.cli.points import points
from app.cli.register import register
from app.cli.texture import texture
from app.cli.triangulate import triangulate_command


def batch_commands(arguments: Sequence[str]) -> dict[str, Callable[..., int]]:
    """All batch commands by name; the defaults of `fair` depend on the preset among the arguments."""
    return {
        "fair": fair_command(chosen_preset(arguments)),
        "cameras": cameras,
        "check": check,
        "convert": convert,
        "texture": texture,
        "triangulate": triangulate_command,
        "points": points,
        "register": register,
        "export": export,
        "compare": compare,
        "demos": demos,
        "docs": docs,
        "experiment": experiment,
    }
