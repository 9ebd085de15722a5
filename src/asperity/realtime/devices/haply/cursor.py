"""The moving part of the fake Inverse3: a mass that a hand holds and the motors push.

    m x'' = F_motor + k (x_hand(t) - x) - b x'

`x_hand` is where the hand wants to be; k and b are those of the paper's hand (asperity's defaults),
m the hand's mass with the device's. Stepped at a fixed 0.25 ms up to the time that is asked for,
semi-implicitly.
"""

from __future__ import annotations

import math
from collections.abc import Callable

Point = tuple[float, float, float]
HOME: Point = (0.0, -0.12, 0.15)
"""In the middle of the workspace, seen from the device's base [m]."""
_STEP = 0.25e-3
_LONGEST_CATCH_UP = 0.05


def stroking_hand(time: float) -> Point:
    """Return where a hand that strokes to and fro wants to be: 40 mm in 4 s, pressing by turns."""
    phase = 2.0 * math.pi * time / 4.0
    x, y, z = HOME
    down = 4e-3 * (0.5 - 0.5 * math.cos(phase / 2.0))
    return x + 0.02 * math.sin(phase), y, z - down


def still_hand(_: float) -> Point:
    """Return where a hand that keeps still wants to be."""
    return HOME


class Cursor:
    """Position and velocity of the end effector.

    Parameters
    ----------
    hand : callable
        Where the hand wants to be [m] at a time [s].
    mass, stiffness, damping : float
        Of hand and device together [kg], of the hand [N/m], [N s/m].
    """

    def __init__(
        self,
        hand: Callable[[float], Point] = stroking_hand,
        *,
        mass: float = 0.2,
        stiffness: float = 300.0,
        damping: float = 6.0,
    ) -> None:
        self.hand = hand
        self._mass, self._stiffness, self._damping = mass, stiffness, damping
        self._time = 0.0
        self.position = list(hand(0.0))
        self.velocity = [0.0, 0.0, 0.0]

    def advance(self, time: float, force: Point) -> None:
        """Move on to `time` [s] under the motors' force [N]. After a long gap, part of it only."""
        self._time = max(self._time, time - _LONGEST_CATCH_UP)
        x, v = self.position, self.velocity
        while self._time + _STEP <= time:
            self._time += _STEP
            wanted = self.hand(self._time)
            for i in range(3):
                pull = self._stiffness * (wanted[i] - x[i]) - self._damping * v[i]
                v[i] += _STEP / self._mass * (force[i] + pull)
                x[i] += _STEP * v[i]
