"""The contact wrench linearised about a pose, for use between two contact queries."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array
from asperity._core.structures import by_reference


@by_reference
class LinearContact(NamedTuple):
    """A contact wrench with its stiffness and damping.

    After a displacement `d` (6,), the translation of the centre of mass [m] and a rotation vector
    [rad] in world axes, and at a velocity `v` (6,), the wrench is
    `wrench - damped - stiffness @ d - damping @ v` (Otaduy & Lin 2006).
    """

    pose: Array
    """Pose of the tool's frame at the contact query (7,)."""
    wrench: Array
    """On the tool about its centre of mass: force [N], torque [N m], world axes (6,)."""
    stiffness: Array
    """(6, 6), positive semidefinite [N/m, N/rad, N, N m/rad]."""
    count: int  # type: ignore[assignment]  # hides tuple.count
    """Number of contacts."""
    flags: int
    """Bits of `asperity.simulation.tool_contact.FLAGS`."""
    damping: Array = np.zeros((6, 6))
    """(6, 6), positive semidefinite [N s/m, N s/rad, N s, N m s/rad]."""
    damped: Array = np.zeros(6)
    """The part of the wrench that is due to the velocity (6,)."""
    energy: float = 0.0
    """U, stored in the contacts at that pose [J]."""
    is_gradient: bool = True
    """Whether the wrench, without friction and damping, is minus the gradient of U."""
