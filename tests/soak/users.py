"""Users: pages that are used at random."""

import random
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from playwright.sync_api import Browser, Error

from tests.browser.driver import Visitor

PAGES = 3


class Users:
    """Three pages.

    Args:
        url: address of the debugger.
        pace: factor for the pauses between actions; a larger one leaves more of the machine to others.

    Attributes:
        actions: how often each action was done.
    """

    def __init__(self, browser: Browser, url: str, seed: int, pace: float) -> None:
        self._browser, self._random, self._pace = browser, random.Random(seed), pace
        self._app: Any = SimpleNamespace(url=url)  # pages are opened by the address alone
        self.visitors = [Visitor(browser, self._app) for _ in range(PAGES)]
        self._troubles: list[str] = []
        self.actions: dict[str, int] = {}

    def act(self) -> None:
        """One action on one page."""
        k = self._random.randrange(PAGES)
        actions: list[Callable[[Visitor], None]] = [
            *(self._step,) * 6, *(self._scrub,) * 4, *(self._select,) * 3, self._run_and_pause, self._play, self._branch,
            self._look_through, self._change_theme, self._change_surface, self._reload, self._reopen,
        ]  # fmt: skip
        action = self._random.choice(actions)
        name = action.__name__.strip("_")
        self.actions[name] = self.actions.get(name, 0) + 1
        try:
            if action == self._reopen:
                self._replace(k)
            else:
                action(self.visitors[k])
        except Error as error:  # what a page did not do in minutes
            self._troubles.append(f"{name}: {error.message.splitlines()[0]}")
            self._replace(k)
        time.sleep(self._pace * self._random.uniform(0, 0.3))

    @property
    def troubles(self) -> list[str]:
        """Errors of all pages so far."""
        return self._troubles + [trouble for visitor in self.visitors for trouble in visitor.troubles]

    def _replace(self, k: int) -> None:
        """Close a page and open another."""
        self._troubles += self.visitors[k].troubles
        self.visitors[k].page.close()
        self.visitors[k] = Visitor(self._browser, self._app)

    def _key(self, visitor: Visitor, key: str) -> None:
        visitor.page.keyboard.press(key)
        time.sleep(self._pace * self._random.uniform(0, 0.3))

    def _step(self, visitor: Visitor) -> None:
        self._key(visitor, self._random.choice("inu,"))

    def _run_and_pause(self, visitor: Visitor) -> None:
        self._key(visitor, "g")
        time.sleep(self._random.uniform(0.5, 2))
        self._key(visitor, "p")

    def _play(self, visitor: Visitor) -> None:
        self._key(visitor, "h")
        self._key(visitor, "t")
        time.sleep(self._random.uniform(0.5, 2))
        self._key(visitor, "p")

    def _scrub(self, visitor: Visitor) -> None:
        strip = visitor.page.get_by_role("img", name="What happened")
        if strip.count():
            box = visitor.box_of(strip.first)
            visitor.page.mouse.click(box["x"] + self._random.random() * box["width"], box["y"] + box["height"] / 2)

    def _select(self, visitor: Visitor) -> None:
        entry = visitor.input_of("Vertices")
        if entry.count() and entry.first.is_visible():
            entry.first.fill(str(self._random.randrange(7)))
            entry.first.press("Enter")

    def _branch(self, visitor: Visitor) -> None:
        """Reset a vertex at a past moment, which forks a run."""
        self._select(visitor)
        self._key(visitor, ",")
        self._key(visitor, "z")

    def _look_through(self, visitor: Visitor) -> None:
        self._key(visitor, str(self._random.randrange(1, 6)))
        time.sleep(0.5)
        self._key(visitor, "0")

    def _change_theme(self, visitor: Visitor) -> None:
        self._key(visitor, "y")

    def _change_surface(self, visitor: Visitor) -> None:
        self._key(visitor, self._random.choice("x-"))

    def _reload(self, visitor: Visitor) -> None:
        visitor.open()

    def _reopen(self, visitor: Visitor) -> None:
        """Close the page and open another; see `act`."""
