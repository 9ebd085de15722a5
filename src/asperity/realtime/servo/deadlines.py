"""Absolute deadlines: when a tick begins, and what becomes of those that were missed.

Tick n begins at `begin + n dt` and has to be finished before tick n + 1 begins. Deadlines are
counted from the beginning, not from the last tick, so that lateness does not add up. A loop that
was held up does not run after the ticks that it missed, which would be a burst of them: it goes on
with the tick that the present moment belongs to, and the ones between count as missed.

An operating system wakes a sleeper late, so the loop sleeps until `SPIN` before the tick and then
watches the clock. Measured on two cores at 2.5 GHz, Linux 6.18, others at work beside it, how late
ticks of an empty loop begin, in microseconds:

| slack of timers | slept until | median | p90 | p99 |
|---|---|---|---|---|
| 50 us, as Linux has it | the tick | 72 | 86 | 4049 |
| | 100 us before | 0 | 31 | 4228 |
| 1 ns (`realtime.sharpen_timers`) | the tick | 36 | 52 | 5930 |
| | 50 us before | 0 | 10 | 133 |
| | 100 us before | 0 | 0 | 38 |

The tails are those of other processes, which hold a core for up to 4 ms; no spinning helps there.

A loop that sleeps gives more away than the time: its core halts, others come into its caches, and
what follows takes two to three times as long. A loop with a core of its own may therefore watch
the clock all the time (`BUSY`); see `realtime.RealTime`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Protocol

from asperity._core.kernels import kernel
from asperity.errors import require_between

SPIN = 100e-6
"""How long before a tick sleeping ends and spinning begins [s]."""
_LAST = 5e-5
"""A busy loop leaves the interpreter to others until then [s]."""
_BURNT, _TRIED = 1e-5, 10_000
"""For how long at a time [s]; loops of which it is told how many that are."""
BUSY = math.inf
"""Never sleep."""


class Clock(Protocol):
    """Where the loop takes its time from."""

    def now(self) -> float:
        """Return the time [s], from any beginning; it never goes back."""

    def sleep(self, seconds: float) -> None:
        """Let others have the processor for so long."""

    def give_way(self) -> None:
        """Keep the processor for a moment, and leave the interpreter to other threads."""


class SystemClock:
    """The machine's own."""

    now = staticmethod(time.perf_counter)
    sleep = staticmethod(time.sleep)

    def __init__(self) -> None:
        begun = self.now()
        burn(_TRIED)
        begun = self.now()  # the first time it may have been compiled
        burn(_TRIED)
        self._loops = max(int(_TRIED * _BURNT / max(self.now() - begun, 1e-9)), 1)

    def give_way(self) -> None:
        """Keep the processor for a moment, and leave the interpreter to other threads."""
        burn(self._loops)


@kernel
def burn(loops):  # type: ignore[no-untyped-def]
    """Compute, without the interpreter's lock; return what nobody needs."""
    value = 1.0
    for _ in range(loops):
        value = 1.0 / (1.0 + value)
    return value


class Pace:
    """When ticks begin.

    Parameters
    ----------
    dt : float
        Tick [s], 1e-5 to 0.1.
    clock : Clock
    spin : float
        How long before a tick to stop sleeping [s]; `BUSY`: never to sleep.
    """

    def __init__(self, dt: float, clock: Clock, *, spin: float = SPIN) -> None:
        self._dt = require_between("dt", dt, 1e-5, 0.1, "s")
        self._clock = clock
        self._spin = spin
        self.restart()

    def restart(self, dt: float | None = None) -> None:
        """Let the present moment be the beginning of tick 0; with ticks of `dt` [s], if given."""
        if dt is not None:
            self._dt = require_between("dt", dt, 1e-5, 0.1, "s")
        self._begin = self._clock.now()
        self._tick = 0
        self.skipped = 0
        """How many ticks the last waiting left out."""
        self.late = 0.0
        """How long after its beginning the present tick was begun [s]."""

    @property
    def deadline(self) -> float:
        """When the present tick has to be finished [s], on the clock."""
        return self._begin + (self._tick + 1) * self._dt

    def wait(self, work: Callable[[float], object] | None = None) -> None:
        """Sleep and spin until the next tick begins; see `skipped` and `late` for how it went.

        Parameters
        ----------
        work : callable, optional
            What others have to do on this core first: returns when it is done, or after the
            seconds that it is given.
        """
        clock, dt = self._clock, self._dt
        now = clock.now()
        following = self._tick + 1
        current = int((now - self._begin) / dt)
        self.skipped = max(current - following, 0)
        self._tick = following + self.skipped
        start = self._begin + self._tick * dt
        if work is not None and start > now:
            work(start - now)
            now = clock.now()
        if self._spin == BUSY:
            # A device's thread wants the interpreter, and would have to have it taken from us.
            while start - now > _LAST:
                clock.give_way()
                now = clock.now()
        elif start - now > self._spin:
            clock.sleep(start - now - self._spin)
        while True:
            now = clock.now()
            if now >= start:
                break
        self.late = now - start
