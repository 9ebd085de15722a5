"""The spring and damper that hold a coupled tool, and the velocity of its handle."""

from __future__ import annotations

import math

from asperity._core.kernels import inner_kernel, kernel
from asperity.geometry.rigid_body import fill_displacement, fill_lever_arm, fill_world_tensor

MAX_SPEED, MAX_ANGULAR_SPEED = 10.0, 100.0
"""Limits on the handle's velocity as the damper sees it [m/s], [rad/s].

No hand moves faster; a handle that jumps must not be followed by its damper.
"""
LEVER = 0.1
"""The coupling's largest torque over its largest force [m]: a hand's width; a project default."""


@inner_kernel
def fill_coupling(coupling, pose, handle, workspace):
    """Fill the coupling's extension, spring and damper, and the velocity of the handle.

    The velocity is that of the handle's body at the tool's centre of mass, limited to `MAX_SPEED`
    and `MAX_ANGULAR_SPEED`. Where the spring would exceed its largest force or torque, its
    stiffness is reduced to give just that, and the damper with it, so that it remains critical.
    """
    body, gains = coupling.body, coupling.gains
    extension = workspace.extension
    fill_displacement(pose, handle.pose, body.centre, workspace.vector, extension)
    _fill_handle_velocity(pose, body.centre, handle, workspace)
    fill_world_tensor(workspace.rotation, body.axes, gains.rotational_damping, workspace.tensor)
    share = _saturation(gains.stiffness, extension, 0, gains.max_force)
    rotational_share = _saturation(
        gains.rotational_stiffness, extension, 3, LEVER * gains.max_force
    )
    damper = workspace.damper
    for i in range(6):
        for j in range(6):
            damper[i, j] = 0.0
    for i in range(3):
        workspace.spring[i] = share * gains.stiffness
        workspace.spring[3 + i] = rotational_share * gains.rotational_stiffness
        damper[i, i] = math.sqrt(share) * gains.damping
        for j in range(3):
            damper[3 + i, 3 + j] = math.sqrt(rotational_share) * workspace.tensor[i, j]


@inner_kernel
def _saturation(stiffness, extension, first, most):
    """Return the largest share of a stiffness, up to 1, whose load does not exceed `most`."""
    square = 0.0
    for i in range(first, first + 3):
        square += extension[i] ** 2
    load = stiffness * math.sqrt(square)
    return most / load if load > most else 1.0


@inner_kernel
def _fill_handle_velocity(pose, centre, handle, workspace):
    speed = angular = 0.0
    for i in range(3):
        speed += handle.twist[i] ** 2
        angular += handle.twist[3 + i] ** 2
    linear_scale = min(1.0, MAX_SPEED / max(math.sqrt(speed), 1e-300))
    angular_scale = min(1.0, MAX_ANGULAR_SPEED / max(math.sqrt(angular), 1e-300))
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
def fill_port_twist(last_handle, handle, pose, centre, dt, vector, twist_out):
    """Fill the handle's mean velocity (6,) over a tick at the centre of mass of a tool at `pose`.

    `last_handle` and `handle` (7,) are the handle's poses before and after; `vector` (3,) is
    scratch memory.
    """
    fill_displacement(last_handle, handle, centre, vector, twist_out)
    # From where the centre of mass would be, had the tool followed the handle exactly.
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
