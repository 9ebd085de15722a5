"""The contact wrench linearised about a pose, for use between two contact queries."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class LinearContact(NamedTuple):
    """A contact wrench and its stiffness.

    After a displacement `d` (6,), the translation of the centre of mass [m] and a rotation vector
    [rad] in world axes, the wrench is `wrench - stiffness @ d` (Otaduy & Lin 2006).
    """

    pose: NDArray[np.float64]
    """Pose of the tool's frame at the contact query (7,)."""
    wrench: NDArray[np.float64]
    """On the tool about its centre of mass: force [N], torque [N m], world axes (6,)."""
    stiffness: NDArray[np.float64]
    """(6, 6), positive semidefinite [N/m, N/rad, N, N m/rad]."""
    count: int  # type: ignore[assignment]  # hides tuple.count
    """Number of contacts."""
    flags: int
    """Bits of `asperity.simulation.tool_contact.FLAGS`."""
