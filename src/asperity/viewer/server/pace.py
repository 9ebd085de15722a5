"""How often the page is updated: less often while the loop is late, so that drawing gives way."""

from __future__ import annotations

import contextlib
import os
import threading

from asperity.viewer.panels.panel import Frame

UPDATE_RATE = 30.0
"""Rate of updates while the loop keeps its own [Hz]."""
SLOWEST = 8.0
"""Largest factor by which updates become rarer."""
_LATE, _MISSED = 0.97, 0.02
"""Share of the nominal rate, and share of missed ticks, from which the page gives way."""
_EVERY, _STEP = 0.5, 1.5
"""Time between two changes of the pace [s], and their factor."""
_NICE = 5


class UpdatePace:
    """The interval between two updates of the page.

    Attributes
    ----------
    factor : float
        1 to `SLOWEST`, over the interval at 30 Hz.
    """

    def __init__(self) -> None:
        self.factor = 1.0
        self._changed = 0.0

    @property
    def gives_way(self) -> bool:
        """Whether drawing gives way to the loop."""
        return self.factor > 1.0

    def interval(self, frame: Frame, wanted: float) -> float:
        """Return the time until the next update [s].

        Parameters
        ----------
        frame : Frame
        wanted : float
            Nominal ticks per second of the loop [Hz].
        """
        if frame.now - self._changed >= _EVERY:
            self._changed = frame.now
            late = frame.rate < _LATE * wanted or frame.misses > _MISSED * wanted
            factor = self.factor * _STEP if frame.alive and late else self.factor / _STEP
            self.factor = min(max(factor, 1.0), SLOWEST)
        return self.factor / UPDATE_RATE


def step_back() -> None:
    """Give the calling thread less of a busy core than the loop, where the system can."""
    with contextlib.suppress(AttributeError, OSError):
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICE)
