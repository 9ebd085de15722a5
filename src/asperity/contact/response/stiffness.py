r"""How the contact wrench changes with the tool's pose: the first-order part, compiled.

Of the energy `U = 1/2 k sum_p w_p delta_p^2` the Hessian is

    k sum_p w_p (grad delta_p grad delta_p^T + delta_p Hessian(delta_p)).

The first term is positive semidefinite and known exactly from where the contact is,
`grad delta = -(m, r x m)`; the second is negative on crests and has no bound at kinks. Kept is
the first alone (Gauss and Newton's choice), so that an implicit step always has a solution.
A bristle that sticks adds its stiffness across m; one that slips adds none.
"""

from __future__ import annotations

import math

from asperity._core.kernels import inner_kernel, kernel
from asperity.geometry.rigid_body import fill_lever_arm

_STICKS = 1.0 - 1e-9
"""A bristle below this part of its limit sticks."""


@kernel
def contact_stiffness(contacts, pose, centre, parameters, weighted, room, out):
    """Fill the stiffness (6, 6) of contacts, about the tool's centre of mass.

    Parameters
    ----------
    contacts : engine.memory.Contacts
    pose : (7,) array
        Of the tool's frame.
    centre : (3,) array
        The tool's centre of mass, in its frame.
    parameters : engine.memory.Parameters
    weighted : (bodies,) array of int
        Whether a body's bristles share its stiffness by their weights.
    room : (9,) array
        Room to work in.
    out : (6, 6) array
        [N/m, N/rad, N, N m/rad].
    """
    stiffness, friction = parameters.stiffness, parameters.friction
    point, slope_normal, weight = contacts.point, contacts.slope_normal, contacts.weight
    origin, jacobian = room[6:], room[:6]
    fill_lever_arm(pose, centre, origin)
    for i in range(3):
        origin[i] += pose[i]
    for i in range(6):
        for j in range(6):
            out[i, j] = 0.0
    for c in range(contacts.count[0]):
        rx, ry, rz = (
            point[c, 0] - origin[0], point[c, 1] - origin[1], point[c, 2] - origin[2],
        )  # fmt: skip
        mx, my, mz = slope_normal[c, 0], slope_normal[c, 1], slope_normal[c, 2]
        _add(jacobian, rx, ry, rz, mx, my, mz, stiffness * weight[c], out)
        if friction == 0.0:
            continue
        push = stiffness * weight[c] * contacts.depth[c]
        square = mx * mx + my * my + mz * mz
        drag = 0.0
        for i in range(3):
            drag += (contacts.force[c, i] - push * slope_normal[c, i]) ** 2
        if math.sqrt(drag) >= _STICKS * friction * push * math.sqrt(square):
            continue
        held = parameters.bristle_stiffness
        if weighted[contacts.body[c]] == 1:
            held *= weight[c]
        # The plane across m: all directions, less that of m.
        _add(jacobian, rx, ry, rz, 1.0, 0.0, 0.0, held, out)
        _add(jacobian, rx, ry, rz, 0.0, 1.0, 0.0, held, out)
        _add(jacobian, rx, ry, rz, 0.0, 0.0, 1.0, held, out)
        _add(jacobian, rx, ry, rz, mx, my, mz, -held / square, out)


@inner_kernel
def _add(jacobian, rx, ry, rz, mx, my, mz, stiffness, out):
    """Add `stiffness` J J^T with J = (m, r x m)."""
    jacobian[0], jacobian[1], jacobian[2] = mx, my, mz
    jacobian[3], jacobian[4], jacobian[5] = (
        ry * mz - rz * my, rz * mx - rx * mz, rx * my - ry * mx,
    )  # fmt: skip
    for i in range(6):
        for j in range(6):
            out[i, j] += stiffness * jacobian[i] * jacobian[j]
