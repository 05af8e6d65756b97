"""Numbers in text files, as C's programs write them: no other spellings that Python accepts.

Text stays bytes: only ASCII whitespace separates words, whatever the encoding of names and comments.
"""

import numpy as np

_LONGEST_WHOLE = 18
"""Characters: below 2^63."""


def floats(words: list[bytes]) -> list[float]:
    """The words as numbers. Raises ValueError with a word that is none."""
    values = list(map(float, words))
    if b"_" in b"".join(words):
        raise ValueError("an underscore")
    return values


def whole(words: list[bytes]) -> list[int]:
    """The words as whole numbers of at most 18 characters. Raises ValueError with a word that is none."""
    if max(map(len, words), default=0) > _LONGEST_WHOLE or b"_" in b"".join(words):
        raise ValueError("no whole number")
    return list(map(int, words))


def count(word: bytes) -> int:
    """A word of at most 18 digits as a number. Raises ValueError."""
    if not word.isdigit() or len(word) > _LONGEST_WHOLE:
        raise ValueError("no count")
    return int(word)


def float_texts(values: np.ndarray) -> list[list[bytes]]:
    """The rows of numbers (n, k) float as text: float32 with 7 digits, float64 so that it reads back as the same number."""
    if values.dtype == np.float32:
        return [[b"%.7g" % value for value in row] for row in values.tolist()]
    return [[repr(value).encode() for value in row] for row in values.astype(np.float64).tolist()]


def shown(line: bytes) -> str:
    """The beginning of a line, for messages."""
    return repr(line[:60].decode("utf-8", "replace"))
