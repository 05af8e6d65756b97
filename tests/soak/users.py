"""Users: pages that are used at random. Every action waits for its effect."""

import random
import time
from collections import Counter
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from playwright.sync_api import Browser, Error

from tests.browser.driver import Visitor
from tests.soak.served import Facts
from tests.soak.server import Server
from tests.waiting import PATIENCE

MOST_RUNS = 4
MOST_STEPS = 400  # of a run; a longer one is restarted, because a record grows by design

WEIGHTS = {
    "step": 6, "scrub": 4, "select": 3, "run": 1, "play": 1, "branch": 1, "lock": 1, "look through": 1, "theme": 1,
    "shape": 1, "texture": 1, "color": 1, "tabs": 1, "reload": 1, "reopen": 1, "delete run": 0, "restart": 0,
}  # fmt: skip
"""Actions with how often they are chosen; the last two are done when there are too many runs or steps."""


KEY_LOG = """
window.keysSeen = [];
addEventListener('keydown', event => {
  const {key, isTrusted, target} = event, focus = target.outerHTML?.slice(0, 80);
  keysSeen.push(`${new Date().toISOString()} ${key}${isTrusted ? '' : ' by script'} at ${focus}`);
  keysSeen.splice(0, keysSeen.length - 6);
}, true);
"""
"""Script of every page: keeps the last keys that it has got, for what is printed of an action without effect."""


class NoEffectError(Exception):
    """An action did nothing."""


