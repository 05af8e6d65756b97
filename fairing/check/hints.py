"""Hints and suggestions of the capture check, in words."""

import numpy as np

from fairing.cells.level_choice import level_for_footprint
from fairing.check.memory import memory_warning
from fairing.check.result import SceneCheck
from fairing.geometry.mesh_check import inspect_mesh
from fairing.options import FairingOptions
from fairing.scene import Scene

# Beyond these limits the verdict is "doubtful"; chosen on captures that worked and on captures made to fail.
MIN_FACES_IN_PART = 0.6  # of all faces
MIN_PARALLAX = 5.0  # degrees
MAX_REPROJECTION = 1.5  # px, of points given with the capture
MAX_OWN_REPROJECTION = (
    0.7  # px, of points found in the photos, whose errors beyond 1 px are dropped (ledger: own points judge)
)
MIN_OWN_SHARE = 0.1  # of the median photo's points found in the photos (ledger: own points judge)
MAX_CORRECTION = 0.7  # px, median over the photos (ledger: check of cameras)
MAX_PHOTO_CORRECTION, TIMES_MEDIAN = (
    1.5,
    3.0,
)  # of a photo: px, and in medians over the photos (ledger: check of cameras)
MIN_FOOTPRINT = 8.0  # px
MAX_BLANK = 0.3  # of the faces that take part
MIN_IN_FRONT = 0.5  # of the vertices
# Limits of suggestions, which do not change the verdict.
MAX_EXPOSURE_RATIO = 1.5
LARGE_FOOTPRINT = 200.0  # px
LARGE_PHOTO = 6e6  # px

_REMEDIES = {
    "behind_camera": "they lie behind the cameras: check the axes of the cameras",
    "turned_away": "they face away from the cameras: add photos from the other side, or flip the faces",
    "grazing": "they are seen at grazing angles: add photos that face them",
    "outside_photo": "they lie outside the photos: check that mesh and cameras share a coordinate system",
    "too_small": "they are too small in the photos: use larger photos or a coarser mesh",
    "hidden": "other faces or masks hide them: add photos, or check the mesh for wrong faces in front",
    "degenerate": "they have no area: repair the mesh",
    "too_few_photos": "there are too few photos: add photos",
}


def is_off_alone(correction: float, median: float) -> bool:
    """Whether the camera of a photo is off by more than those of the others; correction of the photo, median of all, px."""
    return correction > max(MAX_PHOTO_CORRECTION, TIMES_MEDIAN * median)


def _wrong_cameras(check: SceneCheck) -> list[str]:
    """Hints about what refinement of the cameras found."""
    cameras = check.cameras
    if cameras is None:
        return []
    hints = [cameras.lens_note] if cameras.lens_note else []
    if (
        cameras.correction > MAX_CORRECTION and not cameras.lens_note
    ):  # through a distorted photo every pose looks wrong
        hints.append(
            f"the cameras are off by {cameras.correction:.1f} px (median over the photos): a run corrects them, and held-out "
            f"points then lie {cameras.error_after:.2f} px from their observations instead of {cameras.error_before:.2f} px; "
            "calibrate again for a better result"
        )
    hints += [
        f"photo {view.name}: its camera is off by {view.correction:.1f} px, more than the others; a run corrects it"
        for view in check.views
        if view.correction is not None
        and is_off_alone(view.correction, cameras.correction)
        and view.name not in cameras.misfits
    ]
    hints += [
        f"photo {name}: its camera does not fit those of the others, and no correction was found: calibrate again, or try "
        f"--leave-out {name}"
        for name in cameras.misfits
    ]
    return hints


