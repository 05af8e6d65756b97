"""Markup of a lesson's texts: paragraphs, question, lines of the algorithm and claims, typeset as in the debugger."""

from typing import Any

from app.lessons.lesson import LessonStep, Question
from app.lessons.progress import Findings
from app.lessons.typeset import line, paragraphs
from app.pictures.paper_code import LINES, listing


def step_texts(step: LessonStep, found: Findings) -> dict[str, Any]:
    """Title, markup of text, lines of the algorithm, question, and claims of a step."""
    return {
        "title": step.title,
        "text": paragraphs(step.text, found.numbers),
        "code": step.code,
        "question": None if step.question is None else _question(step.question, found.numbers),
        "claims": [claim for claim, _ in found.claims],
    }


def all_lines() -> str:
    """The lines of the algorithm that steps can show, in its order, each group with its name as an attribute."""
    return "".join(f"<div data-lines='{name}'>{listing(excerpt)}</div>" for name, excerpt in LINES.items())


def _question(question: Question, numbers: dict[str, float]) -> dict[str, Any]:
    return {
        "text": paragraphs(question.text, numbers),
        "choices": [line(choice, numbers) for choice in question.choices],
        "right": question.right,
        "answer": paragraphs(question.answer, numbers),
    }
