"""Stiffness and damping of the contacts: the first-order change of the wrench with the motion.

The energy `U = 1/2 k sum_p w_p delta_p^2` has the Hessian

    k sum_p w_p (grad delta_p grad delta_p^T + delta_p Hessian(delta_p)).

The first term is positive semidefinite and exact at the contact, where `grad delta = -(m, r x m)`.
The second is negative on crests and unbounded at kinks. Only the first is kept (the Gauss-Newton
approximation), so that an implicit step always has a solution. A sticking bristle adds its
stiffness perpendicular to m; a slipping one adds none.

With the damping of Hunt and Crossley, a contact's force is `k w delta (1 + a v) m`, with v the rate
of delta. Its derivative by the rate, `a k w delta grad delta grad delta^T`, is the damping matrix.
Friction that slips at the speed v with the force f acts on the next step as a damper f / v, limited
to that of a sticking bristle: so it opposes any motion, and dissipates energy.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, kernel
from asperity._core.stack import stack_array
from asperity._core.structures import by_reference
from asperity.geometry.rigid_body import fill_lever_arm

_STICKS = 1.0 - 1e-9
"""Fraction of its limit below which a bristle's force is sticking."""


@by_reference
class ContactDerivatives(NamedTuple):
    """First-order model of the wrench of contacts at another pose and velocity.

    After a displacement d and at a velocity v it is `wrench - damped - stiffness d - damping v`.
    """

    stiffness: NDArray[np.float64]
    """(6, 6) [N/m, N/rad; N, N m/rad]."""
    damping: NDArray[np.float64]
    """(6, 6) [N s/m, N s/rad; N s, N m s/rad]."""
    damped: NDArray[np.float64]
    """The velocity-dependent part of the wrench, (6,) [N, N m]."""


class SlipMotion(NamedTuple):
    """The tool's motion up to the pose, for slipping friction."""

    twist: NDArray[np.float64]
    """Velocity of the centre of mass and angular velocity, world axes (6,); zero if unknown."""
    dt: float
    """Time over which a bristle is stretched [s]."""


AT_REST = SlipMotion(np.zeros(6), 0.0)


@kernel
def contact_stiffness(contacts, pose, centre, parameters, motion, out):
    """Fill stiffness, damping and damped part of contacts about the tool's centre of mass.

    Parameters
    ----------
    contacts : Contacts
    pose : (7,) array
        Of the tool's frame.
    centre : (3,) array
        The tool's centre of mass in its frame [m].
    parameters : ForceParameters
    motion : SlipMotion
    out : ContactDerivatives
    """
    stiffness, origin = parameters.stiffness, stack_array((3,))
    fill_lever_arm(pose, centre, origin)
    for i in range(3):
        origin[i] += pose[i]
    for i in range(6):
        for j in range(6):
            out.stiffness[i, j] = out.damping[i, j] = 0.0
        out.damped[i] = 0.0
    for c in range(contacts.count[0]):
        point, m, weight = contacts.point[c], contacts.slope_normal[c], contacts.weight[c]
        force = contacts.force[c]
        arm = (point[0] - origin[0], point[1] - origin[1], point[2] - origin[2])
        slope_normal = (m[0], m[1], m[2])
        square = m[0] * m[0] + m[1] * m[1] + m[2] * m[2]
        along = (force[0] * m[0] + force[1] * m[1] + force[2] * m[2]) / square
        push = stiffness * weight * contacts.depth[c]
        _add_spring(arm, slope_normal, stiffness * weight, out.stiffness)
        if parameters.dissipation > 0.0:
            _add_spring(arm, slope_normal, parameters.dissipation * push, out.damping)
            _add_force(arm, slope_normal, along - push, out.damped)
        friction, sticking = contacts.friction[c], contacts.bristle_stiffness[c]
        if friction == 0.0:
            continue
        drag = 0.0
        for i in range(3):
            drag += (force[i] - along * m[i]) ** 2
        # The friction limit is that of the normal force including damping.
        drag = math.sqrt(drag)
        if drag < _STICKS * friction * along * math.sqrt(square):
            _add_tangential(arm, slope_normal, sticking, out.stiffness)
            continue
        speed = _slip_speed(arm, slope_normal, motion.twist)
        if speed > 0.0:
            slowing = min(drag / speed, sticking * motion.dt)
            _add_tangential(arm, slope_normal, slowing, out.damping)
            _add_force(arm, (force[0], force[1], force[2]), 1.0, out.damped)
            _add_force(arm, slope_normal, -along, out.damped)


@inner_kernel
def _slip_speed(arm, direction, twist):
    """Return the speed of a point across a direction; `arm` and `direction` are tuples of 3."""
    (rx, ry, rz), (mx, my, mz) = arm, direction
    x = twist[0] + twist[4] * rz - twist[5] * ry
    y = twist[1] + twist[5] * rx - twist[3] * rz
    z = twist[2] + twist[3] * ry - twist[4] * rx
    along = (x * mx + y * my + z * mz) / (mx * mx + my * my + mz * mz)
    x, y, z = x - along * mx, y - along * my, z - along * mz
    return math.sqrt(x * x + y * y + z * z)


@inner_kernel
def _add_tangential(arm, direction, stiffness, out):
    """Add an isotropic stiffness perpendicular to a direction."""
    (mx, my, mz) = direction
    _add_spring(arm, (1.0, 0.0, 0.0), stiffness, out)
    _add_spring(arm, (0.0, 1.0, 0.0), stiffness, out)
    _add_spring(arm, (0.0, 0.0, 1.0), stiffness, out)
    _add_spring(arm, direction, -stiffness / (mx * mx + my * my + mz * mz), out)


@inner_kernel
def _add_force(arm, direction, size, wrench_out):
    """Add the wrench of a force `size` times a direction; both are tuples of 3."""
    (rx, ry, rz), (mx, my, mz) = arm, direction
    wrench_out[0] += size * mx
    wrench_out[1] += size * my
    wrench_out[2] += size * mz
    wrench_out[3] += size * (ry * mz - rz * my)
    wrench_out[4] += size * (rz * mx - rx * mz)
    wrench_out[5] += size * (rx * my - ry * mx)


@inner_kernel
def _add_spring(arm, direction, stiffness, out):
    """Add `stiffness` J J^T with J = (direction, arm x direction); both are tuples of 3."""
    jacobian = stack_array((6,))
    (rx, ry, rz), (mx, my, mz) = arm, direction
    jacobian[0], jacobian[1], jacobian[2] = mx, my, mz
    jacobian[3], jacobian[4], jacobian[5] = (
        ry * mz - rz * my, rz * mx - rx * mz, rx * my - ry * mx,
    )  # fmt: skip
    for i in range(6):
        for j in range(6):
            out[i, j] += stiffness * jacobian[i] * jacobian[j]
