"""Excerpts of the paper's algorithm: lines of `fairing.paper`, which lessons and the iteration page show beside what happens."""

import ast
import inspect
from collections.abc import Callable
from functools import cache
from textwrap import dedent
from typing import NamedTuple

from app.html import text
from fairing import paper


class Excerpt(NamedTuple):
    """Consecutive lines of a function, without its docstring.

    Attributes:
        function: of `fairing.paper`.
        first, last: how the first of the lines, and the last one, begin; empty: the first and the last of the body.
        equations: their numbers in the paper; empty where it has none.
        section: number of the paper's section that describes lines without an equation; None for none.
    """

    function: Callable[..., object]
    first: str = ""
    last: str = ""
    equations: tuple[int, ...] = ()
    section: int | None = None

    @property
    def title(self) -> str:
        """The function with its parameters, and where the paper has it."""
        place = f", section {self.section}" if self.section is not None else ""
        if self.equations:
            *others, last = map(str, self.equations)
            place = f", Eq. {', '.join(others)}{' and ' if others else ''}{last}"
        return f"{self.function.__name__}({', '.join(inspect.signature(self.function).parameters)}){place}"

    @property
    def lines(self) -> tuple[str, ...]:
        """The lines, without their common indentation.

        Raises:
            ValueError: the function has no such lines.
        """
        return _lines(self)


@cache
def _lines(excerpt: Excerpt) -> tuple[str, ...]:
    body = _body(excerpt.function)
    first = _index(body, excerpt.first, excerpt) if excerpt.first else 0
    last = first + _index(body[first:], excerpt.last, excerpt) if excerpt.last else len(body) - 1
    return tuple(dedent("\n".join(body[first : last + 1])).splitlines())


def listing(excerpt: Excerpt) -> str:
    """HTML of an excerpt: its title, then a row for each line; the style sheet indents what does not fit on one."""
    rows = "".join(
        f"<code style='--indent:{len(row) - len(row.lstrip())}ch'>{text(row.lstrip())}</code>" for row in excerpt.lines
    )
    return f"<span>{text(excerpt.title)}</span>{rows}"


def _index(lines: list[str], wanted: str, excerpt: Excerpt) -> int:
    found = [k for k, line in enumerate(lines) if line.strip().startswith(wanted)]
    if not found:
        raise ValueError(f"{excerpt.function.__name__}: no line begins with {wanted!r}")
    return found[0]


def _body(function: Callable[..., object]) -> list[str]:
    """The lines of a function below its docstring."""
    source = inspect.getsource(function)
    definition = ast.parse(source).body[0]
    assert isinstance(definition, ast.FunctionDef)
    after_docstring = 1 if ast.get_docstring(definition) else 0
    return source.splitlines()[definition.body[after_docstring].lineno - 1 :]


LINES: dict[str, Excerpt] = {
    "level": Excerpt(paper.fair_by_the_paper, "for sigma_smooth in", "photos = "),
    "visible": Excerpt(paper.begin_sweep, "found = ", "seen[seen.sum"),
    "scale": Excerpt(paper.begin_sweep, "largest = ", "sweep.sigma[face] = "),
    "cells": Excerpt(paper.warp_to_cell, "corners, _ = ", "values, slopes = "),
    "eigenspace": Excerpt(paper.residual, "U = ", "c = "),
    "residual": Excerpt(paper.residual, "c = ", "return ", (6,)),
    "norm": Excerpt(paper.rho, "return ", "return "),
    "weight": Excerpt(paper.secant, "return ", "return ", (9,)),
    "energy": Excerpt(paper.face_energy, "return ", "return ", (1,)),
    "displacement": Excerpt(paper.pixel_displacement, "r, t = ", "return ", (10,)),
    "field": Excerpt(paper.cell_displacement, "return ", "return ", (11,)),
    "jacobian": Excerpt(paper.residual_derivative, "return ", "return ", (5, 6)),
    "equations": Excerpt(paper.gauss_newton, "H = ", "return ", (7, 8)),
    "solve": Excerpt(paper.solve, "values, vectors = ", "return ", (9,)),
    "accept": Excerpt(paper.fair_vertex, "if energy_after > energy", "vertices, energy, damping = "),
    "stop": Excerpt(paper.fair_by_the_paper, "moved = ", "break"),
}
"""By the name that a lesson step gives; in the order of an iteration."""

CODE: dict[str, tuple[Excerpt, ...]] = {
    "warp": (Excerpt(paper.warp_to_cell, section=3),),
    "eigenspace": (Excerpt(paper.residual, last="c = ", equations=(1,)),),
    "residual": (Excerpt(paper.residual, "return ", equations=(6,)),),
    "weights": (
        Excerpt(paper.begin_sweep, "largest = ", "sweep.sigma[face] = ", section=4),
        Excerpt(paper.secant, equations=(9,)),
    ),
    "jacobian": (
        Excerpt(paper.residual_derivative, equations=(5, 6)),
        Excerpt(paper.cell_displacement, equations=(11,)),
        Excerpt(paper.pixel_displacement, equations=(10,)),
    ),
    "normal": (
        Excerpt(paper.gauss_newton, equations=(7, 8, 9)),
        Excerpt(paper.fairing_step, "H_face, g_face", "H, g ="),
    ),
    "solve": (Excerpt(paper.solve, equations=(9,)),),
    "limit": (Excerpt(paper.fair_vertex, "by_photo = ", "after[vertex]"),),
    "accept": (
        Excerpt(paper.face_energy, equations=(1, 2, 3)),
        Excerpt(paper.fair_vertex, "energy_after = ", "vertices, energy, damping = "),
    ),
}
"""By part of an iteration, see `app.page_state.cells_state.PARTS`."""
