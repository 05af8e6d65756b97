"""The panels of face splits: what a moment shows, and the legend."""

import numpy as np

from app.flips.split_film import Group, SplitFilm, SplitMesh
from app.html import number, table, text, whole
from app.palette import CURVES, REJECTED, RGB, SURFACE, solid
from fairing.triangulation.face_splits import FEWEST_JUDGES, LEAST_GAIN, SIGNIFICANCE

GROUPS: dict[Group, tuple[RGB, str]] = {
    Group.NOT_CHOSEN: (SURFACE, "not chosen, or beside split faces"),
    Group.CANDIDATE: (CURVES[3], "points lie off the face; not judged yet"),
    Group.SPLIT: (CURVES[0], "split and fitted"),
    Group.STAYS: (REJECTED, "stay: held-out points do not confirm"),
}
"""Color and meaning of each group of faces."""


def split_facts(film: SplitFilm, k: int) -> str:
    """What a moment of the splits shows: a heading, a sentence, and its numbers."""
    at = film.at(k)
    heading, sentence, rows = _candidates(film, at.number) if at.part is None else _part(film, at.number, at.part)
    if at.part is not None:
        heading = f"Part {at.place} of {len(film.rounds[at.number].judges)}: {heading}"
    return (
        f"<div class='row note'><span class='big grow'>{text(heading)}</span>"
        f"<span class='dim'>round {at.number + 1} of {len(film.rounds)}</span></div>"
        f"<div class='note'>{text(sentence)}</div><div class='note'>{table(rows)}</div>"
    )


def _candidates(film: SplitFilm, at: int) -> tuple[str, str, list[tuple[str, str]]]:
    done = film.rounds[at]
    rows = [("vertices", whole(len(done.vertices))), ("faces", whole(len(done.faces)))]
    if len(done.chosen) == 0:
        return "No candidates", "The points near the surface lie off no large face together: none is split.", rows
    rows += [
        ("faces off their points", f"<b>{whole(len(done.chosen))}</b>"),
        ("how far", f"{number(float(np.median(done.offsets)), 3)} px in the median"),
        ("parts of connected faces", whole(len(done.judges))),
        ("parts that will be split", f"<b>{whole(int(done.is_split.sum()))}</b>"),
    ]
    return (
        "Candidates",
        "Off these faces the points from every other photo lie together, farther than their uncertainty explains. Each is "
        "divided in four and fitted to these points. Then the held-out points, those from the other photos, judge each part.",
        rows,
    )


def _part(film: SplitFilm, at: int, part: int) -> tuple[str, str, list[tuple[str, str]]]:
    done = film.rounds[at]
    is_of_part = done.parts == part
    judges, (before, after) = int(done.judges[part]), done.errors[part].tolist()
    rows = [
        ("faces of the part", f"<b>{whole(int(is_of_part.sum()))}</b>"),
        ("farthest from their points", f"{number(float(done.offsets[is_of_part].max(initial=0)), 3)} px"),
        ("held-out points", whole(judges)),
    ]
    if judges:
        fall, certain = (1 - (after / before) ** 2 if before else 0.0), float(done.significance[part])
        rows += [
            ("their distance from whole faces", f"{number(before, 3)} σ"),
            ("their distance from split faces", f"<b>{number(after, 3)} σ</b>"),
            (f"fall of its square (over {100 * LEAST_GAIN:g} %)", f"{100 * fall:.0f} %"),
            (f"in standard errors (over {SIGNIFICANCE:g})", number(certain, 3)),
        ]
    if done.is_split[part]:
        return "split", "The held-out points lie clearly nearer to the split faces: they are kept.", rows
    if judges < FEWEST_JUDGES:
        sentence = f"Fewer than {FEWEST_JUDGES} held-out points: nothing confirms the split, so these faces stay."
    else:
        sentence = "The held-out points do not lie clearly nearer to the split faces, so these stay whole."
    return "stays", sentence, rows


def split_legend(mesh: SplitMesh) -> str:
    """What the colors of the faces mean, and how many there are of each."""
    counts = np.bincount(mesh.groups, minlength=len(Group)).tolist()
    rows = "".join(
        f"<div class='row'><span class='swatch' style='background:{solid(color)}'></span>"
        f"<span class='grow'>{text(meaning)}</span><span class='dim'>{whole(counts[group])}</span></div>"
        for group, (color, meaning) in GROUPS.items()
    )
    note = "σ: root mean square distance from the surface, in standard deviations of the points."
    return f"<h4>Colors</h4><div class='legend'>{rows}</div><div class='dim note'>{note}</div>"
