"""A thread that talks to devices whose calls block.

A vendor's call sends a wrench over USB or a serial line and returns when the device has answered:
after a fraction of a millisecond, or after a timeout. The servo loop cannot wait for that. So a
thread makes one call for each wrench that the loop hands over, or every 5 ms if there is none,
always with the newest wrench, and stores the measurement. Wrench and measurement are single
references, replaced as a whole, which needs no lock. The vendors' calls release the interpreter's
lock while they wait (measured for HaplyHardwareAPI; a property of ctypes for the others).

The thread is also a watchdog: if the loop hands over no wrench for `HOLD`, it sends zero, whatever
happened to the loop.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from asperity.realtime.devices.protocol import REFUSED, ZERO, Reading, finite_wrench

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

HOLD = 0.02
"""Time for which a wrench is sent after it was handed over [s]."""
_IDLE_PERIOD = 0.005
_STALE = 0.05
FIRST_PAUSE, LONGEST_PAUSE = 0.05, 2.0
"""Pause after a failure [s]: the first, and the longest; each is twice the one before."""


class UnusableError(Exception):
    """An invalid answer from a device that does answer; the next call follows without a pause."""


class Measurement(NamedTuple):
    """What a device measured, in the axes of `protocol`."""

    position: tuple[float, float, float]
    velocity: tuple[float, float, float]
    orientation: tuple[float, float, float, float] | None = None
    """Quaternion wxyz; None: not measured."""
    angular_velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    buttons: int = 0


class PollingThread:
    """A thread that sends wrenches and collects measurements.

    Parameters
    ----------
    transact : callable
        Sends a wrench (six floats) and returns a `Measurement`; may wait, may raise.
    reopen : callable, optional
        Called after a failure, before the next call; may wait, may raise.
    clock : callable
        Monotonic time [s].
    """

    def __init__(
        self,
        transact: Callable[[tuple[float, ...]], Measurement],
        *,
        reopen: Callable[[], None] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._transact, self._reopen, self._clock = transact, reopen, clock
        self._wrench: tuple[float, tuple[float, ...]] = (-float("inf"), ZERO)
        self._answer: tuple[float, int, Measurement] | None = None
        self._error = ""
        self._taken = 0
        self._wake, self._ending = threading.Event(), threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Start the thread."""
        self._thread = threading.Thread(target=self._run, name="device exchange", daemon=True)
        self._thread.start()

    def hand_over(self, wrench: tuple[float, ...]) -> None:
        """Set the wrench to send from now on, for `HOLD`."""
        self._wrench = (self._clock(), wrench)
        self._wake.set()

    def take(self, out: Reading) -> bool:
        """Fill the newest measurement; return whether it is new."""
        out.error, self._error = self._error, ""
        answer = self._answer
        if answer is None:
            out.age = float("inf")
            return False
        measured_at, number, measurement = answer
        fill(out, measurement)
        out.age = self._clock() - measured_at
        if out.age > _STALE:  # the position may still hold, the velocity does not
            out.twist[:] = 0.0
        new, self._taken = number != self._taken, number
        return new

    def wanted(self) -> tuple[float, ...]:
        """Return the wrench to send now: zero if none was handed over for `HOLD`."""
        handed_at, wrench = self._wrench
        return ZERO if self._ending.is_set() or self._clock() - handed_at > HOLD else wrench

    def stop(self) -> None:
        """Send zero once more and end. Waits for the present call, at most 2 s."""
        self._wrench = (-float("inf"), ZERO)
        self._ending.set()
        self._wake.set()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(2.0)

    def step(self) -> None:
        """Make one call and store its measurement."""
        measurement = self._transact(self.wanted())
        number = 1 if self._answer is None else self._answer[1] + 1
        self._answer = (self._clock(), number, measurement)

    def _run(self) -> None:
        pause = FIRST_PAUSE
        failed = False
        while not self._ending.is_set():
            try:
                if failed and self._reopen is not None:
                    self._reopen()
                self._wake.wait(_IDLE_PERIOD)
                self._wake.clear()
                self.step()
                failed, pause = False, FIRST_PAUSE
            except UnusableError as error:
                failed, self._error = False, str(error)
            except Exception as error:  # the thread survives whatever a vendor's call raises
                failed = True
                self._error = " ".join(str(error).split()) or type(error).__name__
                self._ending.wait(pause)
                pause = min(2.0 * pause, LONGEST_PAUSE)
        try:
            self._transact(ZERO)
        except Exception as error:
            self._error = " ".join(str(error).split())


def fill(out: Reading, measurement: Measurement) -> None:
    """Write a measurement into a reading."""
    pose, twist = out.pose, out.twist
    pose[0], pose[1], pose[2] = measurement.position
    twist[0], twist[1], twist[2] = measurement.velocity
    if measurement.orientation is not None:
        pose[3], pose[4], pose[5], pose[6] = measurement.orientation
        twist[3], twist[4], twist[5] = measurement.angular_velocity
    else:
        twist[3], twist[4], twist[5] = 0.0, 0.0, 0.0
    out.buttons = measurement.buttons


class PolledDevice:
    """Base of devices behind a `PollingThread`: their `read` and `write`."""

    _poller: PollingThread | None = None
    """None while the device is not open."""
    _error = ""
    """An error of the backend itself, for the next reading."""

    def read(self, out: Reading) -> bool:
        """Fill the newest reading; return whether it is new. Never waits or raises."""
        poller = self._poller
        if poller is None:
            out.age, out.error = float("inf"), "the device is not open"
            return False
        new = poller.take(out)
        if self._error:
            out.error, self._error = self._error, ""
        return new

    def write(self, wrench: NDArray[np.float64]) -> None:
        """Hand over force [N] and torque [N m]; a device without torque ignores the latter."""
        values = finite_wrench(wrench)
        if values is None:
            values, self._error = ZERO, REFUSED
        poller = self._poller
        if poller is not None:
            poller.hand_over(values)
