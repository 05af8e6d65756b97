"""Player: the moment of a record that one browser shows, and its playback."""

import threading
from collections.abc import Callable


class Player:
    """Moves through moments 0 to `length`.

    Args:
        speed: of playback.
        on_move: called after every move, on the thread that moved.
        rate: moments a second, from the speed and the present moment; default: the speed.
    """

    def __init__(
        self,
        length: int,
        speed: int,
        on_move: Callable[[], None],
        rate: Callable[[int, int], float] = lambda speed, moment: speed,
    ) -> None:
        self.length, self.speed, self._rate = length, speed, rate
        self.moment = 0
        self._on_move = on_move
        self._playing: threading.Event | None = None  # set: stop
        self._moving = threading.Lock()  # playback must not continue from a moment that was left meanwhile

    @property
    def is_playing(self) -> bool:
        return self._playing is not None

    def go_to(self, moment: int) -> None:
        """Stop playing and go to a moment, or to the nearer end."""
        with self._moving:
            self.stop()
            self.moment = min(max(moment, 0), self.length)
        self._on_move()

    def play_or_stop(self) -> None:
        """Play from here, at the end from the start; or stop."""
        if self.is_playing:
            self.stop()
            self._on_move()
            return
        if self.moment == self.length:
            self.moment = 0
        self._playing = threading.Event()
        threading.Thread(target=self._play, args=(self._playing,), name="flips", daemon=True).start()

    def stop(self) -> None:
        """Stop playing."""
        if self._playing is not None:
            self._playing.set()
            self._playing = None

    def _play(self, stopped: threading.Event) -> None:
        while self.moment < self.length and not stopped.wait(1 / self._rate(self.speed, self.moment)):
            with self._moving:
                if stopped.is_set():
                    return
                self.moment += 1
            self._on_move()
        with self._moving:
            if stopped.is_set():
                return
            self._playing = None
        self._on_move()
