"""Lessons as a visitor of the page opens, walks through and closes them."""

import os

from app.lessons.player import Player, Status
from app.lessons.reader import load_lesson
from app.page.server import App
from tests.browser.driver import Visitor, page_of
from tests.waiting import wait_for

# EIGENFAIRING_ALL_LESSONS=1 walks all of them, exported ones with their experiments.
WALKS_ALL_LESSONS = bool(os.environ.get("EIGENFAIRING_ALL_LESSONS"))
SLOW = 240.0  # s: for a step's work on a loaded machine that compiles the engine first


def player_of(app: App) -> Player:
    return page_of(app).lessons.player


def arrive(visitor: Visitor, step: int) -> None:
    """Wait until the page shows a step whose work is done, and hold its claims against it."""
    player = player_of(visitor.app)
    # A click on a lesson may still be on its way.
    try:
        wait_for(
            lambda: player.lesson is not None and player.step == step and player.status is not Status.AT_WORK, SLOW
        )
    except AssertionError as error:
        raise AssertionError(f"wanted step {step}, at {player.step}, {player.status}") from error
    assert player.status is Status.THERE, player.problem
    assert player.lesson is not None
    claims = player.findings[step].claims
    assert [claim for claim, holds in claims if not holds] == [], f"{player.lesson.name}, step {step + 1}"
    visitor.page.get_by_role("heading", name=player.lesson.steps[step].title, exact=True).wait_for()
    if claims:
        visitor.page.get_by_text(f"{len(claims)} of {len(claims)} claims verified on this run").wait_for()


def choose_lesson(visitor: Visitor, name: str) -> None:
    visitor.page.get_by_role("tab", name="Lessons").click()
    lesson = visitor.button(f"Lesson: {load_lesson(name).title}")
    visitor.wait_until_at_rest(lesson)
    lesson.click()


def close_lesson(visitor: Visitor) -> None:
    visitor.button("Close the lesson").click()
    visitor.page.get_by_role("tab", name="Lesson", exact=True).wait_for(state="hidden")
    wait_for(lambda: player_of(visitor.app).lesson is None)
