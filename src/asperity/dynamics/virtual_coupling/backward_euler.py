r"""Backward Euler for a coupled tool, with contact and coupling linearised.

    (M + dt B + dt^2 (K + C)) V_1 = M V_0 + dt (F + K e + B V_h)

is solved for the velocity V_1 at the end of the tick. M is mass and inertia, K and B are the
coupling's stiffness and damping, F and C the contact's wrench and stiffness at the tool's pose,
e the displacement from tool to handle, V_h the handle's velocity (Otaduy & Lin, *A modular haptic
rendering algorithm for stable and transparent 6-DoF manipulation*, 2006). The matrix is positive
definite for any contact, because C is positive semidefinite: however stiff the contact, the step
stays bounded. If the contact would pull at the end of the step, the tool has left it, and the step
is repeated without contact.
"""

from __future__ import annotations

from asperity._core.kernels import inner_kernel, kernel
from asperity.dynamics.virtual_coupling.loads import (
    all_finite,
    fill_contact_wrench,
    fill_spring,
    would_pull,
)
from asperity.geometry.rigid_body import (
    apply_displacement,
    fill_rotation,
    fill_world_tensor,
    solve_cholesky,
)


@kernel
def backward_euler_step(coupling, tool, handle, contact, workspace, wrench_out):
    """Advance a coupled tool by one tick; see `virtual_coupling.records` for the arguments."""
    body, gains, dt = coupling
    pose, momentum, velocity = tool
    touches = fill_contact_wrench(pose, body.centre, contact, workspace)
    fill_spring(pose, body.centre, handle, workspace)
    fill_rotation(pose, workspace.rotation)
    fill_world_tensor(workspace.rotation, body.axes, body.moments, workspace.inertia)
    fill_world_tensor(workspace.rotation, body.axes, gains.rotational_damping, workspace.damping)
    solved = _solve_velocity(coupling, momentum, contact, touches, workspace, velocity)
    if touches and would_pull(contact, workspace, velocity, dt):
        solved = _solve_velocity(coupling, momentum, contact, False, workspace, velocity)
    extension, handle_velocity = workspace.extension, workspace.handle_velocity
    for i in range(3):
        momentum[i] = body.mass * velocity[i]
        momentum[3 + i] = damping_torque = 0.0
        for j in range(3):
            momentum[3 + i] += workspace.inertia[i, j] * velocity[3 + j]
            damping_torque += workspace.damping[i, j] * (velocity[3 + j] - handle_velocity[3 + j])
        wrench_out[i] = gains.stiffness * (dt * velocity[i] - extension[i]) + gains.damping * (
            velocity[i] - handle_velocity[i]
        )
        wrench_out[3 + i] = damping_torque + gains.rotational_stiffness * (
            dt * velocity[3 + i] - extension[3 + i]
        )
    for i in range(6):
        workspace.step[i] = dt * velocity[i]
    apply_displacement(pose, workspace.step, body.centre, workspace.vector)
    return solved and all_finite(tool, wrench_out)


@inner_kernel
def _solve_velocity(coupling, momentum, contact, touches, workspace, velocity_out):
    """Fill the velocity (6,) at the end of the tick; return whether the matrix was definite."""
    body, gains, dt = coupling
    matrix, extension = workspace.matrix, workspace.extension
    handle_velocity = workspace.handle_velocity
    for i in range(6):
        velocity_out[i] = momentum[i]
        if touches:
            velocity_out[i] += dt * workspace.contact_wrench[i]
        for j in range(6):
            matrix[i, j] = dt * dt * contact.stiffness[i, j] if touches else 0.0
    for i in range(3):
        matrix[i, i] += body.mass + dt * (gains.damping + dt * gains.stiffness)
        matrix[3 + i, 3 + i] += dt * dt * gains.rotational_stiffness
        velocity_out[i] += dt * (
            gains.stiffness * extension[i] + gains.damping * handle_velocity[i]
        )
        velocity_out[3 + i] += dt * gains.rotational_stiffness * extension[3 + i]
        for j in range(3):
            matrix[3 + i, 3 + j] += workspace.inertia[i, j] + dt * workspace.damping[i, j]
            velocity_out[3 + i] += dt * workspace.damping[i, j] * handle_velocity[3 + j]
    return solve_cholesky(matrix, velocity_out)
