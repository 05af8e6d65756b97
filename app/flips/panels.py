"""The panels of a flip record: buttons, the last flip, energy plot, legend, timeline."""

import numpy as np

from app.flips.film import FlipFilm
from app.flips.scene_layers import MEANINGS
from app.html import button, icon, number, table, text
from app.palette import BACKGROUND, NOW, SELECTED, START, css, solid
from app.panels.plot_drawing import BOTTOM, HEIGHT, LEFT, RIGHT, TOP, WIDTH, frame, line_at
from app.pictures.cell_images import data_uri
from app.plot_line import Line
from app.ticks import ticks
from app.viser_bridge.html_events import Events

SPEEDS = (2, 10, 50)  # flips a second
STEP_RATES = (0.4, 1.0, 3.0)  # steps of other chapters a second, at these speeds


def buttons(events: Events, moment: int, length: int, names: tuple[str, str], *, is_playing: bool) -> str:
    """Buttons that go to other moments; for `names` see `Story.step_names`."""
    step, part = names
    at_start, at_end = moment == 0, moment == length

    def one(name: str, shape: str, event: str, enabled: bool, *, mirrored: bool = False) -> str:
        return button(
            "", events(event), hint=name, icon=icon(shape, mirrored=mirrored), css_class="grow", enabled=enabled
        )

    play = button(
        "Pause" if is_playing else "Play", events("play"), hint=f"Play the {step}s, or stop (T)",
        icon=icon("pause" if is_playing else "run"), css_class="main grow", enabled=length > 0,
    )  # fmt: skip
    return (
        f"<div class='row'>{one('To the beginning', 'start', 'start', not at_start)}{play}"
        f"{one(f'To the last {step}', 'end', 'end', not at_end)}</div>"
        f"<div class='row note'>{one(f'Back a {part} ([)', 'two', 'round_back', not at_start, mirrored=True)}"
        f"{one(f'Back one {step} (,)', 'one', 'back', not at_start, mirrored=True)}"
        f"{one(f'One {step} (.)', 'one', 'forward', not at_end)}"
        f"{one(f'On a {part} (])', 'two', 'round_on', not at_end)}</div>"
    )


def facts(film: FlipFilm, moment: int) -> str:
    """The mesh of the moment, and the flip that led to it."""
    length, energies = len(film), film.energies
    head = (
        f"<div class='big note'>Flip {moment} of {length}</div>"
        f"<div>Energy <b>{number(float(energies[moment]), 6)}</b> <span class='dim'>at the start "
        f"{number(float(energies[0]), 6)}</span></div>"
    )
    if moment == 0:
        return head + "<div class='dim note'>The start mesh: no edge has been flipped yet.</div>"
    flip = film.trace.flips[moment - 1]
    (a, b), (c, d) = flip.edge.tolist(), flip.opposite.tolist()
    loss, energy = flip.common_loss, flip.energy
    rows = [
        ("round", f"{flip.round + 1} of {int(film.rounds[-1]) + 1}"),
        ("edge", f"{a} – {b} became <b>{c} – {d}</b>"),
        ("faces", " · ".join(map(str, flip.faces.tolist()))),
        ("photos of all four faces", str(flip.n_views)),
        ("loss per pixel in them", f"{number(loss[0], 3)} → {number(loss[1], 3)}"),
        ("gain", f"<b>{number(loss[0] - loss[1], 3)}</b>"),
        ("energy of the two faces", f"{number(energy[0])} → {number(energy[1])}"),
    ]
    return f"{head}<h4>The last flip</h4>{table(rows)}"


def energy_plot(film: FlipFilm, moment: int, events: Events, begin: int) -> str:
    """The energy over the flips; a click goes there. `begin`: the moment of the record at which the film begins."""
    energies, length = film.energies, max(1, len(film))
    low, high = float(energies.min()), float(energies.max())
    margin = 0.05 * (high - low) or 1.0
    low, high = low - margin, high + margin

    def x(moments):
        return LEFT + (WIDTH - LEFT - RIGHT) * np.asarray(moments) / length

    def y(values):
        return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * (np.asarray(values) - low) / (high - low)

    line = line_at(Line(np.arange(len(energies)), energies), moment, x, y, length, NOW)
    here = f'<circle cx="{x(moment):.1f}" cy="{y(energies[moment]):.1f}" r="4" fill="{css(SELECTED)}"/>'
    press = events("jump", f"ef.moment(event,{length},{len(film)},{LEFT / WIDTH:.5f},{RIGHT / WIDTH:.5f})+{begin}")
    return (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" class="plot" role="img" aria-label="Energy plot" '
        f'onpointerdown="{text(press)}"><title>Energy of the mesh by flip. Click to go there</title>'
        f"{frame(ticks(low, high), y)}{line}{here}</svg>"
    )


def legend(film: FlipFilm, moment: int) -> str:
    """What the colours of the edges mean, and how many there are of each."""
    edges = film.edges_at(moment)
    rows = "".join(
        f"<div class='row'><span class='swatch' style='background:{solid(color)}'></span>"
        f"<span class='grow'>{text(meaning)}</span><span class='dim'>{len(getattr(edges, name))}</span></div>"
        for name, (color, meaning, _) in MEANINGS.items()
    )
    return f"<h4>Edges</h4><div class='legend'>{rows}</div>"


def strip(film: FlipFilm, moment: int | None, events: Events, speed: int, begin: int, *, has_chapters: bool) -> str:
    """Speeds, and a pixel a flip: brighter green where the loss fell more; a tick where a round begins.

    Args:
        moment: of the film; None: before the flips.
        begin: the moment of the record at which the film begins.
        has_chapters: whether there are other steps than flips, which are played slower.
    """
    speeds = "".join(
        button(
            f"{value} /s",
            events("speed", k),
            hint=f"Play {value} flips{f' or {rate:g} other steps' if has_chapters else ''} a second",
            css_class="small on" if value == speed else "small",
            pressed=value == speed,
        )
        for k, (value, rate) in enumerate(zip(SPEEDS, STEP_RATES, strict=True))
    )
    if len(film) == 0:
        return f"<div class='row tools'>{speeds}</div><div class='strip'></div>"
    gains = np.array([flip.common_loss[0] - flip.common_loss[1] for flip in film.trace.flips])
    part = 0.15 + 0.85 * np.clip(gains / max(float(np.quantile(gains, 0.98)), 1e-12), 0, 1)
    base = np.array(BACKGROUND, dtype=float) + 14
    colors = np.round(base + part[:, None] * (np.array(START) - base)).astype(np.uint8)[None]
    begins = np.flatnonzero(np.diff(film.rounds)) + 1
    marks = "".join(f"<s class='level' style='left:{100 * at / len(film):.2f}%'></s>" for at in begins.tolist())
    here = "" if moment is None else f"<i style='left:{100 * moment / len(film):.2f}%'></i>"
    click = events("jump", f"ef.step(event,{len(film)})+{begin}")
    return (
        f"<div class='row tools'>{speeds}<span class='grow'></span><span class='dim'>brighter: a larger gain; "
        f"lines: rounds</span></div><div class='strip' role='img' aria-label='Gains' onpointerdown=\"{text(click)}\">"
        f"<img src='{data_uri(colors)}' alt=''>{marks}{here}</div>"
    )
