"""The contact wrench linearised about a pose, for use between two contact queries."""

from __future__ import annotations

from typing import NamedTuple

from asperity._core.arrays import Array


class LinearContact(NamedTuple):
    """A contact wrench and its stiffness.

    After a displacement `d` (6,), the translation of the centre of mass [m] and a rotation vector
    [rad] in world axes, the wrench is `wrench - stiffness @ d` (Otaduy & Lin 2006).
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
