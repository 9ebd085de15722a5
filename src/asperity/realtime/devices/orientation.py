"""Orientations of devices: quaternions from matrices, angular velocities from differences.

Devices that measure orientation but not its rate (the VerseGrip, a stylus with encoders) leave the
angular velocity to be estimated. A plain difference over one tick multiplies the sensor's noise by
1000 1/s, so it is passed through a first-order low-pass, at the price of its lag.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

RATE_TIME_CONSTANT = 0.01
"""Time constant of the low-pass on the angular velocity [s]; project default."""


def unit_quaternion(w: float, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Return the normalised quaternion; raise ValueError if its norm is not within 0.9 to 1.1."""
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    if not 0.9 < norm < 1.1:  # also refuses nan
        raise ValueError(f"an orientation has norm {norm:.3g}; a unit quaternion has 1")
    return w / norm, x / norm, y / norm, z / norm


def quaternion_of(rows: Sequence[Sequence[float]]) -> tuple[float, float, float, float]:
    """Return the unit quaternion wxyz of a rotation matrix, starting from its largest component.

    Raises
    ------
    ValueError
        The matrix is not a rotation, to 0.1 in the norm of the quaternion.
    """
    (a, b, c), (d, e, f), (g, h, i) = rows
    squares = (1.0 + a + e + i, 1.0 + a - e - i, 1.0 - a + e - i, 1.0 - a - e + i)
    largest = max(range(4), key=squares.__getitem__)
    if not squares[largest] > 0.0:
        raise ValueError("the orientation is not a rotation")
    s = 2.0 * math.sqrt(squares[largest])
    quaternion = (
        (s / 4.0, (h - f) / s, (c - g) / s, (d - b) / s),
        ((h - f) / s, s / 4.0, (b + d) / s, (c + g) / s),
        ((c - g) / s, (b + d) / s, s / 4.0, (f + h) / s),
        ((d - b) / s, (c + g) / s, (f + h) / s, s / 4.0),
    )[largest]
    return unit_quaternion(*quaternion)


class TurnRate:
    """Angular velocity in world axes, estimated from successive orientations.

    Parameters
    ----------
    time_constant : float
        Of the low-pass [s].
    """

    def __init__(self, time_constant: float = RATE_TIME_CONSTANT) -> None:
        self._time_constant = time_constant
        self._then: float | None = None
        self._last = (1.0, 0.0, 0.0, 0.0)
        self.rate = (0.0, 0.0, 0.0)
        """Angular velocity [rad/s]."""

    def add(self, time: float, quaternion: tuple[float, float, float, float]) -> None:
        """Add the orientation measured at `time` [s]."""
        then, last = self._then, self._last
        self._then, self._last = time, quaternion
        if then is None or time <= then:
            return
        seconds = time - then
        if seconds > 0.1:  # after a gap the difference means nothing
            self.rate = (0.0, 0.0, 0.0)
            return
        share = seconds / (seconds + self._time_constant)
        turn = _turn(last, quaternion)
        rx, ry, rz = self.rate
        self.rate = (
            rx + share * (turn[0] / seconds - rx),
            ry + share * (turn[1] / seconds - ry),
            rz + share * (turn[2] / seconds - rz),
        )

    def forget(self) -> None:
        """Restart, as after a lost connection."""
        self._then, self.rate = None, (0.0, 0.0, 0.0)


def _turn(
    first: tuple[float, float, float, float], last: tuple[float, float, float, float]
) -> tuple[float, float, float]:
    """Return the rotation vector from one orientation to the next, the shorter way [rad]."""
    aw, ax, ay, az = first
    bw, bx, by, bz = last
    # last * conjugate(first)
    w = bw * aw + bx * ax + by * ay + bz * az
    x = -bw * ax + bx * aw - by * az + bz * ay
    y = -bw * ay + bx * az + by * aw - bz * ax
    z = -bw * az - bx * ay + by * ax + bz * aw
    sine = math.sqrt(x * x + y * y + z * z)
    if sine < 1e-15:
        return 0.0, 0.0, 0.0
    scale = math.copysign(2.0 * math.atan2(sine, abs(w)) / sine, w)
    return x * scale, y * scale, z * scale
