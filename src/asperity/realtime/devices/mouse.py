"""A mouse as a device: a simulated hand that follows a page's pointer.

A page reports its pointer at most 60 times a second, in steps of a millimetre or more. A hand that
followed these steps would shake in the very band in which texture is felt. So the target is
smoothed in two stages at the servo's rate: first linearly to the newest pointer position, in a
quarter more than the interval between the last two, so that an even drag stays even; then through
three equal poles of `SMOOTHING`, a critically damped filter that rounds the remaining corners. The
hand itself (`dynamics.simulated_hand`) is another low-pass, and yields to the forces on it.

A table of poses (`pointer_file`) is played through the filter only.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics.simulated_hand.hand import MAX_OFFSET, HandSettings, SimulatedHand
from asperity.errors import AsperityError, require_between
from asperity.geometry.poses import interpolate_pose, rotation_between
from asperity.realtime.devices.pointer_file import PointerFile, PointerTarget
from asperity.realtime.devices.protocol import Limits
from asperity.realtime.devices.simulated import LIMITS, SimulatedDevice

SMOOTHING = 12e-3
"""Time constant of each of the three poles [s]; project default."""
SLACK = 1.25
"""Duration of the linear stage, over the interval between pointer events; project default."""
_INTERVALS = 8e-3, 80e-3
"""Shortest and longest interval between pointer events that is assumed [s]."""
FASTEST, FASTEST_TURN = 0.5, 12.0
"""Largest velocities of the target [m/s], [rad/s]; project defaults."""
REACHING = 0.02
"""Speed at which a hand that is to press approaches the surface [m/s]; project default."""

WIDE = replace(LIMITS, radius=1.0)
"""Limits of the pointer: the simulated device's forces, and a workspace of no consequence."""

LONGEST = 0.02
"""Longest pause of the loop that the hand makes up for [s].

Making up for it takes time as well, and a loop on a busy computer must not be late because it was
late.
"""


class SmoothedTarget:
    """A target that moves smoothly, tick by tick, to where the pointer is.

    Parameters
    ----------
    pose : (7,) array
        Initial pose, at rest.
    dt : float
        Tick [s].
    """

    def __init__(self, pose: NDArray[np.float64], dt: float) -> None:
        self.dt = dt
        self._share = 1.0 - math.exp(-dt / SMOOTHING)
        self._goal = np.array(pose, dtype=np.float64)
        self._straight = self._goal.copy()
        self._poles = [self._goal.copy() for _ in range(3)]
        self._interval = 1.0 / 60.0
        self._since = math.inf
        self._left = 0

    @property
    def pose(self) -> NDArray[np.float64]:
        """Present target (7,)."""
        return self._poles[-1]

    def lead_to(self, goal: NDArray[np.float64]) -> None:
        """Move to a new position of the pointer (7,)."""
        shortest, longest = _INTERVALS
        if self._since < 2.0 * longest:
            interval = min(max(self._since, shortest), longest)
            self._interval += 0.2 * (interval - self._interval)
        self._since = 0.0
        self._goal = np.array(goal, dtype=np.float64)
        distance = math.dist(self._straight[:3].tolist(), self._goal[:3].tolist())
        angle = float(np.linalg.norm(rotation_between(self._straight, self._goal)))
        seconds = max(SLACK * self._interval, distance / FASTEST, angle / FASTEST_TURN)
        self._left = max(math.ceil(seconds / self.dt), 1)

    def put(self, goal: NDArray[np.float64]) -> None:
        """Take the next pose of a table, which is only filtered."""
        self._left, self._since = 0, math.inf
        self._goal = self._straight = goal

    def advance(self) -> NDArray[np.float64]:
        """Advance by a tick; return the new target (7,)."""
        self._since += self.dt
        if self._left > 0:
            self._straight = _interpolated(self._straight, self._goal, 1.0 / self._left)
            self._left -= 1
        behind = self._straight
        for i, pole in enumerate(self._poles):
            behind = self._poles[i] = _interpolated(pole, behind, self._share)
        return behind