class Users:
    """Users of some pages of one debugger.

    Args:
        pages: how many.
        pace: factor for the pauses between actions; a larger one leaves more of the machine to others.

    Attributes:
        done: how often each action had its effect.
        refused: how often the debugger refused an action with an error message.
    """

    def __init__(self, browser: Browser, server: Server, seed: int, pages: int, pace: float) -> None:
        self._browser, self._server, self._random, self._pace = browser, server, random.Random(seed), pace
        self._app: Any = SimpleNamespace(url=server.url)  # pages are opened by the address alone
        self.visitors = [self._visitor() for _ in range(pages)]
        self._troubles: list[str] = []
        self._problems = 0
        self.done: Counter[str] = Counter()
        self.refused: Counter[str] = Counter()
        self._actions: dict[str, Callable[[Visitor], None]] = {
            "step": self._step,
            "scrub": self._scrub,
            "select": self._select,
            "run": self._run_and_pause,
            "play": self._play,
            "branch": self._branch,
            "lock": self._lock,
            "look through": self._look_through,
            "theme": self._change_theme,
            "shape": self._change_shape,
            "texture": self._change_texture,
            "color": self._color,
            "tabs": self._visit_tabs,
            "reload": self._reload,
            "reopen": self._reopen,
            "delete run": self._delete_run,
            "restart": self._restart,
        }

    def act(self, name: str | None = None) -> None:
        """One action on one page, at random if no name is given."""
        k, facts = self._random.randrange(len(self.visitors)), self._server.facts()
        self._problems = facts.problems
        if name is None and len(facts.runs) > MOST_RUNS:
            name = "delete run"
        elif name is None and (facts.length > MOST_STEPS or facts.is_finished):
            name = "restart"
        name = name or self._random.choices(list(WEIGHTS), list(WEIGHTS.values()))[0]
        try:
            self._actions[name](self.visitors[k])
        except (Error, NoEffectError, AssertionError) as error:  # what a page did not do in minutes
            if self._server.facts().problems > facts.problems:
                self.refused[name] += 1
            else:
                self._troubles.append(f"{name}: {str(error).splitlines()[0]}")
                print(f"{self._troubles[-1]}\nkeys seen: {self.visitors[k].page.evaluate('keysSeen')}", flush=True)
            self._replace(k)
        else:
            self.done[name] += 1
        self._rest()

    @property
    def troubles(self) -> list[str]:
        """Errors of all pages so far, of the server, and actions without effect."""
        visited = [trouble for visitor in self.visitors for trouble in visitor.troubles]
        return self._troubles + visited + self._server.facts().errors

    # ------------------------------------------------------------------ what actions have in common

    def _rest(self) -> None:
        time.sleep(self._pace * self._random.uniform(0, 0.3))

    def _visitor(self) -> Visitor:
        """Open another page."""
        visitor = Visitor(self._browser, self._app)
        visitor.page.evaluate(KEY_LOG)
        visitor.page.add_init_script(KEY_LOG)  # of the page after a reload
        return visitor

    def _replace(self, k: int) -> None:
        """Close a page and open another."""
        self._troubles += self.visitors[k].troubles
        self.visitors[k].page.close()
        self.visitors[k] = self._visitor()

    def _until(self, expected: str, holds: Callable[[Facts], bool]) -> Facts:
        """The state once a condition holds.

        Raises:
            NoEffectError: it did not within `PATIENCE`, or a command of this action was refused.
        """
        deadline = time.monotonic() + PATIENCE
        while not holds(facts := self._server.facts()):
            if facts.problems > self._problems or time.monotonic() > deadline:
                raise NoEffectError(f"expected {expected}, found {facts}")
            time.sleep(0.02)
        return facts

    def _press(self, visitor: Visitor, key: str, expected: str, holds: Callable[[Facts], bool]) -> Facts:
        """Press a key, and wait for its effect."""
        visitor.page.keyboard.press(key)
        facts = self._until(f"{expected} after key {key}", holds)
        self._rest()
        return facts

    def _sees(self, visitor: Visitor) -> None:
        """Wait until the page's slider is at the present moment."""
        facts = self._server.facts()
        if facts.length:
            slider = visitor.page.get_by_role("slider", name="Moment", exact=True)
            slider.and_(visitor.page.locator(f"[aria-valuenow='{facts.moment}']")).wait_for(state="attached")

    def _with_steps(self, visitor: Visitor, length: int) -> Facts:
        """The state with at least this many steps recorded, at the end of a record that can go on."""
        while True:
            facts = self._server.facts()
            if facts.moment == facts.length and facts.is_finished:
                self._restart(visitor)
            elif facts.moment < facts.length:
                self._press(visitor, "j", "the end", lambda now: _is_at_rest(now) and now.moment == now.length)
            elif facts.length < length:
                at = facts.moment
                self._press(visitor, "i", "a step", lambda now, at=at: _is_at_rest(now) and now.moment > at)
            else:
                return facts

    # ------------------------------------------------------------------ the run

    def _step(self, visitor: Visitor) -> None:
        facts = self._server.facts()
        key = self._random.choice("iinu," if facts.moment else "in")
        before = facts.moment
        self._press(visitor, key, "another moment", lambda now: _is_at_rest(now) and now.moment != before)
        self._sees(visitor)

    def _run_and_pause(self, visitor: Visitor) -> None:
        before = self._with_steps(visitor, 0).moment
        self._press(visitor, "g", "new steps", lambda now: now.moment > before)
        time.sleep(self._random.uniform(0.5, 2))
        self._press(visitor, "p", "a pause", _is_at_rest)
        self._sees(visitor)

    def _play(self, visitor: Visitor) -> None:
        self._with_steps(visitor, 3)
        self._press(visitor, "h", "the start", lambda now: _is_at_rest(now) and now.moment == 0)
        self._press(visitor, "t", "a later moment", lambda now: now.moment > 0)
        time.sleep(self._random.uniform(0.5, 2))
        self._press(visitor, "p", "a pause", _is_at_rest)
        self._sees(visitor)

    def _scrub(self, visitor: Visitor) -> None:
        """Click the strip of the timeline, at the middle of a moment."""
        facts = self._with_steps(visitor, 2)
        moment = self._random.randrange(1, facts.length)
        visitor.close_notifications()
        strip = visitor.page.get_by_role("img", name="Recorded moments", exact=True)
        box = visitor.box_of(strip)
        strip.click(position={"x": (moment - 0.5) / facts.length * box["width"], "y": box["height"] / 2})
        self._until(f"moment {moment} of {facts.length}", lambda now: abs(now.moment - moment) <= _pixel(facts, box))
        self._sees(visitor)

    def _branch(self, visitor: Visitor) -> None:
        """Reset a vertex at a past moment, which forks a run."""
        facts = self._server.facts()
        while not facts.movable or facts.moment == facts.length:
            self._with_steps(visitor, facts.length + 1)
            facts = self._press(visitor, ",", "a step back", lambda now: _is_at_rest(now) and now.moment < now.length)
        self._choose(visitor, self._random.choice(facts.movable))
        run = facts.run
        self._press(visitor, "z", "another run", lambda now: _is_at_rest(now) and now.run != run)
        self._sees(visitor)

    def _lock(self, visitor: Visitor) -> None:
        """Lock a vertex and unlock it."""
        facts = self._with_steps(visitor, 0)
        vertex = self._random.choice([k for k in range(facts.n_vertices) if k not in facts.locked])
        self._choose(visitor, vertex)
        self._press(visitor, "f", f"vertex {vertex} locked", lambda now: _is_at_rest(now) and vertex in now.locked)
        self._press(visitor, "f", f"vertex {vertex} free", lambda now: _is_at_rest(now) and vertex not in now.locked)

    def _restart(self, visitor: Visitor) -> None:
        run = self._server.facts().run
        self._press(visitor, "r", "another run", lambda now: _is_at_rest(now) and now.run != run and now.moment == 0)

    def _delete_run(self, visitor: Visitor) -> None:
        facts = self._server.facts()
        run = next(run for run in facts.runs if run != facts.run)
        visitor.close_notifications()
        visitor.page.get_by_role("tab", name="Runs").click()
        visitor.button(f"Delete Run {run}").click()
        self._until(f"run {run} deleted", lambda now: run not in now.runs)
        visitor.page.get_by_role("tab", name="Timeline").click()

    # ------------------------------------------------------------------ the page

    def _select(self, visitor: Visitor) -> None:
        facts = self._server.facts()
        free = [k for k in range(facts.n_vertices) if not _count(facts, "selected", [k])]
        self._choose(visitor, self._random.choice(free))

    def _choose(self, visitor: Visitor, vertex: int) -> None:
        count = self._count("selected", [vertex])
        entry = visitor.input_of("Vertices").first
        if entry.input_value() == str(vertex):
            return
        entry.fill(str(vertex))
        entry.press("Enter")
        self._until(f"vertex {vertex} selected", lambda now: _count(now, "selected", [vertex]) > count)

    def _look_through(self, visitor: Visitor) -> None:
        view = self._random.randrange(min(9, self._server.facts().n_views))
        self._press(visitor, str(view + 1), f"photo {view}", lambda now: _count(now, "photo", view) == 1)
        time.sleep(0.5)
        self._press(visitor, "0", "no photo", lambda now: _count(now, "photo", view) == 0)

    def _change_theme(self, visitor: Visitor) -> None:
        dark = self._count("is_dark", True)
        self._press(visitor, "y", "another theme", lambda now: _count(now, "is_dark", True) != dark)

    def _change_shape(self, visitor: Visitor) -> None:
        at_start = self._count("shape", 0.0)
        self._press(visitor, "x", "another shape", lambda now: _count(now, "shape", 0.0) != at_start)

    def _change_texture(self, visitor: Visitor) -> None:
        """Between static and view-dependent texture."""
        count = self._count("is_view_dependent", True)
        self._press(visitor, "-", "another texture", lambda now: _count(now, "is_view_dependent", True) != count)
        time.sleep(0.5)

    def _color(self, visitor: Visitor) -> None:
        """Colour the surface by a quantity, and texture it again."""
        visitor.close_notifications()
        visitor.page.get_by_role("tab", name="Layers").click()
        group = visitor.page.get_by_role("group", name="Coloured by", exact=True).get_by_role("button")
        textured = self._count("surface", "textured")
        group.nth(self._random.randrange(group.count())).click()
        self._until("a coloured surface", lambda now: _count(now, "surface", "textured") < textured)
        time.sleep(1.0)
        visitor.button("Surface: Textured").click()
        self._until("a textured surface", lambda now: _count(now, "surface", "textured") == textured)
        visitor.page.get_by_role("tab", name="Vertex", exact=True).click()

    def _visit_tabs(self, visitor: Visitor) -> None:
        """Open other panels for a moment."""
        visitor.close_notifications()
        for name in (
            "Breakpoints",
            "Layers",
            "Options",
            "Vertex",
            "Runs",
            "Bookmarks",
            "Timeline",
            "Experiments",
            "Cells",
        ):
            tab = visitor.page.get_by_role("tab", name=name, exact=True)
            tab.click()
            tab.and_(visitor.page.locator("[aria-selected=true]")).wait_for()
            self._rest()

    def _reload(self, visitor: Visitor) -> None:
        self._renew(visitor.open)
        self._sees(visitor)

    def _reopen(self, visitor: Visitor) -> None:
        """Close the page and open another."""
        self._renew(lambda: self._replace(self.visitors.index(visitor)))

    def _renew(self, act: Callable[[], None]) -> None:
        """Do what replaces a page, and wait until the server has a new one and not the old one."""
        newest = max(page["client"] for page in self._server.facts().pages)
        act()
        self._until(
            "a new page",
            lambda now: len(now.pages) == len(self.visitors) and max(p["client"] for p in now.pages) > newest,
        )

    def _count(self, name: str, value: object) -> int:
        return _count(self._server.facts(), name, value)


def _is_at_rest(facts: Facts) -> bool:
    return facts.activity == "paused"


def _count(facts: Facts, name: str, value: object) -> int:
    """The number of pages with this choice."""
    return sum(page[name] == value for page in facts.pages)


def _pixel(facts: Facts, box: dict[str, float]) -> int:
    """The number of moments that a pixel of the strip covers, at least 0."""
    return int(facts.length / box["width"])
