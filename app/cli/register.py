"""`register`: range data aligned with the photos, and a start mesh made from it."""

from pathlib import Path

import numpy as np
from rich.console import Console

from app.cli.arguments import ALL_PHOTOS, PhotosArgument, SceneArgument
from app.cli.lines import print_line
from app.cli.triangulate import check_triangulation_output, summary_lines, triangulate_with_progress
from app.files.named_scenes import is_named
from app.files.scene_source import SceneSource
from fairing.errors import InputError
from fairing.io import read_capture, write_mesh
from fairing.io.chosen_inputs import ChosenInputs
from fairing.io.scan_file import read_matches, read_scan, write_scan
from fairing.mesh import Mesh
from fairing.registration.alignment import Registered, refine_by_closest_points, register_matches
from fairing.registration.scan_points import critical_points, seen_points
from fairing.triangulation import TriangulationOptions

SCAN_SUFFIX = ".scan.ply"
FEWEST_TARGETS = 10


def register(
    scene: SceneArgument,
    scan: Path,
    matches: Path,
    out: Path,
    spacing: float = 2.0,
    photos: PhotosArgument = ALL_PHOTOS,
) -> int:
    """Align a scan with the photos, and make a start mesh of the points at its creases and borders.

    Args:
        scan: Range data in a frame of its own: points or a mesh (.ply, .xyz, .obj, .off, .stl, .glb).
        matches: Text file of at least three points, a line each: `x y z X Y Z` (scan, world) or `x y z PHOTO u v ...`.
        out: The start mesh: .ply or .obj. Beside it go the aligned scan, the record of flips and a report.
        spacing: Distance between points at creases and borders, percent of the scan's diagonal.
    """
    return register_to_file(SceneSource.typed(scene, None, photos), scan, matches, out, spacing, Console(stderr=True))


def register_to_file(
    source: SceneSource, scan_file: Path, matches_file: Path, out: Path, spacing: float, console: Console
) -> int:
    """Align, sample and triangulate. Writes the start mesh, the record of its flips, a report, and the aligned scan.

    Args:
        spacing: distance between points at creases and borders, percent of the scan's diagonal.

    Returns:
        Exit code: 0, or 130 if it was interrupted.

    Raises:
        InputError: the input cannot be used, or the output would replace files that are not of an earlier run.
    """
    if not 0.05 <= spacing <= 20:
        raise InputError(f"--spacing: expected 0.05 to 20 percent of the scan's diagonal, found {spacing:g}")
    check_triangulation_output(out)
    if is_named(source.scene):
        scene = source.load()
        views, sparse = scene.views, scene.sparse_points
    else:
        capture = read_capture(source.scene, source.choice)
        views, sparse = capture.views, capture.sparse_points
    scan = read_scan(scan_file)
    matched = register_matches(read_matches(matches_file, views), views)
    print_line(
        console,
        f"error of the matches: {np.sqrt((matched.errors**2).mean()):.2f} px rms, {matched.errors.max():.2f} px at most",
    )
    registered = matched
    if sparse is not None and len(sparse.positions) >= FEWEST_TARGETS:
        registered = refine_by_closest_points(scan, matched.world_from_scan, sparse.positions)
        print_line(console, _change(scan, matched, registered, sparse.positions))
    points = registered.world_from_scan.apply(scan.vertices if isinstance(scan, Mesh) else scan)
    distance = spacing / 100 * float(np.linalg.norm(np.ptp(points, axis=0)))
    chosen = critical_points(points, distance)
    print_line(
        console,
        f"{len(chosen.positions)} of {len(points)} points chosen, {int(chosen.is_end.sum())} at borders of the scan",
    )
    vertices = seen_points(points, chosen.positions, views, distance)
    # The points already stand as far apart as they should.
    options = TriangulationOptions(spacing=1.0)
    done, interrupted = triangulate_with_progress(
        source, ChosenInputs(views, None), vertices, None, out, options, console
    )
    faces = scan.faces if isinstance(scan, Mesh) else None
    moved = out.with_suffix(SCAN_SUFFIX)
    if faces is not None:
        write_mesh(moved, points, faces, like=scan_file)
    else:
        write_scan(moved, points)
    for line in [*summary_lines(done), f"wrote {out}, {moved.name}"]:
        print_line(console, line)
    return 130 if interrupted else 0


def _change(scan: Mesh | np.ndarray, before: Registered, after: Registered, targets: np.ndarray) -> str:
    turned = after.world_from_scan.rotation @ before.world_from_scan.rotation.T
    angle = np.degrees(np.arccos(np.clip((np.trace(turned) - 1) / 2, -1, 1)))
    return (
        f"closest points: rotated by {angle:.2f} degrees, scaled by "
        f"{after.world_from_scan.scale / before.world_from_scan.scale:.4f}; {len(targets)} sparse points lie "
        f"{np.median(after.errors):.4g} world units from the scan (median)"
    )
