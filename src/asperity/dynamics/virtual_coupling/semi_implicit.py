"""Semi-implicit (symplectic) Euler for a coupled tool.

    P_1 = P_0 + dt (F + K e + B (V_h - V_0)),    x_1 = x_0 + dt V_1

The new momentum P_1 follows from the loads at the beginning of the tick, the new position x_1 from
the new velocity. Nothing has to be solved and no numerical damping is added, but the step is
conditionally stable: `(K dt^2 + 2 B dt) / m < 4`, with the contact's stiffness counted in K.
"""

from __future__ import annotations

from asperity._core.kernels import inner_kernel, kernel
from asperity.dynamics.virtual_coupling.loads import all_finite, fill_contact_wrench, fill_spring
from asperity.geometry.rigid_body import apply_displacement, fill_rotation, fill_world_tensor


@kernel
def semi_implicit_step(coupling, tool, handle, contact, workspace, wrench_out):
    """Advance a coupled tool by one tick; see `virtual_coupling.records` for the arguments."""
    body, gains, dt = coupling
    pose, momentum, velocity = tool
    fill_contact_wrench(pose, body.centre, contact, workspace)
    fill_spring(pose, body.centre, handle, workspace)
    fill_rotation(pose, workspace.rotation)
    for i in range(3):
        workspace.vector[i] = 1.0 / body.moments[i]
    fill_world_tensor(workspace.rotation, body.axes, workspace.vector, workspace.inertia)
    fill_world_tensor(workspace.rotation, body.axes, gains.rotational_damping, workspace.damping)
    _fill_velocity(body.mass, workspace.inertia, momentum, velocity)
    extension, handle_velocity = workspace.extension, workspace.handle_velocity
    for i in range(3):
        damping_torque = 0.0
        for j in range(3):
            damping_torque += workspace.damping[i, j] * (velocity[3 + j] - handle_velocity[3 + j])
        wrench_out[i] = -gains.stiffness * extension[i] + gains.damping * (
            velocity[i] - handle_velocity[i]
        )
        wrench_out[3 + i] = damping_torque - gains.rotational_stiffness * extension[3 + i]
    for i in range(6):
        momentum[i] += dt * (workspace.contact_wrench[i] - wrench_out[i])
    _fill_velocity(body.mass, workspace.inertia, momentum, velocity)
    for i in range(6):
        workspace.step[i] = dt * velocity[i]
    apply_displacement(pose, workspace.step, body.centre, workspace.vector)
    return all_finite(tool, wrench_out)


@inner_kernel
def _fill_velocity(mass, inverse_inertia, momentum, velocity_out):
    for i in range(3):
        velocity_out[i] = momentum[i] / mass
        velocity_out[3 + i] = 0.0
        for j in range(3):
            velocity_out[3 + i] += inverse_inertia[i, j] * momentum[3 + j]
