"""Markup of a lesson's texts: paragraphs, question, pseudo-code and claims, typeset as in the debugger."""

from typing import Any

from app.html import text
from app.lessons.lesson import LessonStep, Question
from app.lessons.player import Findings
from app.lessons.pseudo_code import LINES
from app.lessons.typeset import line, paragraphs


def step_texts(step: LessonStep, found: Findings) -> dict[str, Any]:
    """Title, markup of text and pseudo-code, question, and claims of a step."""
    return {
        "title": step.title,
        "text": paragraphs(step.text, found.numbers),
        "code": step.code,
        "question": None if step.question is None else _question(step.question, found.numbers),
        "claims": [claim for claim, _ in found.claims],
    }


def listing() -> str:
    """The pseudo-code; each line has its name as an attribute."""
    return "".join(f"<code data-line='{name}'>{text(row)}</code>" for name, row in LINES.items())


def _question(question: Question, numbers: dict[str, float]) -> dict[str, Any]:
    return {
        "text": paragraphs(question.text, numbers),
        "choices": [line(choice, numbers) for choice in question.choices],
        "right": question.right,
        "answer": paragraphs(question.answer, numbers),
    }