def _interpolated(
    first: NDArray[np.float64], last: NDArray[np.float64], share: float
) -> NDArray[np.float64]:
    """Return the pose at a share of the way; quick if the orientations are equal."""
    if (first[3:] == last[3:]).all():
        return first + share * (last - first)
    return interpolate_pose(first, last, share)


class ReachingHand(SimulatedHand):
    """A simulated hand that approaches the surface to press, and retracts otherwise."""

    wanted: float | None = None
    """Normal force to press with [N]; None: not regulated."""

    def _regulate(self, normal_force: float) -> None:
        step = REACHING * self.dt
        if self.wanted is None:
            self.offset = math.copysign(max(abs(self.offset) - step, 0.0), self.offset)
        elif normal_force > 0.0:
            # The target may already be too deep; the offset then becomes negative.
            gain = self.dt / (self._press_stiffness * self.settings.press_time)
            self.offset += (self.wanted - normal_force) * gain
            most = MAX_OFFSET + self.wanted / self._press_stiffness
            self.offset = min(max(self.offset, -most), most)
        else:
            self.offset = min(self.offset + step, MAX_OFFSET + self.wanted / self._press_stiffness)


class MouseDevice(SimulatedDevice):
    """A `Device` in a simulated hand that follows a page's pointer.

    Parameters
    ----------
    target : Path, optional
        The `PointerFile`. Without one the device cannot be opened.
    dt : float
        Tick of the hand [s], 1e-5 to 0.1.
    centre : (3,) sequence, optional
        The tool's centre of mass, in the handle's frame [m].
    settings : HandSettings, optional
    limits : Limits
    clock : callable
        Present time [s], the same clock as that of `PointerFile.move`.
    """

    name = "mouse"
    in_loop = True

    def __init__(
        self,
        target: str | Path | None = None,
        *,
        dt: float = 1e-3,
        centre: tuple[float, ...] | None = None,
        settings: HandSettings | None = None,
        limits: Limits = WIDE,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._path = None if target is None else Path(target)
        self._target: PointerTarget | None = None
        self._pointer: PointerFile | None = None
        self._smoothed = SmoothedTarget(np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), dt)
        self._opened = 0.0
        hand = ReachingHand(
            self._aim,
            settings,
            dt=require_between("dt", dt, 1e-5, 0.1, "s"),
            centre=None if centre is None else np.array(centre, dtype=np.float64),
        )
        self._reaching = hand
        super().__init__(hand, limits=limits, clock=clock, longest=LONGEST)

    def open(self) -> None:
        """Begin at the pointer's position, at rest."""
        if self._path is None:
            raise AsperityError("the device mouse needs a page: asperity view SCENE")
        self._opened = self._clock()
        self._pointer = PointerFile(self._path)
        self._target = target = self._pointer.news()
        if target is not None:
            start = target.pose if target.table is None else self._row(target, 0.0)
            self._smoothed = SmoothedTarget(start, self.hand.dt)
            self._reaching.wanted = target.press
        super().open()

    def _aim(self, seconds: float) -> NDArray[np.float64]:
        """Return the hand's target (7,) at a time [s]; called once per tick, in order."""
        if self._pointer is None or seconds <= 1.5 * self._smoothed.dt:
            return self._smoothed.pose  # it begins at rest
        target = self._pointer.news()
        if target is not None:
            self._target = target
            self._reaching.wanted = target.press
            if target.table is None:
                self._smoothed.lead_to(target.pose)
        if self._target is not None and self._target.table is not None:
            self._smoothed.put(self._row(self._target, seconds))
        return self._smoothed.advance()

    def _row(self, target: PointerTarget, seconds: float) -> NDArray[np.float64]:
        """Return the pose of the table at the hand's time [s]."""
        assert target.table is not None
        row = max((self._opened + seconds - target.begun) / target.step, 0.0)
        last, loop = len(target.table) - 1, min(target.loop, len(target.table) - 1)
        if row >= last and last > loop:
            row = loop + (row - loop) % (last - loop)
        i = min(int(row), max(last - 1, 0))
        return interpolate_pose(target.table[i], target.table[min(i + 1, last)], min(row - i, 1.0))
