"""Budget: limits what is made of a file by what the file holds, before it is made."""

from fairing.errors import InputError

RATIO = 32
"""Bytes of arrays for each byte of a file: compressed arrays and repeated parts of a mesh stay below it."""
FREE_BYTES = 1 << 24
"""Bytes of arrays that any file may make, however small it is."""


class Budget:
    """The bytes that may be made of one file: `RATIO` times its size, at least `FREE_BYTES`, and at most a total."""

    def __init__(self, there: int, most: int) -> None:
        """Of a file with this number of bytes. `most`: the total, bytes."""
        self._there, self._most, self._made = there, most, 0

    def add(self, there: int) -> None:
        """Account for further bytes that are there, such as another file that the first one refers to."""
        self._there += there

    def take(self, n_bytes: int) -> None:
        """Account for bytes that are about to be made.

        Raises:
            InputError: they are more than what is left.
        """
        self._made += n_bytes
        allowed = min(self._most, max(FREE_BYTES, RATIO * self._there))
        if self._made > allowed:
            raise InputError(
                f"expected at most {allowed / 2**20:.4g} MiB of data from {self._there} bytes, found declarations of "
                f"{self._made / 2**20:.4g} MiB; export it again"
            )
