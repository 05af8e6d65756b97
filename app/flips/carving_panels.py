"""The panels of a carving: what a moment shows, the legend, and the terms of a selected tetrahedron."""

from collections.abc import Sequence

import numpy as np

from app.flips.drawing import MESHES, Drawing, cut_costs, facets_left
from app.flips.section import DIRECTIONS, Section
from app.flips.story import Chapter, Story
from app.flips.votes import CLEAR, UNDECIDED
from app.html import button, icon, number, photo_title, table, text, whole
from app.palette import CURVES, SELECTED, css, solid
from app.panels.choice import choice
from app.viser_bridge.html_events import Events
from fairing.triangulation import Carving, Fate, SightCosts

Rows = list[tuple[str, str]]


def carving_facts(story: Story, moment: int, drawing: Drawing) -> str:
    """What the moment shows: a heading, a sentence, and its numbers."""
    extent, k = story.at(moment)
    assert story.carving is not None
    tell = {
        Chapter.POINTS: _points,
        Chapter.TETRAHEDRA: _tetrahedra,
        Chapter.RAYS: _rays,
        Chapter.CUT: _cut if k == 0 else _facets,
        Chapter.SEEN: _seen,
        Chapter.DECIMATION: _decimation,
    }[extent.chapter]
    heading, sentence, rows = tell(story, story.carving, k, drawing)
    step = f"<span class='dim'>step {k + 1} of {extent.count}</span>" if extent.count > 1 else ""
    return (
        f"<div class='row note'><span class='big grow'>{text(heading)}</span>{step}</div>"
        f"<div class='note'>{text(sentence)}</div><div class='note'>{table(rows)}</div>"
    )


def _points(story: Story, carving: Carving, k: int, drawing: Drawing) -> tuple[str, str, Rows]:
    n, new = len(drawing.points) + len(drawing.new_points), len(drawing.new_points)
    rows = [("points so far", f"<b>{whole(n)}</b>"), ("points in the end", whole(carving.mesh.n_points))]
    if k == 0:
        return "Photos", "Photos with known cameras: all that there is. Each step adds the points of one photo.", rows
    rows.insert(0, ("new points", whole(new)))
    if k == len(carving.photos):
        rows += [(f"left out: {reason}", whole(count)) for reason, count in carving.left_out.items()]
    name = photo_title(k - 1, carving.photos[k - 1])
    return (
        f"Points of photo {name}",
        "Places that were found in several photos, where their lines of sight meet. The points that this photo is the first to "
        "see are yellow.",
        rows,
    )


def _tetrahedra(story: Story, carving: Carving, k: int, drawing: Drawing) -> tuple[str, str, Rows]:
    inner = ~carving.at_box
    rows = [
        ("points", whole(carving.mesh.n_points)),
        ("tetrahedra between points", f"<b>{whole(int(inner.sum()))}</b>"),
        ("tetrahedra around them, up to the cameras", whole(int((~inner).sum()))),
    ]
    return (
        "Delaunay tetrahedra",
        "They fill the space between the points; no circumsphere holds another point. Each is either inside the object or outside. "
        "The surface will consist of facets between the two kinds.",
        rows,
    )


def _rays(story: Story, carving: Carving, k: int, drawing: Drawing) -> tuple[str, str, Rows]:
    of_photo = np.bincount(carving.lines[:, 1], minlength=len(carving.photos))
    counts = drawing.counts
    rows = [
        ("lines of sight of this photo", whole(int(of_photo[k]))),
        ("lines so far", whole(int(of_photo[: k + 1].sum()))),
        ("carved away so far", f"<b>{whole(counts['clearly outside'] + counts['outside'])}</b> tetrahedra"),
        ("voted inside", whole(counts["clearly inside"] + counts["inside"])),
        ("undecided", whole(counts["none"])),
    ]
    return (
        f"Rays of photo {photo_title(k, carving.photos[k])}",
        "The photo sees its points, so nothing stands between: every tetrahedron that a line of sight crosses gets a vote for "
        "outside, the one just behind its point a vote for inside. Votes near the point count less, since it is uncertain.",
        rows,
    )