def find_hints(check: SceneCheck) -> list[str]:
    """Problems of the scene and their remedies, in order of importance."""
    hints = [] if check.mistake is None else [f"{check.mistake}; correct the cameras"]
    if check.placement.verdict == "elsewhere":
        hints.append(check.placement.line)
    hints += _wrong_cameras(check)
    faces = check.faces
    out = check.n_faces - check.faces_in_part
    if out > (1 - MIN_FACES_IN_PART) * check.n_faces:
        reasons = [reason for reason in faces.reason if reason]
        main = max(sorted(set(reasons)), key=reasons.count)
        hints.append(
            f"{out} of {check.n_faces} faces are seen by fewer than 3 photos, mostly because {_REMEDIES[main]}"
        )
    if check.footprint and check.footprint[2] < MIN_FOOTPRINT:
        hints.append(
            f"faces measure {check.footprint[2]:.1f} px in the photos (median), too small for texture: "
            "use larger photos or a coarser mesh"
        )
    if check.parallax is not None and check.parallax < MIN_PARALLAX:
        hints.append(
            f"the parallax of a face is {check.parallax:.1f} degrees (median), so depth is poorly determined: "
            "add photos from more distant positions"
        )
    blank = int(faces.is_blank.sum())
    if check.faces_in_part and blank > MAX_BLANK * check.faces_in_part:
        hints.append(
            f"{blank} of {check.faces_in_part} faces have almost no texture: "
            "expect the vertices inside such regions to stay in place"
        )
    largest = MAX_OWN_REPROJECTION if check.points == "own" else MAX_REPROJECTION
    hints += [
        f"photo {view.name}: the reprojection error of the sparse points is {view.reprojection:.1f} px (median), so its "
        f"camera does not fit: calibrate again, or try --leave-out {view.name}"
        for view in check.views
        if view.reprojection is not None and view.reprojection > largest
    ]
    if check.points == "own":
        hints += _photos_with_few_points(check)
    behind = [view.name for view in check.views if view.in_front < MIN_IN_FRONT]
    if behind:
        hints.append(
            f"{len(behind)} of {len(check.views)} photos have most of the mesh behind the camera (first: {behind[0]}): "
            "check the axes of the cameras"
        )
    unused = [view.name for view in check.views if view.faces == 0]
    if 2 * len(unused) > len(check.views):
        hints.append(f"{len(unused)} of {len(check.views)} photos see no face well enough (first: {unused[0]})")
    return hints


def _photos_with_few_points(check: SceneCheck) -> list[str]:
    """Photos that show hardly any of the points found in the photos: these agree with the cameras of the others."""
    median = float(np.median([view.observations for view in check.views]))
    return [
        f"photo {view.name}: it shows {view.observations} of the points found in the photos, the median photo "
        f"{median:.0f}: its camera does not fit, or it overlaps little with the others; calibrate again, or try "
        f"--leave-out {view.name}"
        for view in check.views
        if view.observations < MIN_OWN_SHARE * median
    ]


def find_suggestions(scene: Scene, check: SceneCheck, options: FairingOptions) -> list[str]:
    """Options worth trying, changes of the input worth making, and the level at which a run starts."""
    if not check.footprint:
        return []
    suggestions = []
    typical = check.footprint[2]
    first = level_for_footprint(typical, options)
    coarsest = "" if first == 0 else "; --schedule.first-level first starts at the coarsest"
    suggestions.append(
        f"faces measure {typical:.0f} px, so a run starts at about level {first + 1} of {options.n_levels} (blur "
        f"{options.levels[first].blur:g} px){coarsest}"
    )
    largest = max(level.size for level in options.levels)
    if check.footprint[4] > 1.5 * largest:
        suggestions.append(
            f"the largest face measures {check.footprint[4]:.0f} px, more than the {largest} samples of the finest cells: "
            "a finer mesh follows the surface better"
        )
    pixels = [view.width * view.height for view in check.views]
    if typical > LARGE_FOOTPRINT and np.median(pixels) > LARGE_PHOTO:
        suggestions.append(
            f"photos of {np.median(pixels) / 1e6:.0f} Mpx have more resolution than this mesh needs: try --photo-scale 0.5"
        )
    if memory := memory_warning(scene, options):
        suggestions.append(memory.line)
    border = len(inspect_mesh(scene.mesh).boundary_vertices)
    if 0 < border < 0.5 * len(scene.mesh.vertices):
        suggestions.append(f"the mesh is open ({border} boundary vertices): --lock-boundary preserves its outline")
    striped = int(check.faces.is_striped.sum())
    if striped > 0.2 * check.faces_in_part:
        suggestions.append(
            f"{striped} faces have texture in one direction only: a smaller --step.start-sigma keeps them from sliding along it"
        )
    lights = {view.name: view.exposure for view in check.views if view.exposure}
    if lights and max(lights.values()) > MAX_EXPOSURE_RATIO * min(lights.values()):
        low, high = min(lights, key=lights.__getitem__), max(lights, key=lights.__getitem__)
        suggestions.append(
            f"the same faces are {lights[high] / lights[low]:.1f} times as bright in photo {high} as in {low}: "
            "a gain is harmless; for haze or offsets try --cells.remove-bias"
        )
    unused = [view.name for view in check.views if view.faces == 0]
    if 0 < len(unused) < len(check.views):
        names = " ".join(unused[:6]) + (" ..." if len(unused) > 6 else "")
        suggestions.append(f"photos that see no face only cost time: --leave-out {names}")
    return suggestions
