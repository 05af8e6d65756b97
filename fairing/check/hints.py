"""What speaks against a scene, and which options are worth trying, in words."""

import numpy as np

from fairing.cells.level_choice import level_for_footprint
from fairing.check.memory import memory_warning
from fairing.check.result import SceneCheck
from fairing.geometry.mesh_check import inspect_mesh
from fairing.options import FairingOptions
from fairing.scene import Scene

# Beyond these the verdict is "doubtful"; found on captures that worked and on ones made to fail.
MIN_FACES_IN_PART = 0.6
MIN_PARALLAX = 5.0
MAX_REPROJECTION = 1.5
MIN_FOOTPRINT = 8.0
MAX_BLANK = 0.3
MIN_IN_FRONT = 0.5
# Suggestions only.
MAX_EXPOSURE_RATIO = 1.5
LARGE_FOOTPRINT = 200.0
LARGE_PHOTO = 6e6

_REMEDIES = {
    "behind_camera": "they lie behind the cameras: check the axes of the cameras",
    "turned_away": "they are turned away: add photos from the other side, or turn the faces",
    "grazing": "they are seen too flat: add photos that face them",
    "outside_photo": "they lie outside the photos: check that mesh and cameras share their coordinates",
    "too_small": "they are too small in the photos: use larger photos or a coarser mesh",
    "hidden": "other faces or masks hide them: add photos, or check the mesh for faces in front",
    "degenerate": "they have no area: repair the mesh",
    "too_few_photos": "there are too few photos: add some",
}


def find_hints(check: SceneCheck) -> list[str]:
    """What speaks against the scene, in order of importance."""
    hints = [] if check.mistake is None else [f"{check.mistake}; correct the cameras"]
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
            f"faces measure {check.footprint[2]:.1f} px in the photos (median): too small to hold texture; "
            "use larger photos or a coarser mesh"
        )
    if check.parallax is not None and check.parallax < MIN_PARALLAX:
        hints.append(
            f"the photos see a face from within {check.parallax:.1f} degrees (median), so depth is hardly determined; "
            "add photos from farther aside"
        )
    blank = int(faces.is_blank.sum())
    if check.faces_in_part and blank > MAX_BLANK * check.faces_in_part:
        hints.append(
            f"{blank} of {check.faces_in_part} faces show hardly any texture, so nothing holds them; "
            "expect their inner vertices to stay where they are"
        )
    hints += [
        f"photo {view.name}: sparse points lie {view.reprojection:.1f} px (median) off where it saw them; its camera "
        f"does not fit: calibrate again, or try --leave-out {view.name}"
        for view in check.views
        if view.reprojection is not None and view.reprojection > MAX_REPROJECTION
    ]
    behind = [view.name for view in check.views if view.in_front < MIN_IN_FRONT]
    if behind:
        hints.append(
            f"{len(behind)} of {len(check.views)} photos have most of the mesh behind the camera (first: {behind[0]}); "
            "check the axes of the cameras"
        )
    unused = [view.name for view in check.views if view.faces == 0]
    if 2 * len(unused) > len(check.views):
        hints.append(f"{len(unused)} of {len(check.views)} photos see no face well enough (first: {unused[0]})")
    return hints


def find_suggestions(scene: Scene, check: SceneCheck, options: FairingOptions) -> list[str]:
    """Options and changes worth trying, and what a run will do by itself."""
    if not check.footprint:
        return []
    suggestions = []
    typical = check.footprint[2]
    blurs = options.schedule.blur
    first = level_for_footprint(typical, options)
    coarsest = "" if first == 0 else "; --schedule.start first begins with the coarsest"
    suggestions.append(
        f"faces measure {typical:.0f} px, so a run begins about level {first + 1} of {len(blurs)} (blur "
        f"{blurs[first]:g} px){coarsest}"
    )
    largest = max(options.cells.size)
    if check.footprint[4] > 1.5 * largest:
        suggestions.append(
            f"the largest face measures {check.footprint[4]:.0f} px, more than the finest cells of {largest} samples "
            "hold: a finer mesh follows the surface better"
        )
    pixels = [view.width * view.height for view in check.views]
    if typical > LARGE_FOOTPRINT and np.median(pixels) > LARGE_PHOTO:
        suggestions.append(
            f"photos of {np.median(pixels) / 1e6:.0f} Mpx are finer than this mesh needs: try --photo-scale 0.5"
        )
    if memory := memory_warning(scene, options):
        suggestions.append(memory.line)
    border = len(inspect_mesh(scene.mesh).boundary_vertices)
    if 0 < border < 0.5 * len(scene.mesh.vertices):
        suggestions.append(f"the mesh is open ({border} vertices at its border): --lock-boundary keeps its outline")
    striped = int(check.faces.is_striped.sum())
    if striped > 0.2 * check.faces_in_part:
        suggestions.append(
            f"{striped} faces show stripes in one direction only; along it --step.prior keeps them from sliding"
        )
    lights = {view.name: view.exposure for view in check.views if view.exposure}
    if lights and max(lights.values()) > MAX_EXPOSURE_RATIO * min(lights.values()):
        low, high = min(lights, key=lights.__getitem__), max(lights, key=lights.__getitem__)
        suggestions.append(
            f"the same faces are {lights[high] / lights[low]:.1f} times as bright in photo {high} as in {low}; "
            "gains do no harm, for haze or offsets try --cells.remove-bias"
        )
    unused = [view.name for view in check.views if view.faces == 0]
    if 0 < len(unused) < len(check.views):
        names = " ".join(unused[:6]) + (" ..." if len(unused) > 6 else "")
        suggestions.append(f"photos that see nothing cost time only: --leave-out {names}")
    return suggestions
