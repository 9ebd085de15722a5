"""What the panels show: the latest snapshot, the ticks since the last update, and rates."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from asperity.viewer.panels.panel import Frame

if TYPE_CHECKING:
    from asperity.viewer.servo_client import ServoClient

_COUNTS = ("ticks", "misses", "fallbacks", "interventions", "clamps")


class ViewModel:
    """Makes the frames of a servo client, one per update of the page."""

    def __init__(self, servo: ServoClient) -> None:
        self._servo = servo
        self._next_tick = servo.history.count
        self._number = 0
        self._generation = -1
        self._past: deque[tuple[float, tuple[int, ...]]] = deque()

    def frame(self, now: float) -> Frame:
        """Return the next frame; `now` is the page's clock [s]."""
        servo = self._servo
        snapshot, generation = servo.latest(), servo.generation
        ticks, self._next_tick = servo.ticks_since(self._next_tick)
        if generation != self._generation:
            self._past.clear()
            self._generation = generation
        per_second: dict[str, int] = {}
        rate = 0.0
        if snapshot is not None:
            counts = tuple(getattr(snapshot, name) for name in _COUNTS)
            self._past.append((now, counts))
            # Keep as the first entry one that is a second old, or the oldest there is.
            while len(self._past) > 2 and now - self._past[1][0] >= 1.0:
                self._past.popleft()
            then, before = self._past[0]
            # After a delay of the page the first entry is older than a second.
            seconds = max(now - then, 1.0)
            grown = {n: a - b for n, a, b in zip(_COUNTS, counts, before, strict=True)}
            per_second = {name: round(count / seconds) for name, count in grown.items()}
            rate = grown["ticks"] / (now - then) if now > then else 0.0
        per_second.pop("ticks", None)
        frame = Frame(
            self._number, now, snapshot, ticks, self._next_tick, servo.is_alive, generation, rate,
            **per_second,
        )  # fmt: skip
        self._number += 1
        return frame
