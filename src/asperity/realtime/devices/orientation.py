"""Orientations of devices: quaternions from matrices, angular velocities from differences.

Devices that measure orientation but not its rate (the VerseGrip, a stylus with encoders) leave the
angular velocity to be estimated. A plain difference over one tick multiplies the sensor's noise by
1000 1/s, so it is passed through a first-order low-pass, at the price of its lag.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco
import numpy as np

from asperity.geometry.poses import Pose, rotation_between

RATE_TIME_CONSTANT = 0.01
"""Time constant of the low-pass on the angular velocity [s]; project default."""


def unit_quaternion(w: float, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Return the normalised quaternion; raise ValueError if its norm is not within 0.9 to 1.1."""
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    if not 0.9 < norm < 1.1:  # also refuses nan
        raise ValueError(f"an orientation has norm {norm:.3g}; a unit quaternion has 1")
    return w / norm, x / norm, y / norm, z / norm


def quaternion_of(rows: Sequence[Sequence[float]]) -> tuple[float, float, float, float]:
    """Return the unit quaternion wxyz of a rotation matrix.

    Raises
    ------
    ValueError
        The matrix is not a rotation, to 0.1 in its elements.
    """
    matrix, quaternion, again = (
        np.array(rows, dtype=np.float64).reshape(9),
        np.empty(4),
        np.empty(9),
    )
    mujoco.mju_mat2Quat(quaternion, matrix)
    mujoco.mju_quat2Mat(again, quaternion)
    if not np.abs(again - matrix).max() <= 0.1:  # also refuses nan
        raise ValueError("the orientation is not a rotation")
    w, x, y, z = quaternion.tolist()
    return w, x, y, z


class TurnRate:
    """Angular velocity in world axes, estimated from successive orientations.

    Parameters
    ----------
    time_constant : float
        Of the low-pass [s].
    """

    def __init__(self, time_constant: float = RATE_TIME_CONSTANT) -> None:
        self._time_constant = time_constant
        self._last: tuple[float, Pose] | None = None
        self.rate = (0.0, 0.0, 0.0)
        """Angular velocity [rad/s]."""

    def add(self, time: float, quaternion: tuple[float, float, float, float]) -> None:
        """Add the orientation measured at `time` [s]."""
        pose = np.array([0.0, 0.0, 0.0, *quaternion])
        last, self._last = self._last, (time, pose)
        if last is None or time <= last[0]:
            return
        seconds = time - last[0]
        if seconds > 0.1:  # after a gap the difference means nothing
            self.rate = (0.0, 0.0, 0.0)
            return
        share = seconds / (seconds + self._time_constant)
        rate = np.array(self.rate)
        rate += share * (rotation_between(last[1], pose) / seconds - rate)
        x, y, z = rate.tolist()
        self.rate = x, y, z

    def forget(self) -> None:
        """Restart, as after a lost connection."""
        self._last, self.rate = None, (0.0, 0.0, 0.0)
