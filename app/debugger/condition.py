"""Conditions over the quantities of a step, such as `rejected > 0 and level == 2`.

Grammar: or, and, not; comparisons; + - * /; numbers, names and functions of one number. A function of a vertex or view also
takes the word `vertex` or `view`: `outliers(view) > 0.2` holds if it holds for any view. A function of a term takes its name
and, after a comma, a vertex: `pull(points, 17) > 1`. A predicate of a stage takes its name alone: `stage(points)`.
Nothing is evaluated as Python.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

from fairing.errors import InputError

MAX_LENGTH = 200
MAX_DEPTH = 40
ANY = math.inf  # argument of a function whose largest value over all vertices or views is meant
FIRST = {"view": 1}  # number of the first item; 0 for others. Photos are counted from 1, as on the keyboard
_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|(?P<name>[A-Za-z_]\w*)|(?P<sign><=|>=|==|!=|[-+*/(),<>]))"
)


class Quantities(NamedTuple):
    """The names that a condition may use, and how to compute them for one step."""

    values: Mapping[str, Callable[[], float]]
    functions: Mapping[str, Callable[..., float]]


Evaluate = Callable[[Quantities], float]


@dataclass(frozen=True)
class Condition:
    """A parsed condition.

    Attributes:
        text: as it was typed.
        evaluate: computes its value from the quantities of a step; any value but 0 and NaN is true.
        is_truth: whether it is true or false rather than a number.
        names: of the quantities that occur in it.
    """

    text: str
    evaluate: Evaluate
    is_truth: bool = True
    names: frozenset[str] = frozenset()

    @property
    def is_constant(self) -> bool:
        """Whether no quantity occurs in it."""
        return not self.names

    def holds(self, quantities: Quantities) -> bool:
        value = self.evaluate(quantities)
        return value == value and value != 0  # NaN, for a quantity that is not defined, is never true


def parse_condition(
    text: str,
    values: set[str],
    functions: set[str],
    limits: Mapping[str, int] = MappingProxyType({}),
    called: str = "condition",
    items: Mapping[str, str] = MappingProxyType({}),
    predicates: Set[str] = frozenset(),
    elsewhere: Set[str] = frozenset(),
    words: Mapping[str, Sequence[str]] = MappingProxyType({}),
) -> Condition:
    """Parse a condition.

    Args:
        values, functions: the names it may use.
        limits: number of valid arguments, from `FIRST`, of functions that select a vertex or view.
        called: its name in error messages.
        items: what the argument of a function selects, "vertex" or "view".
        predicates: functions that are true or false.
        elsewhere: names known in breakpoints only.
        words: the items that are chosen by a word, by what the argument selects: such a function gets the word and, unless it
            is a predicate, the number of a vertex if one follows after a comma.

    Raises:
        InputError: it cannot be parsed; the message shows the position.
    """
    if len(text) > MAX_LENGTH:
        raise InputError(f"{called}: expected at most {MAX_LENGTH} characters, found {len(text)}")
    parser = _Parser(text, values, functions, limits, called, items, predicates, elsewhere, words)
    part = parser.parse()
    return Condition(text.strip(), part.evaluate, part.is_truth, frozenset(parser.names))


class _Part(NamedTuple):
    """A parsed part, and whether it is true or false rather than a number."""

    evaluate: Evaluate
    is_truth: bool = False


class _Token(NamedTuple):
    kind: str
    text: str
    column: int


class _Parser:
    """Recursive-descent parser; every method returns the part it has parsed."""

    def __init__(
        self, text: str, values: set[str], functions: set[str], limits: Mapping[str, int], called: str,
        items: Mapping[str, str], predicates: Set[str], elsewhere: Set[str], words: Mapping[str, Sequence[str]],
    ) -> None:  # fmt: skip
        self._text, self._values, self._functions, self._limits = text, values, functions, limits
        self._called, self._items, self._predicates, self._elsewhere = called, items, predicates, elsewhere
        self._words = words
        self.names: set[str] = set()
        self._tokens = self._split()
        self._at = 0
        self._depth = 0

    def parse(self) -> _Part:
        result = self._either()
        if self._now.kind != "end":
            raise self._error("expected the end or an operator")
        return result

    def _split(self) -> list[_Token]:
        tokens, at = [], 0
        while self._text[at:].strip():
            found = _TOKEN.match(self._text, at)
            if found is None:
                column = at + len(self._text[at:]) - len(self._text[at:].lstrip())
                raise InputError(
                    f"{self._called}, column {column + 1}: cannot read {self._text[column]!r}{self._here(column)}"
                )
            kind = found.lastgroup or ""
            tokens.append(_Token(kind, found.group(kind), found.start(kind)))
            at = found.end()
        return [*tokens, _Token("end", "", len(self._text))]

    @property
    def _now(self) -> _Token:
        return self._tokens[self._at]

    def _take(self, *texts: str) -> str | None:
        """Consume the present token if it is one of these."""
        if self._now.kind != "number" and self._now.text in texts:
            self._at += 1
            return self._tokens[self._at - 1].text
        return None

    def _either(self) -> _Part:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise self._error("too deeply nested")
        left = self._both()
        while self._take("or"):
            right = self._both()
            left = _Part(_either(left.evaluate, right.evaluate), left.is_truth and right.is_truth)
        self._depth -= 1
        return left

    def _both(self) -> _Part:
        left = self._negation()
        while self._take("and"):
            right = self._negation()
            left = _Part(_both(left.evaluate, right.evaluate), left.is_truth and right.is_truth)
        return left

    def _negation(self) -> _Part:
        negated = False
        while self._take("not"):
            negated = not negated
        inner = self._comparison()
        return _Part(lambda q: float(inner.evaluate(q) == 0), inner.is_truth) if negated else inner

    def _comparison(self) -> _Part:
        left = self._sum()
        sign = self._take(*_COMPARE)
        if sign is None:
            return left
        compare, right = _COMPARE[sign], self._sum()
        return _Part(lambda q: float(compare(left.evaluate(q), right.evaluate(q))), is_truth=True)

    def _sum(self) -> _Part:
        left = self._product()
        while sign := self._take("+", "-"):
            left = _Part(_arithmetic(sign, left.evaluate, self._product().evaluate))
        return left

    def _product(self) -> _Part:
        left = self._sign()
        while sign := self._take("*", "/"):
            left = _Part(_arithmetic(sign, left.evaluate, self._sign().evaluate))
        return left

    def _sign(self) -> _Part:
        negative = False
        while self._take("-"):
            negative = not negative
        inner = self._atom()
        return _Part(lambda q: -inner.evaluate(q)) if negative else inner

    def _atom(self) -> _Part:
        token = self._now
        if token.kind == "number":
            self._at += 1
            number = float(token.text)
            return _Part(lambda q: number)
        if self._take("("):
            inner = self._either()
            self._close()
            return inner
        if token.kind == "name" and token.text in self._functions:
            self._at += 1
            self.names.add(token.text)
            if not self._take("("):
                raise self._error(f"expected ( after {token.text}")
            if self._items.get(token.text) in self._words:
                arguments = self._word_and_vertex(token.text)
                self._close()
                evaluate = lambda q: q.functions[token.text](*(argument(q) for argument in arguments))  # noqa: E731
                return _Part(evaluate, token.text in self._predicates)
            self._check_limit(token.text)
            argument = self._argument(token.text)
            self._close()
            return _Part(lambda q: q.functions[token.text](argument(q)), token.text in self._predicates)
        if token.kind == "name" and token.text in self._values:
            self._at += 1
            self.names.add(token.text)
            return _Part(lambda q: q.values[token.text]())
        if token.kind == "name" and token.text in self._elsewhere:
            raise self._error(f"{token.text} is computed only where a breakpoint is checked; it cannot be watched")
        if token.kind == "name" and token.text not in ("and", "or", "not"):
            known = ", ".join(sorted(self._values) + sorted(f"{name}()" for name in self._functions))
            raise self._error(f"{token.text!r} is not known; known names are {known}")
        raise self._error("expected a number or a name")

    def _argument(self, function: str) -> Evaluate:
        """A computed argument, or the word for any vertex or view."""
        item, following = self._items.get(function), self._tokens[self._at + 1 : self._at + 2]
        if item is not None and self._now.text == item and following and following[0].text == ")":
            self._at += 1
            return lambda q: ANY
        return self._either().evaluate

    def _word_and_vertex(self, function: str) -> list[Callable[[Quantities], str | float]]:
        """One of the function's words, and the vertex after a comma, if one is given."""
        item = self._items[function]
        words = self._words[item]
        if self._now.text not in words:
            raise self._error(f"{function}() expects a {item}: {', '.join(words)}")
        word = self._now.text
        self._at += 1
        if function in self._predicates or not self._take(","):
            return [lambda q: word]
        self._check_limit(function)
        return [lambda q: word, self._either().evaluate]

    def _check_limit(self, function: str) -> None:
        """Check an argument that is a plain number; a computed argument may have any value."""
        count, following = self._limits.get(function), self._tokens[self._at + 1 : self._at + 2]
        is_plain = self._now.kind == "number" and following and following[0].text == ")"
        if count is None or not is_plain:
            return
        first = FIRST.get(self._items.get(function, ""), 0)
        if float(self._now.text) not in range(first, first + count):
            raise self._error(f"{function}() expects a whole number from {first} to {first + count - 1}")

    def _close(self) -> None:
        if not self._take(")"):
            raise self._error("expected )")

    def _error(self, what: str) -> InputError:
        column = self._now.column
        return InputError(f"{self._called}, column {column + 1}: {what}{self._here(column)}")

    def _here(self, column: int) -> str:
        return f" (at: {self._text[:column]}⟨here⟩{self._text[column:]})"


_COMPARE: dict[str, Callable[[float, float], bool]] = {
    "<=": lambda a, b: a <= b,
    ">=": lambda a, b: a >= b,
    "==": lambda a, b: a == b,
    "!=": lambda a, b: a != b,
    "<": lambda a, b: a < b,
    ">": lambda a, b: a > b,
}


def _either(left: Evaluate, right: Evaluate) -> Evaluate:
    return lambda q: float(left(q) != 0 or right(q) != 0)


def _both(left: Evaluate, right: Evaluate) -> Evaluate:
    return lambda q: float(left(q) != 0 and right(q) != 0)


def _arithmetic(sign: str, left: Evaluate, right: Evaluate) -> Evaluate:
    if sign == "+":
        return lambda q: left(q) + right(q)
    if sign == "-":
        return lambda q: left(q) - right(q)
    if sign == "*":
        return lambda q: left(q) * right(q)

    def divide(q: Quantities) -> float:
        below = right(q)
        return left(q) / below if below else float("nan")

    return divide
