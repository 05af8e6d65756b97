"""`register`: range data brought into the frame of the photos, and from it a start mesh."""

from pathlib import Path

import numpy as np
from rich.console import Console

from app.scene_source import SceneSource
from app.triangulate_command import check_triangulation_output, summary_lines, triangulate_with_progress
from demo_scenes import is_demo
from fairing.errors import InputError
from fairing.io import read_capture, write_mesh
from fairing.io.scan_file import read_matches, read_scan, write_scan
from fairing.mesh import Mesh
from fairing.registration import Registered, refine_by_closest_points, register_matches
from fairing.scan_points import critical_points, seen_points
from fairing.triangulation import TriangulationOptions

SCAN_SUFFIX = ".scan.ply"
FEWEST_TARGETS = 10


def register_to_file(
    source: SceneSource, scan_file: Path, matches_file: Path, out: Path, spacing: float, console: Console
) -> int:
    """Register, sample and triangulate; writes the start mesh, the record of its flips, a report, and the moved scan.

    Args:
        spacing: between points where the scan bends or ends, percent of the scan's diagonal.

    Returns:
        Exit code: 0, or 130 if it was interrupted.

    Raises:
        InputError: whatever is wrong with the input, or the files would replace somebody else's.
    """
    if not 0.05 <= spacing <= 20:
        raise InputError(f"--spacing: expected 0.05 to 20 percent of the scan's diagonal, found {spacing:g}")
    check_triangulation_output(out)
    if is_demo(source.scene):
        scene = source.load()
        views, sparse = scene.views, scene.sparse_points
    else:
        capture = read_capture(source.scene, source.choice)
        views, sparse = capture.views, capture.sparse_points
    scan = read_scan(scan_file)
    matched = register_matches(read_matches(matches_file, views), views)
    _say(
        console,
        f"matched points fit within {np.sqrt((matched.errors**2).mean()):.2f} px rms, {matched.errors.max():.2f} px at most",
    )
    registered = matched
    if sparse is not None and len(sparse.positions) >= FEWEST_TARGETS:
        registered = refine_by_closest_points(scan, matched.world_from_scan, sparse.positions)
        _say(console, _change(scan, matched, registered, sparse.positions))
    points = registered.world_from_scan.apply(scan.vertices if isinstance(scan, Mesh) else scan)
    distance = spacing / 100 * float(np.linalg.norm(np.ptp(points, axis=0)))
    chosen = critical_points(points, distance)
    _say(
        console,
        f"{len(chosen.positions)} of {len(points)} points chosen, {int(chosen.is_end.sum())} where the scan ends",
    )
    vertices = seen_points(points, chosen.positions, views, distance)
    # The points already stand as far apart as they should.
    options = TriangulationOptions(spacing=1.0)
    done, interrupted = triangulate_with_progress(source, views, vertices, None, out, options, console)
    faces = scan.faces if isinstance(scan, Mesh) else None
    moved = out.with_suffix(SCAN_SUFFIX)
    if faces is not None:
        write_mesh(moved, points, faces)
    else:
        write_scan(moved, points)
    for line in [*summary_lines(done), f"wrote {out}, {moved.name}"]:
        _say(console, line)
    return 130 if interrupted else 0


def _change(scan: Mesh | np.ndarray, before: Registered, after: Registered, targets: np.ndarray) -> str:
    turned = after.world_from_scan.rotation @ before.world_from_scan.rotation.T
    angle = np.degrees(np.arccos(np.clip((np.trace(turned) - 1) / 2, -1, 1)))
    return (
        f"closest points: turned by {angle:.2f} degrees, scaled by "
        f"{after.world_from_scan.scale / before.world_from_scan.scale:.4f}; {len(targets)} sparse points lie "
        f"{np.median(after.errors):.4g} world units from the scan (median)"
    )


def _say(console: Console, line: str) -> None:
    console.print(line, highlight=False, soft_wrap=True, markup=False)
