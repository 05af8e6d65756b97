"""The options of the run, generated from their dataclasses."""

import ast
import inspect
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any

import viser

from app.controller import RunState
from app.html import text
from app.panels.html_panel import HtmlPanel
from app.view import View


class OptionsPanel:
    """Every option with its value; the pointer over a line shows what it means."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._panel = HtmlPanel(gui)
        self._shown: Any = None

    def show(self, state: RunState, view: View) -> None:
        if state.options is not self._shown:
            self._shown = state.options
            self._panel.set(_group("", state.options))


def _group(title: str, options: Any) -> str:
    meanings = field_meanings(type(options))
    rows, groups = [], []
    for field in fields(options):
        value = getattr(options, field.name)
        if is_dataclass(value):
            groups.append(_group(field.name, value))
        else:
            meaning = text(meanings.get(field.name, ""))
            rows.append(
                f"<tr title='{meaning}'><th>{text(field.name.replace('_', ' '))}</th>"
                f"<td class='n'>{text(_plain(value))}</td></tr>"
            )
    head = f"<h4>{text(title.capitalize())}</h4>" if title else ""
    return f"{head}<table>{''.join(rows)}</table>{''.join(groups)}"


def _plain(value: Any) -> str:
    if isinstance(value, tuple):
        return ", ".join(_plain(part) for part in value) if value else "none"
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:g}" if isinstance(value, float) else str(value)


@cache
def field_meanings(kind: type) -> dict[str, str]:
    """The string under each field of a dataclass, by the field's name."""
    body = ast.parse(inspect.getsource(kind).lstrip()).body[0]
    assert isinstance(body, ast.ClassDef)
    meanings = {}
    for statement, following in zip(body.body, body.body[1:], strict=False):
        if (
            isinstance(statement, ast.AnnAssign)
            and isinstance(statement.target, ast.Name)
            and isinstance(following, ast.Expr)
            and isinstance(following.value, ast.Constant)
        ):
            meanings[statement.target.id] = " ".join(str(following.value.value).split())
    return meanings
