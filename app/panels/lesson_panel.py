"""Lesson panel: the current lesson step with its text, pseudo-code line, question and navigation buttons."""

from collections.abc import Callable

import viser

from app.debugger.actions import KEY_LABELS
from app.debugger.run_state import RunState
from app.html import button, icon, text
from app.lessons.lesson import Lesson, LessonStep
from app.lessons.player import Findings, Player, Status
from app.lessons.pseudo_code import LINES
from app.lessons.typeset import line, paragraphs
from app.page_state.page_state import PageState
from app.palette import NOW, SELECTED, START, css
from app.viser_bridge.html_events import HtmlEvents, integer, press
from app.viser_bridge.html_panel import HtmlPanel

MOST_CHOICES = 6
LINES_SHOWN = 3  # lines of pseudo-code; the full listing would push the text out of the panel
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
.ef .listing {{ background: var(--well); border: 1px solid var(--line); border-radius: 4px; padding: 4px 0; margin: 8px 0; }}
.ef .listing code {{ display: block; padding: 0 8px; font-size: 11px; line-height: 1.5; white-space: pre; overflow-x: hidden;
  color: var(--dim); }}
.ef .listing code.at {{ color: var(--strong); background: var(--row); box-shadow: inset 2px 0 {css(SELECTED)}; }}
.ef .ask {{ border-left: 2px solid {css(SELECTED)}; padding: 0 0 0 10px; margin: 8px 0; }}
.ef .ask button {{ width: 100%; height: auto; min-height: 26px; padding: 3px 8px; justify-content: flex-start; text-align: left;
  margin-top: 4px; }}
.ef .ask button.right {{ border-color: {css(START)}; color: {css(START)}; }}
.ef .ask button.wrong {{ border-color: {css(NOW)}; color: {css(NOW)}; }}
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
            f"{_listing(step.code)}{self._question(step, found)}{_checked(found)}</div>"
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


def _listing(at: str | None) -> str:
    """The highlighted line of pseudo-code and its neighbours."""
    if at is None:
        return ""
    here = list(LINES).index(at)
    first = min(max(here - 1, 0), len(LINES) - LINES_SHOWN)
    shown = list(LINES.items())[first : first + LINES_SHOWN]
    rows = "".join(f"<code class='{'at' if name == at else ''}'>{text(row)}</code>" for name, row in shown)
    return f"<div class='listing' role='figure' aria-label='Pseudo-code'>{rows}</div>"


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
