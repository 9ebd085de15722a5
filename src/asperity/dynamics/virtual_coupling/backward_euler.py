r"""Backward Euler for a held tool, with contact and coupling to first order.

    (M + dt B + dt^2 (K + C)) V_1 = M V_0 + dt (F + K e + B V_h)

for the velocity V_1 at the end of the tick: M mass and inertia, K and B the coupling's, F and C
wrench and stiffness of the contact where the tool is, e the way to the handle (Otaduy & Lin,
*A modular haptic rendering algorithm for stable and transparent 6-DoF manipulation*, 2006).
The matrix is positive definite whatever the contact, since C is positive semidefinite: however
stiff, it cannot make the step leap. A contact that would pull at the end of the step has let go:
the step is taken again without it.
"""

from __future__ import annotations

from asperity._core.kernels import inner_kernel, kernel
from asperity.dynamics.virtual_coupling.loads import all_finite, pull_to, push_at, would_pull
from asperity.geometry.rigid_body import (
    apply_displacement,
    fill_rotation,
    fill_world_tensor,
    solve_cholesky,
)


@kernel
def implicit_step(
    body, gains, dt, pose, momentum, velocity, handle_pose, handle_twist, contact_pose,
    contact_wrench, contact_stiffness, room, wrench_out,
):  # fmt: skip
    """Move pose (7,), momentum (6,) and velocity (6,) of the tool on by a tick, in place.

    `wrench_out` (6,) is what the hand feels. Returns whether all went well.
    """
    touches = push_at(pose, body.centre, contact_pose, contact_wrench, contact_stiffness, room)
    pull_to(pose, body.centre, handle_pose, handle_twist, room)
    fill_rotation(pose, room.turned)
    fill_world_tensor(room.turned, body.axes, body.moments, room.inertia)
    fill_world_tensor(room.turned, body.axes, gains.rotational_damping, room.damping)
    well = _velocity(body, gains, dt, momentum, contact_stiffness, touches, room, velocity)
    if touches and would_pull(contact_wrench, contact_stiffness, room, velocity, dt):
        well = _velocity(body, gains, dt, momentum, contact_stiffness, False, room, velocity)
    for i in range(3):
        momentum[i] = body.mass * velocity[i]
        momentum[3 + i] = slowing = 0.0
        for j in range(3):
            momentum[3 + i] += room.inertia[i, j] * velocity[3 + j]
            slowing += room.damping[i, j] * (velocity[3 + j] - room.drive[3 + j])
        wrench_out[i] = gains.stiffness * (dt * velocity[i] - room.pull[i]) + gains.damping * (
            velocity[i] - room.drive[i]
        )
        wrench_out[3 + i] = slowing + gains.rotational_stiffness * (
            dt * velocity[3 + i] - room.pull[3 + i]
        )
    for i in range(6):
        room.values[i] = dt * velocity[i]
    apply_displacement(pose, room.values, body.centre, room.vector)
    return well and all_finite(pose, momentum, wrench_out)


@inner_kernel
def _velocity(body, gains, dt, momentum, contact_stiffness, touches, room, velocity_out):
    """Fill the velocity (6,) at the end of the tick; return whether it was to be found."""
    matrix = room.matrix
    for i in range(6):
        velocity_out[i] = momentum[i]
        if touches:
            velocity_out[i] += dt * room.push[i]
        for j in range(6):
            matrix[i, j] = dt * dt * contact_stiffness[i, j] if touches else 0.0
    for i in range(3):
        matrix[i, i] += body.mass + dt * (gains.damping + dt * gains.stiffness)
        matrix[3 + i, 3 + i] += dt * dt * gains.rotational_stiffness
        velocity_out[i] += dt * (gains.stiffness * room.pull[i] + gains.damping * room.drive[i])
        velocity_out[3 + i] += dt * gains.rotational_stiffness * room.pull[3 + i]
        for j in range(3):
            matrix[3 + i, 3 + j] += room.inertia[i, j] + dt * room.damping[i, j]
            velocity_out[3 + i] += dt * room.damping[i, j] * room.drive[3 + j]
    return solve_cholesky(matrix, velocity_out)
