"""Absolute deadlines: when ticks begin, and what happens to those that were missed.

Tick n begins at `begin + n dt` and has to be finished before tick n + 1 begins. Deadlines are
counted from the beginning, not from the last tick, so lateness does not accumulate. A loop that was
held up does not catch up with a burst of ticks: it continues with the tick that is due now, and the
skipped ones count as misses.

An operating system wakes a sleeping process late, so the loop sleeps until `SPIN` before the tick
and then polls the clock. Sleeping costs more than the time: the core halts, other processes fill
its caches, and what follows takes two to three times as long. A loop that has a core to itself may
therefore poll the clock all the time (`BUSY`); see `scheduling.RealTime`. Measurements:
docs/design/servo.md.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from asperity._core.kernels import kernel
from asperity.errors import require_between

SPIN = 100e-6
"""Time before a tick at which sleeping ends and polling begins [s]."""
_RELEASE_UNTIL = 5e-5
"""Time before a tick until which a busy loop releases the interpreter's lock [s]."""
_BURN_SECONDS, _BURN_TRIAL = 1e-5, 10_000
"""Duration of one release [s]; iterations of the trial that calibrates it."""
BUSY = math.inf
"""Value of `spin` for a loop that never sleeps."""


class SystemClock:
    """The operating system's performance counter: `now` and `sleep` in seconds."""

    now = staticmethod(time.perf_counter)
    sleep = staticmethod(time.sleep)

    def __init__(self) -> None:
        begun = self.now()
        burn(_BURN_TRIAL)
        begun = self.now()  # again: the first call may have compiled
        burn(_BURN_TRIAL)
        self._loops = max(int(_BURN_TRIAL * _BURN_SECONDS / max(self.now() - begun, 1e-9)), 1)

    def give_way(self) -> None:
        """Keep the processor busy for a moment without holding the interpreter's lock."""
        burn(self._loops)


@kernel
def burn(loops):  # type: ignore[no-untyped-def]
    """Iterate without the interpreter's lock; the result is meaningless."""
    value = 1.0
    for _ in range(loops):
        value = 1.0 / (1.0 + value)
    return value


class Pace:
    """The schedule of the ticks.

    Parameters
    ----------
    dt : float
        Tick [s], 1e-5 to 0.1.
    clock : SystemClock
    spin : float
        Time before a tick at which to stop sleeping [s]; `BUSY`: never sleep.
    """

    def __init__(self, dt: float, clock: SystemClock, *, spin: float = SPIN) -> None:
        self._dt = require_between("dt", dt, 1e-5, 0.1, "s")
        self._clock = clock
        self._spin = spin
        self.restart()

    def restart(self, dt: float | None = None) -> None:
        """Begin tick 0 now; with ticks of `dt` [s] from now on, if given."""
        if dt is not None:
            self._dt = require_between("dt", dt, 1e-5, 0.1, "s")
        self._begin = self._clock.now()
        self._tick = 0
        self.skipped = 0
        """Ticks that were skipped before the present one."""
        self.late = 0.0
        """Delay of the present tick's beginning [s]."""

    @property
    def deadline(self) -> float:
        """When the present tick has to be finished, on the clock [s]."""
        return self._begin + (self._tick + 1) * self._dt

    def wait(self, work: Callable[[float], object] | None = None) -> None:
        """Wait until the next tick begins; `skipped` and `late` then describe it.

        Parameters
        ----------
        work : callable, optional
            Other work for this core in the meantime: returns when done, or after the seconds that
            it is given.
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
            # A device's thread may need the interpreter, which polling would hold.
            while start - now > _RELEASE_UNTIL:
                clock.give_way()
                now = clock.now()
        elif start - now > self._spin:
            clock.sleep(start - now - self._spin)
        while True:
            now = clock.now()
            if now >= start:
                break
        self.late = now - start
