"""The protocol between the servo loop and a haptic device.

A device is read and written once per tick by one process, the one that opened it. Reading never
waits: it returns the newest pose and whether it is new. Writing never raises: a wrench that could
not be delivered is reported by the next reading.

Poses, twists and wrenches are those of the device's end effector in its own workspace, in
right-handed axes with x to the right, y away from the user and z up. A backend converts from its
vendor's axes to these; `mapping.Mapping` maps them to the scene.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from asperity.errors import require_between, require_not_negative, require_positive

ZERO = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
REFUSED = "the wrench was not six finite numbers; zero was sent"


@dataclass(frozen=True)
class Limits:
    """What a device can render; everything that is sent stays within this.

    Parameters
    ----------
    max_force, max_torque : float
        Largest force [N] and torque [N m]. A torque of 0: the device renders none.
    max_stiffness, max_damping : float
        Largest stiffness [N/m] and damping [N s/m] that can be rendered stably.
    max_rotational_stiffness : float
        Largest rotational stiffness [N m/rad]; 0 without torque.
    radius : float
        Radius of the workspace, a ball about the device's origin [m].
    damping : float
        The device's physical damping, for stability bounds [N s/m]. 0.1 is a project default.
    force_dof, torque_dof : int
        Number of axes along which it renders forces, and about which torques, 0 to 3.
    senses_rotation : bool
        Whether it measures the orientation of the end effector.
    """

    max_force: float
    max_torque: float
    max_stiffness: float
    max_damping: float
    max_rotational_stiffness: float = 0.0
    radius: float = 0.1
    damping: float = 0.1
    force_dof: int = 3
    torque_dof: int = 0
    senses_rotation: bool = True

    def __post_init__(self) -> None:
        for name in ("max_force", "max_stiffness", "radius"):
            require_positive(name, getattr(self, name))
        for name in ("max_torque", "max_damping", "max_rotational_stiffness", "damping"):
            require_not_negative(name, getattr(self, name))
        for name in ("force_dof", "torque_dof"):
            require_between(name, getattr(self, name), 0, 3)


@dataclass
class Reading:
    """What a device measured last; the arrays are filled in place."""

    pose: NDArray[np.float64]
    """Pose of the end effector (7,): position [m] and unit quaternion wxyz."""
    twist: NDArray[np.float64]
    """Linear [m/s] and angular [rad/s] velocity (6,)."""
    buttons: int = 0
    """Pressed buttons, one bit each, the lowest first."""
    age: float = 0.0
    """Time since the measurement [s], as far as known; infinite: there was none."""
    error: str = ""
    """What went wrong since the last reading; empty if nothing did."""

    @staticmethod
    def empty() -> Reading:
        """Return a reading at the origin."""
        return Reading(np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), np.zeros(6), age=float("inf"))


class Device(Protocol):
    """A haptic device. `limits` and `name` are known before it is opened.

    A device may have an attribute `in_loop`; if true, no thread, process or service works for it,
    and the loop may keep one of two cores busy.
    """

    name: str
    limits: Limits

    def open(self) -> None:
        """Connect.

        Raises
        ------
        AsperityError
            It failed; the message explains what to do.
        """

    def read(self, out: Reading) -> bool:
        """Fill the newest reading; return whether it is new. Never waits or raises."""

    def write(self, wrench: NDArray[np.float64]) -> None:
        """Send force [N] and torque about the end effector [N m] (6,). Never waits or raises."""

    def close(self) -> None:
        """Send a zero wrench and disconnect. May be called twice. Never raises."""


def finite_wrench(wrench: NDArray[Any] | Sequence[float]) -> tuple[float, ...] | None:
    """Return force and torque as six floats, or None if they are not six finite numbers."""
    try:
        values = tuple(map(float, wrench))
    except Exception:  # a device's `write` must not raise, whatever it was given
        return None
    # Each number is checked, as a sum of finite numbers may overflow.
    return values if len(values) == 6 and all(map(math.isfinite, values)) else None
