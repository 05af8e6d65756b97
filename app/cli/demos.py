"""`demos`: the list of demo scenes."""

from pathlib import Path

from rich.console import Console

from app.cli.demo_scan import write_demo_scan
from app.cli.lines import print_line
from app.files.named_scenes import other_names
from demo_scenes import BUILDING, DEMOS


def demos(scan: Path | None = None) -> int:
    """List the scenes that come with the program, and those of installed packages.

    Args:
        scan: Write the demo `facade` to this folder with an unregistered scan, as an exercise for `register`.
    """
    console = Console()
    if scan is not None:
        return write_demo_scan(scan, console)
    for demo in [*DEMOS.values(), BUILDING]:
        print_line(console, f"{demo.name:15}{demo.description}")
    for names in other_names():
        print_line(console, f"{names}: of an installed package")
    return 0