def _cut(story: Story, carving: Carving, k: int, drawing: Drawing) -> tuple[str, str, Rows]:
    interrupted, hollow, quality = carving.cut_value
    rows = [
        ("value of the cut", f"<b>{number(interrupted + hollow + quality)}</b>"),
        ("lines of sight interrupted", number(interrupted)),
        ("points with outside behind them", number(hollow)),
        ("quality of facets", number(quality)),
        ("tetrahedra inside", whole(drawing.counts["cut inside"])),
        ("tetrahedra outside", whole(drawing.counts["cut outside"])),
    ]
    return (
        "Minimum cut",
        "Inside and outside are divided so that the violated votes and the facets between cost least. Undecided tetrahedra go "
        "where the surface becomes cheapest.",
        rows,
    )


def _facets(story: Story, carving: Carving, k: int, drawing: Drawing) -> tuple[str, str, Rows]:
    lines, quality = cut_costs(carving).sum(axis=0).tolist()
    rows = [
        ("facets", f"<b>{whole(len(carving.fates))}</b>"),
        ("their lines of sight", number(lines)),
        ("their quality", number(quality)),
        ("that interrupt a line", whole(int((cut_costs(carving)[:, 0] > UNDECIDED).sum()))),
    ]
    return (
        "Facets of the cut",
        "The facets between inside and outside are a closed surface. Their color is what the cut pays for each: lines of sight "
        "that it interrupts, and a facet whose circumspheres do not suit a surface.",
        rows,
    )


def _seen(story: Story, carving: Carving, k: int, drawing: Drawing) -> tuple[str, str, Rows]:
    fate = story.fates[k]
    removed = int((carving.fates == fate).sum())
    sentence = {
        Fate.UNSEEN: "No photo sees these faces whole and from outside. They close the surface where nothing is known, so they "
        "are left out.",
        Fate.LONG: "These faces are far longer than usual: they bridge gaps between points.",
        Fate.SMALL_COMPONENT: "These parts hang together with nothing: mistaken points, mostly.",
    }[fate]
    rows = [("faces left out", f"<b>{whole(removed)}</b>"), ("faces that stay", whole(facets_left(story, k)))]
    return f"Faces {fate.text}", sentence, rows


def _decimation(story: Story, carving: Carving, k: int, drawing: Drawing) -> tuple[str, str, Rows]:
    vertices, faces = carving.decimated[k]
    rows = [
        ("vertices", f"<b>{whole(len(vertices))}</b>"),
        ("faces", whole(len(faces))),
        ("vertices of the start mesh", whole(len(story.film.trace.vertices))),
    ]
    if k == 0:
        return (
            "The seen surface",
            "What remains has a vertex at every point: more and smaller faces than photos can judge.",
            rows,
        )
    return (
        "Decimation",
        "Edges collapse, first those where the surface changes least. Vertices stay where it bends.",
        rows,
    )


def carving_legend(drawing: Drawing) -> str:
    """What the colors of triangles or points mean, and how many there are of each."""
    entries = [(*MESHES[name], count) for name, count in drawing.counts.items()]
    rows = [
        f"<div class='row'><span class='swatch' style='background:{solid(color)}'></span>"
        f"<span class='grow'>{text(meaning)}</span><span class='dim'>{whole(count)}</span></div>"
        for color, meaning, count in entries or [(SELECTED, "points that have just appeared", len(drawing.new_points))]
    ]
    return f"<h4>Colors</h4><div class='legend'>{''.join(rows)}</div>"


def section_choice(section: Section, events: Events) -> str:
    """Buttons for the direction from which the section is seen."""
    options = {value: (label, events("section", k)) for k, (value, label) in enumerate(DIRECTIONS.items())}
    return f"<h4>Section</h4><div class='labels-above'>{choice(options, section.direction, 'Section')}</div>"


