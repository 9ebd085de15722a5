"""What the servo loop asks of a haptic device, and what a device declares of itself.

A device is read and written once a tick by one process, the one that opened it. Reading never
waits: it hands over the newest pose there is, and says whether it is new. Writing never raises: a
wrench that could not be delivered is reported by the next reading.

Poses, twists and wrenches are those of the device's own end effector in its own workspace, axes
right-handed with x to the right, y away from the user and z up; `mapping.Mapping` turns them
into those of the scene. A backend turns its vendor's axes into these.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from asperity.errors import require_between, require_not_negative, require_positive


@dataclass(frozen=True)
class Limits:
    """What a device can do; what it is told stays within this.

    Parameters
    ----------
    max_force, max_torque : float
        Largest that may be commanded [N], [N m]. A torque of 0: it has none.
    max_stiffness, max_damping : float
        Largest stiffness [N/m] and damping [N s/m] that may be rendered.
    max_rotational_stiffness : float
        Largest rotational stiffness [N m/rad]; 0 where it has no torque.
    radius : float
        Of its workspace, a ball round the device's origin [m].
    damping : float
        The device's own, physical damping, for bounds of stability [N s/m]. 0.1 is asperity's.
    force_dof, torque_dof : int
        Directions that it can push in, 0 to 3, and turn about, 0 to 3.
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
    """What a device last told of itself; the arrays are filled in place."""

    pose: NDArray[np.float64]
    """Of the end effector: position [m], unit quaternion wxyz; (7,)."""
    twist: NDArray[np.float64]
    """Linear [m/s] and angular [rad/s] velocity; (6,)."""
    buttons: int = 0
    """Pressed buttons, one bit each, the lowest first."""
    age: float = 0.0
    """How long ago the device measured this [s], as far as is known; infinite: never."""
    error: str = ""
    """What went wrong since the last reading: empty if nothing did."""

    @staticmethod
    def empty() -> Reading:
        """Return a reading at the origin."""
        return Reading(np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), np.zeros(6), age=float("inf"))


class Device(Protocol):
    """A haptic device. `limits` and `name` are known before it is opened.

    One with an attribute `in_loop` that is true has no thread, process or service working for it:
    where there are two cores, the loop may keep one of them busy.
    """

    name: str
    limits: Limits

    def open(self) -> None:
        """Connect; raise `AsperityError`, one line with what to do, if that fails."""

    def read(self, out: Reading) -> bool:
        """Fill the newest reading; return whether there was a new one. Never waits or raises."""

    def write(self, wrench: NDArray[np.float64]) -> None:
        """Send force [N] and torque about the end effector [N m] (6,). Never waits or raises."""

    def close(self) -> None:
        """Send a zero wrench and disconnect. May be called twice. Never raises."""
