"""Lesson panel: the current lesson step with its text, lines of the algorithm, question and navigation buttons."""

from collections.abc import Callable

import viser

from app.debugger.actions import KEY_LABELS
from app.debugger.run_state import RunState
from app.html import button, icon, number, table, text
from app.lessons.lesson import Lesson, LessonStep, Switches
from app.lessons.player import Player, Status
from app.lessons.progress import Findings
from app.lessons.typeset import line, paragraphs
from app.page_state.page_state import PageState
from app.palette import NOW, SELECTED, START, css
from app.pictures.paper_code import LINES, listing
from app.viser_bridge.html_events import HtmlEvents, integer, press
from app.viser_bridge.html_panel import HtmlPanel

MOST_CHOICES = 6
NO_FINDINGS = Findings({}, ())
LESSON_STYLE = f"""
.ef.ef .lesson p {{ margin: 6px 0; }} .ef .lesson ul {{ margin: 4px 0; padding-left: 18px; }}
.ef .lesson b {{ color: var(--strong); font-weight: 600; }}
.ef .lesson math {{ font-family: "STIX Two Math", "Cambria Math", "Latin Modern Math", math, serif; color: var(--strong); }}
.ef .lesson math[display=block] {{ font-size: 14.5px; margin: 8px 0; overflow-x: auto; overflow-y: hidden; }}
.ef .lesson h3 {{ font-size: 14px; font-weight: 600; color: var(--strong); margin: 8px 0 2px; }}
.ef .dots {{ display: flex; gap: 4px; margin-top: 7px; }}
.ef .dots i {{ height: 4px; flex: 1; border-radius: 2px; background: var(--line); }}
.ef .dots i.done {{ background: var(--dim); }} .ef .dots i.here {{ background: {css(SELECTED)}; }}
.ef .ask {{ border-left: 2px solid {css(SELECTED)}; padding: 0 0 0 10px; margin: 8px 0; }}
.ef .ask > button {{ width: 100%; height: auto; min-height: 26px; padding: 3px 8px; justify-content: flex-start; text-align: left;
  margin-top: 4px; }}
.ef .ask > button.right {{ border-color: {css(START)}; color: {css(START)}; }}
.ef .ask > button.wrong {{ border-color: {css(NOW)}; color: {css(NOW)}; }}
.ef .aside {{ background: var(--row); border-radius: 4px; padding: 6px 8px; margin: 8px 0; }}
.ef .lessons button {{ width: 100%; height: auto; padding: 6px 10px; margin-top: 6px; display: block; text-align: left; }}
.ef .lessons button.on {{ border-color: {css(SELECTED)}; }}
"""


