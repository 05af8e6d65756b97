"""`demos --scan`: the demo `facade` in the form a scan is usually delivered: photos, sparse points, an unregistered scan."""

from pathlib import Path

from rich.console import Console

from app.cli.lines import print_line
from app.cli.loading import load_with_progress
from app.files.scene_source import SceneSource
from fairing.io import locked_output_folder
from fairing.io.atomic import write_atomically
from fairing.io.convert import write_capture
from fairing.io.scan_file import write_scan

SCAN, MATCHES = "scan/scan.ply", "scan/matches.txt"


def write_demo_scan(out: Path, console: Console) -> int:
    """Write the capture and the scan beside it; returns the exit code.

    Raises:
        InputError: the folder holds something else, or cannot be written.
    """
    from demo_scenes.range_data.scan import scan_of  # its packages take a while to import

    with locked_output_folder(out):
        scene = load_with_progress(SceneSource("facade"), console)
        scanned = scan_of(scene)
        write_capture(out, "scene.json", scene.views, scanned.sparse_points)
        (out / SCAN).parent.mkdir(exist_ok=True)
        write_scan(out / SCAN, scanned.scan)
        write_atomically(out / MATCHES, lambda file: file.write(("\n".join(scanned.matches) + "\n").encode()))
    print_line(
        console,
        f"wrote {out}: {len(scene.views)} photos, {len(scanned.sparse_points.positions)} sparse points, {SCAN} of "
        f"{len(scanned.scan)} points, {MATCHES}; next:\n"
        f"eigenfairing register {out} --scan {out / SCAN} --matches {out / MATCHES} --out start.ply\n"
        f"eigenfairing fair {out} --mesh start.ply --out run",
    )
    return 0
