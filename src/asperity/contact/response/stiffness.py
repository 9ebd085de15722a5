r"""Stiffness and damping of the contacts: how the wrench changes, to first order, with the motion.

The energy `U = 1/2 k sum_p w_p delta_p^2` has the Hessian

    k sum_p w_p (grad delta_p grad delta_p^T + delta_p Hessian(delta_p)).

The first term is positive semidefinite and known exactly at the contact, where
`grad delta = -(m, r x m)`. The second is negative on crests and unbounded at kinks. Only the first
is kept (as Gauss and Newton do), so that an implicit step always has a solution. A bristle that
sticks adds its stiffness perpendicular to m; one that slips adds none.

With the damping of Hunt and Crossley, a contact's force is `k w delta (1 + a v) m`, with v the rate
of delta. Its derivative by the rate, `a k w delta grad delta grad delta^T`, is the damping matrix.
"""

from __future__ import annotations

import math

from asperity._core.kernels import inner_kernel, kernel
from asperity._core.stack import stack_array
from asperity.geometry.rigid_body import fill_lever_arm

_STICKS = 1.0 - 1e-9
"""A bristle whose force is below this part of its limit sticks."""


@kernel
def contact_stiffness(contacts, pose, centre, parameters, weighted, stiffness_out, damping_out):
    """Fill stiffness and damping (6, 6) of contacts about the tool's centre of mass.

    Parameters
    ----------
    contacts : Contacts
    pose : (7,) array
        Of the tool's frame.
    centre : (3,) array
        The tool's centre of mass in its frame [m].
    parameters : ForceParameters
    weighted : (bodies,) array of int
        Whether the contacts of a body share its bristle's stiffness by their weights.
    stiffness_out : (6, 6) array
        [N/m, N/rad; N, N m/rad].
    damping_out : (6, 6) array
        [N s/m, N s/rad; N s, N m s/rad].
    """
    stiffness, friction = parameters.stiffness, parameters.friction
    origin = stack_array((3,))
    fill_lever_arm(pose, centre, origin)
    for i in range(3):
        origin[i] += pose[i]
    for i in range(6):
        for j in range(6):
            stiffness_out[i, j] = damping_out[i, j] = 0.0
    for c in range(contacts.count[0]):
        point, m, weight = contacts.point[c], contacts.slope_normal[c], contacts.weight[c]
        force = contacts.force[c]
        arm = (point[0] - origin[0], point[1] - origin[1], point[2] - origin[2])
        slope_normal = (m[0], m[1], m[2])
        square = m[0] * m[0] + m[1] * m[1] + m[2] * m[2]
        along = (force[0] * m[0] + force[1] * m[1] + force[2] * m[2]) / square
        push = stiffness * weight * contacts.depth[c]
        # 1 + a v of the normal force: 0 where the contact opens too fast to push.
        factor = 1.0
        if parameters.dissipation > 0.0 and push > 0.0:
            factor = max(along / push, 0.0)
            if factor > 0.0:
                _add_spring(arm, slope_normal, parameters.dissipation * push, damping_out)
        _add_spring(arm, slope_normal, factor * stiffness * weight, stiffness_out)
        if friction == 0.0:
            continue
        drag = 0.0
        for i in range(3):
            drag += (force[i] - along * m[i]) ** 2
        # Friction is limited by the normal force, which the damping is part of.
        if math.sqrt(drag) >= _STICKS * friction * along * math.sqrt(square):
            continue
        sticking = parameters.bristle_stiffness
        if weighted[contacts.body[c]] == 1:
            sticking *= weight
        # Perpendicular to m: all directions less that of m.
        _add_spring(arm, (1.0, 0.0, 0.0), sticking, stiffness_out)
        _add_spring(arm, (0.0, 1.0, 0.0), sticking, stiffness_out)
        _add_spring(arm, (0.0, 0.0, 1.0), sticking, stiffness_out)
        _add_spring(arm, slope_normal, -sticking / square, stiffness_out)


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
