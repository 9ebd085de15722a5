"""The contact wrench near a pose, to first order: what is felt between two contact queries."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class LinearContact(NamedTuple):
    """A contact wrench and how it changes with the pose.

    Moved by `d`, translation of the centre of mass [m] and rotation vector [rad] in world axes,
    the wrench is `wrench - stiffness @ d` (Otaduy & Lin 2006).
    """

    pose: NDArray[np.float64]
    """Of the tool's frame when the contact was looked at (7,)."""
    wrench: NDArray[np.float64]
    """On the tool about its centre of mass: force [N], torque [N m], world axes (6,)."""
    stiffness: NDArray[np.float64]
    """(6, 6), positive semidefinite [N/m, N/rad, N, N m/rad]."""
    count: int  # type: ignore[assignment]  # hides tuple.count
    """How many contacts there were."""
    flags: int
    """Bits of `asperity.simulation.tool_contact.FLAGS`."""
