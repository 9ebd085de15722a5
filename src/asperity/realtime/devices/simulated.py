"""A simulated device in a simulated hand, for sessions without hardware or a person.

The hand is `dynamics.simulated_hand`. At each reading it is advanced to the clock's time in steps
of fixed length, under the wrench last written. With a clock that the caller advances, a session
runs as fast as possible and is reproducible.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics.simulated_hand.hand import SimulatedHand
from asperity.realtime.devices.protocol import Limits, Reading

LIMITS = Limits(
    max_force=3.3, max_torque=0.2, max_stiffness=4000.0, max_damping=30.0,
    max_rotational_stiffness=4.0, torque_dof=3,
)  # fmt: skip
"""Limits of no real device: a Touch's force, and torques as well; project default."""
LONGEST = 1.0
"""Longest pause of the loop that the hand makes up for [s]; the rest is skipped."""


class SimulatedDevice:
    """A `Device` held by a simulated hand.

    Parameters
    ----------
    hand : SimulatedHand
        In the device's axes.
    limits : Limits
        Larger wrenches are reduced to these, as by a real device.
    clock : callable
        Present time [s].
    longest : float
        Longest pause of the loop that the hand makes up for [s]; the rest is skipped.
    """

    name = "simulated"
    in_loop = True

    def __init__(
        self,
        hand: SimulatedHand,
        *,
        limits: Limits = LIMITS,
        clock: Callable[[], float] = time.perf_counter,
        longest: float = LONGEST,
    ) -> None:
        self.hand = hand
        self._longest = longest
        self.limits = limits
        self._clock = clock
        self._wrench = np.zeros(6)
        self._now: float | None = None

    def open(self) -> None:
        """Place the hand at its target, at rest."""
        self.hand.reset()
        self._wrench[:] = 0.0
        self._now = self._clock()

    def read(self, out: Reading) -> bool:
        """Fill the hand's present pose; return whether it has moved on since the last reading."""
        if self._now is None:
            out.error = "not open"
            return False
        late = self._clock() - self._now
        # A fraction of a step is left to the next reading; the tolerance absorbs rounding.
        steps = math.floor(late / self.hand.dt + 1e-6) if math.isfinite(late) else 0
        self._now += max(steps, 0) * self.hand.dt
        for _ in range(min(steps, math.ceil(self._longest / self.hand.dt))):
            self.hand.advance(self._wrench)
        out.pose[:], out.twist[:] = self.hand.pose, self.hand.twist
        out.buttons, out.error = 0, ""
        out.age = max(late - steps * self.hand.dt, 0.0)
        return steps > 0

    def write(self, wrench: NDArray[np.float64]) -> None:
        """Push the hand with a force [N] and a torque about the end effector [N m] (6,)."""
        fx, fy, fz, tx, ty, tz = wrench.tolist()
        if self._now is None or not math.isfinite(fx + fy + fz + tx + ty + tz):
            return
        f = _share(math.hypot(fx, fy, fz), self.limits.max_force if self.limits.force_dof else 0.0)
        t = _share(
            math.hypot(tx, ty, tz), self.limits.max_torque if self.limits.torque_dof else 0.0
        )
        fx, fy, fz = f * fx, f * fy, f * fz
        ax, ay, az = self.hand.arm.tolist()
        self._wrench[:] = (
            fx, fy, fz, t * tx - ay * fz + az * fy, t * ty - az * fx + ax * fz,
            t * tz - ax * fy + ay * fx,
        )  # fmt: skip

    def close(self) -> None:
        """Remove the wrench."""
        self._wrench[:] = 0.0
        self._now = None


def _share(size: float, most: float) -> float:
    """Return the factor by which a vector of norm `size` is reduced to at most `most`."""
    return min(1.0, most / size) if size > 0.0 else 1.0
