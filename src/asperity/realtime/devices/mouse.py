"""A mouse as a device: a simulated hand that goes where a page points.

A page tells of its pointer 60 times a second at best, in steps of a millimetre or more. A hand that
followed these would shake in the very band in which texture is felt. So the target is led, in two
stages at the servo's rate: from where it is straight to what was last pointed at, in a quarter more
than the time between the last words, so that an even drag comes out even; then through three equal
poles of `SMOOTHING`, a critically damped filter, which rounds the corners that are left. The hand
itself (`dynamics.simulated_hand`) is a low-pass besides, and yields to what it feels.

A table of poses (`devices.pointed`) is gone through in the same way, but needs no leading.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics.simulated_hand.hand import MOST_OFFSET, HandSettings, SimulatedHand
from asperity.errors import AsperityError, require_between
from asperity.geometry.poses import interpolate_pose, rotation_between
from asperity.realtime.devices.pointer_file import Pointed, Wanted
from asperity.realtime.devices.protocol import Limits
from asperity.realtime.devices.simulated import LIMITS, SimulatedDevice

SMOOTHING = 12e-3
"""Time constant of each of the three poles [s]; ours."""
SLACK = 1.25
"""So many intervals are taken to lead to what was pointed at; ours."""
_INTERVALS = 8e-3, 80e-3
"""Between two words [s]: shorter and longer ones are taken for these."""
FASTEST, FASTEST_TURN = 0.5, 12.0
"""No target is led faster [m/s], [rad/s]; ours."""
REACHING = 0.02
"""A hand that shall press and touches nothing comes down so fast [m/s]; ours."""

WIDE = replace(LIMITS, radius=1.0)
"""What limits a pointer: the simulated device's force, and no workspace to speak of."""

LONGEST = 0.02
"""Time that the hand makes up for after a pause of the loop, at most [s]. What it makes up for
costs time itself: a loop on a busy computer must not be late because it was late."""


class Led:
    """A target that is led smoothly, tick by tick, to what is pointed at.

    Parameters
    ----------
    pose : (7,) array
        Where it begins, at rest.
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
        """Where the target is (7,)."""
        return self._poles[-1]

    def lead_to(self, goal: NDArray[np.float64]) -> None:
        """Go to a pose that has just been told."""
        shortest, longest = _INTERVALS
        if self._since < 2.0 * longest:
            interval = min(max(self._since, shortest), longest)
            self._interval += 0.2 * (interval - self._interval)
        self._since = 0.0
        self._goal = np.array(goal, dtype=np.float64)
        way = math.dist(self._straight[:3].tolist(), self._goal[:3].tolist())
        turn = float(np.linalg.norm(rotation_between(self._straight, self._goal)))
        seconds = max(SLACK * self._interval, way / FASTEST, turn / FASTEST_TURN)
        self._left = max(math.ceil(seconds / self.dt), 1)

    def put(self, goal: NDArray[np.float64]) -> None:
        """Take the next pose of an even motion: it is only smoothed."""
        self._left, self._since = 0, math.inf
        self._goal = self._straight = goal

    def advance(self) -> NDArray[np.float64]:
        """Go on by a tick; return where the target is then (7,)."""
        self._since += self.dt
        if self._left > 0:
            self._straight = _on_the_way(self._straight, self._goal, 1.0 / self._left)
            self._left -= 1
        behind = self._straight
        for i, pole in enumerate(self._poles):
            behind = self._poles[i] = _on_the_way(pole, behind, self._share)
        return behind


def _on_the_way(
    first: NDArray[np.float64], last: NDArray[np.float64], share: float
) -> NDArray[np.float64]:
    """Return the pose at a share of the way; quickly where nothing turns."""
    if (first[3:] == last[3:]).all():
        return first + share * (last - first)
    return interpolate_pose(first, last, share)


class ReachingHand(SimulatedHand):
    """A simulated hand that comes down to press, and lets go when it shall no longer."""

    wanted: float | None = None
    """Normal force to press with [N]; None: as it comes."""

    def _press(self, felt: float) -> None:
        step = REACHING * self.dt
        if self.wanted is None:
            self.offset = math.copysign(max(abs(self.offset) - step, 0.0), self.offset)
        elif felt > 0.0:
            # The target may be too deep already: then it is drawn back.
            gain = self.dt / (self._soft * self.settings.press_time)
            self.offset += (self.wanted - felt) * gain
            most = MOST_OFFSET + self.wanted / self._soft
            self.offset = min(max(self.offset, -most), most)
        else:
            self.offset = min(self.offset + step, MOST_OFFSET + self.wanted / self._soft)

    def press_with(self, force: float | None) -> None:
        """Press with a normal force [N] from now on, or with none that is regulated."""
        self.wanted = force


class MouseDevice(SimulatedDevice):
    """A `Device` in a simulated hand that follows a page's pointer.

    Parameters
    ----------
    target : Path, optional
        The file of `Pointed`. Without one it cannot be opened.
    dt : float
        Tick of the hand [s], 1e-5 to 0.1.
    centre : (3,) sequence, optional
        The tool's centre of mass, in the handle's frame [m].
    settings : HandSettings, optional
    limits : Limits
    clock : callable
        Time now [s]; it is compared with `Pointed.move`'s.
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
        self._told: Wanted | None = None
        self._pointed: Pointed | None = None
        self._led = Led(np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), dt)
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
        """Begin where is pointed at, at rest."""
        if self._path is None:
            raise AsperityError("the device mouse needs a page that points: asperity view SCENE")
        self._opened = self._clock()
        self._pointed = Pointed(self._path)
        self._told = told = self._pointed.news()
        if told is not None:
            start = told.pose if told.table is None else self._row(told, 0.0)
            self._led = Led(start, self.hand.dt)
            self._reaching.press_with(None if math.isnan(told.press) else told.press)
        super().open()

    def _aim(self, seconds: float) -> NDArray[np.float64]:
        """Return where the hand shall be at a time [s]; asked once a tick, in order."""
        if self._pointed is None or seconds <= 1.5 * self._led.dt:
            return self._led.pose  # it begins at rest
        told = self._pointed.news()
        if told is not None:
            self._told = told
            self._reaching.press_with(None if math.isnan(told.press) else told.press)
            if told.table is None:
                self._led.lead_to(told.pose)
        if self._told is not None and self._told.table is not None:
            self._led.put(self._row(self._told, seconds))
        return self._led.advance()

    def _row(self, told: Wanted, seconds: float) -> NDArray[np.float64]:
        """Return the pose of a table that is due at a time of the hand [s]."""
        assert told.table is not None
        row = max((self._opened + seconds - told.begun) / told.step, 0.0)
        last, loop = len(told.table) - 1, min(told.loop, len(told.table) - 1)
        if row >= last and last > loop:
            row = loop + (row - loop) % (last - loop)
        i = min(int(row), max(last - 1, 0))
        return interpolate_pose(told.table[i], told.table[min(i + 1, last)], min(row - i, 1.0))
