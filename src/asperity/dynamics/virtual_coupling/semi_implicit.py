"""Semi-implicit (symplectic) Euler for a held tool: the plain integrator beside backward Euler.

    P_1 = P_0 + dt (F + K e + B (V_h - V_0)),    x_1 = x_0 + dt V_1

Velocity from the forces as they are, place from the new velocity. No solve, and no damping of its
own; it is stable while the tick is short for the stiffness and damping at hand, contact included:
`(K dt^2 + 2 B dt) / m < 4`.
"""

from __future__ import annotations

from asperity._core.kernels import inner_kernel, kernel
from asperity.dynamics.virtual_coupling.loads import all_finite, pull_to, push_at
from asperity.geometry.rigid_body import apply_displacement, fill_rotation, fill_world_tensor


@kernel
def semi_implicit_step(
    body, gains, dt, pose, momentum, velocity, handle_pose, handle_twist, contact_pose,
    contact_wrench, contact_stiffness, room, wrench_out,
):  # fmt: skip
    """Move the tool on by a tick; as `implicit_step`."""
    push_at(pose, body.centre, contact_pose, contact_wrench, contact_stiffness, room)
    pull_to(pose, body.centre, handle_pose, handle_twist, room)
    fill_rotation(pose, room.turned)
    for i in range(3):
        room.vector[i] = 1.0 / body.moments[i]
    fill_world_tensor(room.turned, body.axes, room.vector, room.inertia)
    fill_world_tensor(room.turned, body.axes, gains.rotational_damping, room.damping)
    _velocity(body.mass, room.inertia, momentum, velocity)
    for i in range(3):
        slowing = 0.0
        for j in range(3):
            slowing += room.damping[i, j] * (velocity[3 + j] - room.drive[3 + j])
        wrench_out[i] = -gains.stiffness * room.pull[i] + gains.damping * (
            velocity[i] - room.drive[i]
        )
        wrench_out[3 + i] = slowing - gains.rotational_stiffness * room.pull[3 + i]
    for i in range(6):
        momentum[i] += dt * (room.push[i] - wrench_out[i])
    _velocity(body.mass, room.inertia, momentum, velocity)
    for i in range(6):
        room.values[i] = dt * velocity[i]
    apply_displacement(pose, room.values, body.centre, room.vector)
    return all_finite(pose, momentum, wrench_out)


@inner_kernel
def _velocity(mass, inverse_inertia, momentum, velocity_out):
    for i in range(3):
        velocity_out[i] = momentum[i] / mass
        velocity_out[3 + i] = 0.0
        for j in range(3):
            velocity_out[3 + i] += inverse_inertia[i, j] * momentum[3 + j]