def tetrahedron_terms(
    carving: Carving, tetrahedron: int | None, sums: SightCosts, n_lines: int, *, is_cut: bool, events: Events
) -> str:
    """The terms of the selected tetrahedron and of its facets, in lines of sight.

    Args:
        sums: the votes so far.
        n_lines: number of the lines of sight so far that pass through it.
        is_cut: whether the division into inside and outside is known.
    """
    if tetrahedron is None:
        return "<h4>Tetrahedron</h4><div class='dim'>Click one in the 3D view to see its votes and the costs of its facets.</div>"
    mesh = carving.mesh
    outside, inside = float(sums.passing[tetrahedron]), float(sums.inside[tetrahedron])
    rows: Rows = [
        ("lines of sight through it", str(n_lines)),
        ("votes for outside", number(outside, 3)),
        ("points just before it (to the sink)", number(inside, 3)),
        (
            "camera in it (to the source)",
            "yes: outside at any cost" if (mesh.of_cameras == tetrahedron).any() else "none",
        ),
        ("votes say", f"<b>{_verdict(outside - inside)}</b>"),
    ]
    if is_cut:
        rows.append(("the cut says", f"<b>{_side(bool(carving.is_outside[tetrahedron]))}</b>"))
    back = mesh.across(sums.crossing, np.zeros(sums.crossing.shape))[tetrahedron]
    facets = []
    for k, beyond in enumerate(mesh.neighbours[tetrahedron].tolist()):
        is_surface = is_cut and beyond >= 0 and carving.is_outside[tetrahedron] != carving.is_outside[beyond]
        name = (
            button(str(beyond), events("tetrahedron", beyond), hint=f"Select tetrahedron {beyond}", css_class="link")
            if beyond >= 0 and not carving.at_box[beyond]
            else "around"
        )
        costs = (sums.crossing[tetrahedron, k], back[k], carving.facet_costs[tetrahedron, k])
        cells = "".join(f"<td class='n'>{number(float(cost), 3)}</td>" for cost in costs)
        mark = f" style='color:{css(SELECTED)}'" if is_surface else ""
        facets.append(f"<tr{mark}><td>{name}{' · cut' if is_surface else ''}</td>{cells}</tr>")
    head = "".join(
        f"<th class='n'>{name}</th>" for name in ("if only this<br>is outside", "if only that<br>is outside", "quality")
    )
    deselect = button("", events("deselect"), hint="Deselect", icon=icon("leave"), css_class="small")
    return (
        f"<div class='row'><h4 class='grow'>Tetrahedron {tetrahedron}</h4>{deselect}</div>{table(rows)}"
        f"<table class='pulls note'><tr><th>facet to</th>{head}</tr>{''.join(facets)}</table>"
        "<div class='dim note'>Costs of a facet as surface, in lines of sight.</div>"
    )


def _verdict(balance: float) -> str:
    if abs(balance) <= UNDECIDED:
        return "nothing"
    return ("clearly " if abs(balance) >= CLEAR else "") + _side(balance > 0)


def _side(is_outside: bool) -> str:
    return "outside" if is_outside else "inside"


def chapter_band(story: Story, moment: int, events: Events) -> str:
    """The chapters side by side; pressed, one is gone to."""
    now, _ = story.at(moment)
    # Widths are no times: of hundreds of flips and a single cut, both can be hit.
    widths = np.sqrt([extent.count + 8 for extent in story.extents])
    ends = 100 * np.cumsum(widths) / widths.sum()
    parts = []
    for extent, end, width, color in zip(
        story.extents, ends, 100 * widths / widths.sum(), _band_colors(story.extents), strict=True
    ):
        place = f"left:{end - width:.2f}%;width:{width:.2f}%;background:{css(color, 0.3)};border-color:{css(color)}"
        name = text(extent.chapter.value)
        hint = text(f"{extent.chapter.value}: {extent.count} steps. Click to go to its beginning.")
        parts.append(
            f"<div class='stage{' now' if extent is now else ''}' role='listitem' aria-label='{name}' title='{hint}' "
            f'style="{place}" onpointerdown="{text(events("jump", extent.begin))}"><span>{name}</span></div>'
        )
    k = story.extents.index(now)
    part = (moment - now.begin + 0.5) / now.count
    at = ends[k] - 100 * widths[k] / widths.sum() * (1 - part)
    mark = f"<i style='position:absolute;top:-2px;bottom:-2px;width:2px;background:{css(SELECTED)};left:{at:.2f}%'></i>"
    return (
        f"<div class='stages one' role='list' aria-label='Chapters' style='margin-top:6px'>{''.join(parts)}{mark}</div>"
    )


def _band_colors(extents: Sequence[object]) -> list[tuple[int, int, int]]:
    return [CURVES[k % len(CURVES)] for k in range(len(extents))]
