"""Devices that answer only when asked, asked from a thread.

A vendor's call talks to the device over USB or a serial line and returns when it has answered: a
fraction of a millisecond if all is well, and a timeout if not. The servo cannot wait for that. So a
thread asks once for each wrench that the servo hands over (and every 5 ms if it hands over none),
always with the newest wrench, and puts down the answer. Wrench and answer are single references,
swapped whole, which needs no lock. The vendors' calls let go of the interpreter while they wait
(measured for HaplyHardwareAPI; a property of ctypes for the others), so the servo runs meanwhile.

The thread also is the last to hold the wrench: if the servo hands over none for `HOLD`, the
thread sends zero, whatever became of the servo.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from asperity.realtime.devices.protocol import Reading
from asperity.realtime.devices.wrench_check import REFUSED, ZERO, taken

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

HOLD = 0.02
"""A wrench is sent for so long after it was handed over [s]."""
_UNASKED = 0.005
_STALE = 0.05
FIRST_PAUSE, LONGEST_PAUSE = 0.05, 2.0
"""After a failure [s]: at first, doubled each time up to the longest."""


class UnusableError(Exception):
    """An answer that cannot be used, from a device that answers: asked again without a pause."""


class Answer(NamedTuple):
    """What a device answered, in asperity's axes."""

    position: tuple[float, float, float]
    velocity: tuple[float, float, float]
    orientation: tuple[float, float, float, float] | None = None
    """wxyz; None: not sensed."""
    turning: tuple[float, float, float] = (0.0, 0.0, 0.0)
    buttons: int = 0


class Exchange:
    """A thread that hands over wrenches and takes answers.

    Parameters
    ----------
    ask : callable
        Sends a wrench (six floats) and returns the `Answer`; may wait, may raise.
    reopen : callable, optional
        Called before asking again after a failure; may wait, may raise.
    clock : callable
        Monotonic time [s].
    """

    def __init__(
        self,
        ask: Callable[[tuple[float, ...]], Answer],
        *,
        reopen: Callable[[], None] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._ask, self._reopen, self._clock = ask, reopen, clock
        self._wrench: tuple[float, tuple[float, ...]] = (-float("inf"), ZERO)
        self._answer: tuple[float, int, Answer] | None = None
        self._error = ""
        self._taken = 0
        self._wake, self._ending = threading.Event(), threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin to ask."""
        self._thread = threading.Thread(target=self._run, name="device exchange", daemon=True)
        self._thread.start()

    def hand_over(self, wrench: tuple[float, ...]) -> None:
        """Say what is to be sent from now on, for `HOLD`."""
        self._wrench = (self._clock(), wrench)
        self._wake.set()

    def take(self, out: Reading) -> bool:
        """Fill the newest answer; return whether it is new."""
        out.error, self._error = self._error, ""
        answer = self._answer
        if answer is None:
            out.age = float("inf")
            return False
        measured_at, number, told = answer
        fill(out, told)
        out.age = self._clock() - measured_at
        if out.age > _STALE:  # where it was, is known; how fast it moves, no longer
            out.twist[:] = 0.0
        new, self._taken = number != self._taken, number
        return new

    def wanted(self) -> tuple[float, ...]:
        """Return the wrench that is to be sent now: zero if none was handed over for `HOLD`."""
        handed_at, wrench = self._wrench
        return ZERO if self._ending.is_set() or self._clock() - handed_at > HOLD else wrench

    def stop(self) -> None:
        """Send zero once more and end. Waits for the question under way, at most 2 s."""
        self._wrench = (-float("inf"), ZERO)
        self._ending.set()
        self._wake.set()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(2.0)

    def step(self) -> None:
        """Ask once, and put down the answer."""
        told = self._ask(self.wanted())
        number = 1 if self._answer is None else self._answer[1] + 1
        self._answer = (self._clock(), number, told)

    def _run(self) -> None:
        pause = FIRST_PAUSE
        failed = False
        while not self._ending.is_set():
            try:
                if failed and self._reopen is not None:
                    self._reopen()
                self._wake.wait(_UNASKED)
                self._wake.clear()
                self.step()
                failed, pause = False, FIRST_PAUSE
            except UnusableError as error:
                failed, self._error = False, str(error)
            except Exception as error:  # the thread has to outlive whatever a vendor's call raises
                failed = True
                self._error = " ".join(str(error).split()) or type(error).__name__
                self._ending.wait(pause)
                pause = min(2.0 * pause, LONGEST_PAUSE)
        try:
            self._ask(ZERO)
        except Exception as error:
            self._error = " ".join(str(error).split())


def fill(out: Reading, told: Answer) -> None:
    """Write an answer into a reading."""
    pose, twist = out.pose, out.twist
    pose[0], pose[1], pose[2] = told.position
    twist[0], twist[1], twist[2] = told.velocity
    if told.orientation is not None:
        pose[3], pose[4], pose[5], pose[6] = told.orientation
        twist[3], twist[4], twist[5] = told.turning
    else:
        twist[3], twist[4], twist[5] = 0.0, 0.0, 0.0
    out.buttons = told.buttons


class Exchanging:
    """What devices that are asked from a thread have in common: `read` and `write`."""

    _exchange: Exchange | None = None
    """None while the device is not open."""
    _error = ""
    """What there is to tell besides, by the next reading."""

    def read(self, out: Reading) -> bool:
        """Fill the newest answer; return whether it is new. Never waits or raises."""
        exchange = self._exchange
        if exchange is None:
            out.age, out.error = float("inf"), "the device is not open"
            return False
        new = exchange.take(out)
        if self._error:
            out.error, self._error = self._error, ""
        return new

    def write(self, wrench: NDArray[np.float64]) -> None:
        """Hand over force [N] and torque [N m], as far as the device has them."""
        values = taken(wrench)
        if values is None:
            values, self._error = ZERO, REFUSED
        exchange = self._exchange
        if exchange is not None:
            exchange.hand_over(values)