class LessonPanel:
    """Docked above the cells panel while a lesson is open."""

    def __init__(
        self,
        gui: viser.GuiApi,
        html_events: HtmlEvents,
        player: Player,
        open_following: Callable[[], None],
        pause: Callable[[], None],
    ) -> None:
        self._player = player
        self._events = html_events.named(
            {
                "next": press(player.next),
                "back": press(player.back),
                "resume": press(player.go_on),
                "close": press(player.close),
                "following": press(open_following),
                "pause": press(pause),
                "switch": integer(player.switch, "check box", 0, MOST_CHOICES),
                "choose": integer(player.choose, "choice", 0, MOST_CHOICES),
            }
        )
        self._panel = HtmlPanel(gui)

    def show(self, state: RunState, page_state: PageState) -> None:
        player = self._player
        lesson = player.lesson
        if lesson is None:
            self._panel.set("")
            return
        n = player.step
        step, found = lesson.steps[n], player.findings.get(n, NO_FINDINGS)
        self._panel.set(
            f"{self._head(lesson, n)}{self._aside(player.has_strayed(state, page_state))}"
            f"<div class='lesson'><h3>{text(step.title)}</h3>{paragraphs(step.text, found.numbers)}"
            f"{_listing(step)}{self._question(step, found)}{self._switches(step)}{_checked(found)}</div>"
        )

    def _head(self, lesson: Lesson, n: int) -> str:
        count, busy = len(lesson.steps), self._player.status is Status.AT_WORK
        dots = "".join(f"<i class='{'here' if k == n else 'done' if k < n else ''}'></i>" for k in range(count))
        back = button("Back", self._events("back"), hint=f"{KEY_LABELS['Page Up']} (Page Up)", enabled=n > 0)
        if n < count - 1:
            on = button(
                "Next",
                self._events("next"),
                hint=f"{KEY_LABELS['Page Down']} (Page Down)",
                css_class="main",
                enabled=not busy,
            )
        else:
            on = button("Next lesson", self._events("following"), hint="Begin the next lesson", css_class="main")
        close = button("", self._events("close"), hint="Close the lesson", icon=icon("leave"), css_class="small")
        return (
            f"<div class='row'><span class='one grow dim' title='{text(lesson.title)}'>{text(lesson.title)}</span>"
            f"<span class='dim' aria-label='step {n + 1} of {count}'>{n + 1}/{count}</span>{back}{on}{close}</div>"
            f"<div class='dots'>{dots}</div>"
        )

    def _aside(self, has_strayed: bool) -> str:
        """A notice with a button: the engine is running, was paused, failed, or the page has left the lesson step."""
        match self._player.status:
            case Status.AT_WORK:
                pause = button("Pause", self._events("pause"), hint="Pause (P)", css_class="small")
                return f"<div class='aside row'><span class='grow'>The engine is running…</span>{pause}</div>"
            case Status.CUT_SHORT:
                on = button("Continue", self._events("resume"), hint="Continue this lesson step", css_class="small")
                return f"<div class='aside row'><span class='grow'>Paused before the end of this step.</span>{on}</div>"
            case Status.FAILED:
                again = button(
                    "Try again",
                    self._events("resume"),
                    hint="Try again from the beginning of this step",
                    css_class="small",
                )
                return f"<div class='aside row'><span class='grow rejected'>{text(self._player.problem)}</span>{again}</div>"
        if not has_strayed:
            return ""
        back = button(
            "Resume lesson", self._events("resume"), hint="Resume lesson (restores this step)", css_class="small"
        )
        return f"<div class='aside row'><span class='grow'>The page has left this step.</span>{back}</div>"

    def _question(self, step: LessonStep, found: Findings) -> str:
        question = step.question
        if question is None:
            return ""
        chosen = self._player.chosen.get(self._player.step)
        choices = ""
        for n, choice in enumerate(question.choices):
            if chosen is not None and n not in (chosen, question.right):
                continue  # after an answer, only the chosen and the right choice are shown
            mark = "" if chosen is None else "right" if n == question.right else "wrong" if n == chosen else ""
            label = f"<span>{line(choice, found.numbers)}</span>"
            answer_js = self._events("choose", n)
            choices += button("", answer_js, hint=f"Answer {n + 1}", icon=label, css_class=mark, enabled=chosen is None)
        answer = "" if chosen is None else paragraphs(question.answer, found.numbers)
        return f"<div class='ask'>{paragraphs(question.text, found.numbers)}{choices}{answer}</div>"

    def _switches(self, step: LessonStep) -> str:
        """Check boxes, and the number that was measured with what is checked."""
        player, switches = self._player, step.switches
        if switches is None:
            return ""
        off, busy = player.off.get(player.step, frozenset()), player.status is not Status.THERE
        boxes = "".join(
            button(
                f"{'☐' if k in off else '☑'} {label}",
                self._events("switch", k),
                hint=f"Switch {label} {'on' if k in off else 'off'} in a branch from this step",
                css_class="chip" if k in off else "chip on",
                pressed=k not in off,
                enabled=not busy,
            )
            for k, (label, _) in enumerate(switches.options)
        )
        whole = player.measured.get((player.step, frozenset()))
        rows = [
            (_without(switches, each), _compared_with(whole, value))
            for (n, each), value in player.measured.items()
            if n == player.step
        ]
        return f"<div class='ask'><div class='row chips'>{boxes}</div>{table(rows)}</div>"


def _without(switches: Switches, off: frozenset[int]) -> str:
    """A branch in words."""
    return f"without {', '.join(switches.options[k][0] for k in sorted(off))}" if off else "with all"


def _compared_with(whole: float | None, value: float) -> str:
    """A number, and its difference from the one with all."""
    if whole is None or value == whole:
        return number(value, 3)
    sign = "+" if value > whole else "−"
    return f"{number(value, 3)} <span class='dim'>({sign}{number(abs(value - whole), 3)})</span>"


def _listing(step: LessonStep) -> str:
    """The lines of the algorithm that the step is about."""
    if step.code is None:
        return ""
    return (
        f"<div class='listing' role='figure' aria-label='Lines of fairing/paper.py'>{listing(LINES[step.code])}</div>"
    )


def _checked(found: Findings) -> str:
    """How many claims of this step hold for the current run, with the claims as a tooltip."""
    if not found.claims:
        return ""
    true = sum(holds for _, holds in found.claims)
    claims = "; ".join(
        f"{claim}: {'holds' if holds else f'does not hold here, {found.found[claim]}'}" for claim, holds in found.claims
    )
    count = f"{true} of {len(found.claims)}"
    css_class = "dim" if true == len(found.claims) else "rejected"
    return f"<p class='{css_class}' title='{text(claims)}'>✓ {count} claims verified on this run</p>"
