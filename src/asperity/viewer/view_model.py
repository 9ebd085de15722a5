"""What the panels are shown: the latest moment, the rows since the last, and rates."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from asperity.viewer.panels.panel import Frame

if TYPE_CHECKING:
    from asperity.viewer.servo_client import ServoClient

_COUNTS = ("ticks", "misses", "fallbacks", "interventions", "clamps")


class Frames:
    """Frames of a link, one after the other."""

    def __init__(self, link: ServoClient) -> None:
        self._link = link
        self._next_row = link.history.count
        self._number = 0
        self._generation = -1
        self._past: deque[tuple[float, tuple[int, ...]]] = deque()

    def take(self, now: float) -> Frame:
        """Return the next frame; `now` is the page's clock [s]."""
        link = self._link
        moment, generation = link.latest(), link.generation
        rows, self._next_row = link.rows_since(self._next_row)
        if generation != self._generation:
            self._past.clear()
            self._generation = generation
        told: dict[str, int] = {}
        rate = 0.0
        if moment is not None:
            counts = tuple(getattr(moment, name) for name in _COUNTS)
            self._past.append((now, counts))
            # The first that is left is a second old, or the oldest there is.
            while len(self._past) > 2 and now - self._past[1][0] >= 1.0:
                self._past.popleft()
            then, before = self._past[0]
            # A page that was held up looks back over more than a second.
            seconds = max(now - then, 1.0)
            grown = {n: a - b for n, a, b in zip(_COUNTS, counts, before, strict=True)}
            told = {name: round(count / seconds) for name, count in grown.items()}
            rate = grown["ticks"] / (now - then) if now > then else 0.0
        told.pop("ticks", None)
        frame = Frame(
            self._number, now, moment, rows, self._next_row, link.is_alive, generation, rate,
            **told,
        )  # fmt: skip
        self._number += 1
        return frame
