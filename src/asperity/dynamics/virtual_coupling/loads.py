"""Loads on a coupled tool, common to all integrators: the contact's wrench and the spring."""

from __future__ import annotations

import numpy as np

from asperity._core.kernels import inner_kernel, kernel
from asperity.geometry.rigid_body import fill_displacement, fill_lever_arm

MAX_SPEED, MAX_ANGULAR_SPEED = 10.0, 100.0
"""Limits on the handle's velocity as the damper sees it [m/s], [rad/s].

No hand moves faster; a handle that jumps must not be followed by its damper.
"""


@inner_kernel
def fill_contact_wrench(pose, centre, contact, workspace):
    """Fill `workspace.contact_wrench` at the tool's pose; return whether the tool still touches.

    A contact pushes and cannot pull: where the extrapolated force points the other way, the tool
    has left the contact and the wrench is zero.
    """
    fill_displacement(contact.pose, pose, centre, workspace.vector, workspace.moved)
    wrench = workspace.contact_wrench
    for i in range(6):
        total = contact.wrench[i]
        for j in range(6):
            total -= contact.stiffness[i, j] * workspace.moved[j]
        wrench[i] = total
    if _is_reversed(contact.wrench, wrench):
        for i in range(6):
            wrench[i] = 0.0
        return False
    return True


@inner_kernel
def _is_reversed(first, now):
    """Return whether the force of a wrench points away from that of another."""
    return first[0] * now[0] + first[1] * now[1] + first[2] * now[2] < 0.0


@inner_kernel
def would_pull(contact, workspace, velocity, dt):
    """Return whether the contact's force would reverse on moving at a velocity (6,) for `dt`."""
    along = 0.0
    for i in range(3):
        force = workspace.contact_wrench[i]
        for j in range(6):
            force -= contact.stiffness[i, j] * dt * velocity[j]
        along += force * contact.wrench[i]
    return along < 0.0


@inner_kernel
def fill_spring(pose, centre, handle, workspace):
    """Fill `workspace.extension` and `workspace.handle_velocity`.

    The velocity is that of the handle's body at the tool's centre of mass, limited to `MAX_SPEED`
    and `MAX_ANGULAR_SPEED`.
    """
    fill_displacement(pose, handle.pose, centre, workspace.vector, workspace.extension)
    speed = angular = 0.0
    for i in range(3):
        speed += handle.twist[i] ** 2
        angular += handle.twist[3 + i] ** 2
    linear_scale = min(1.0, MAX_SPEED / max(np.sqrt(speed), 1e-300))
    angular_scale = min(1.0, MAX_ANGULAR_SPEED / max(np.sqrt(angular), 1e-300))
    velocity, arm = workspace.handle_velocity, workspace.vector
    for i in range(3):
        velocity[3 + i] = angular_scale * handle.twist[3 + i]
    fill_lever_arm(pose, centre, arm)
    for i in range(3):
        arm[i] += pose[i] - handle.pose[i]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        velocity[i] = linear_scale * handle.twist[i]
        velocity[i] += velocity[3 + j] * arm[k] - velocity[3 + k] * arm[j]


@inner_kernel
def all_finite(tool, wrench):
    """Return whether a tool's pose and momentum and the wrench on the hand are finite."""
    total = 0.0
    for i in range(7):
        total += abs(tool.pose[i])
    for i in range(6):
        total += abs(tool.momentum[i]) + abs(wrench[i])
    return total < 1e300


@kernel
def extrapolate_wrench(pose, centre, contact, workspace, wrench_out):
    """Fill the wrench (6,) of a contact, to first order, with the tool at `pose` (7,)."""
    fill_contact_wrench(pose, centre, contact, workspace)
    for i in range(6):
        wrench_out[i] = workspace.contact_wrench[i]


@kernel
def fill_port_twist(last_handle, handle, pose, centre, dt, vector, twist_out):
    """Fill the handle's mean velocity (6,) over a tick at the centre of mass of a tool at `pose`.

    `last_handle` and `handle` (7,) are the handle's poses before and after; `vector` (3,) is
    scratch memory.
    """
    fill_displacement(last_handle, handle, centre, vector, twist_out)
    # From the centre of mass, had the tool followed the handle exactly, to where it is.
    fill_lever_arm(handle, centre, vector)
    x, y, z = handle[0] + vector[0], handle[1] + vector[1], handle[2] + vector[2]
    fill_lever_arm(pose, centre, vector)
    x, y, z = pose[0] + vector[0] - x, pose[1] + vector[1] - y, pose[2] + vector[2] - z
    a, b, c = twist_out[3], twist_out[4], twist_out[5]
    twist_out[0] += b * z - c * y
    twist_out[1] += c * x - a * z
    twist_out[2] += a * y - b * x
    for i in range(6):
        twist_out[i] /= dt
