r"""Static coupling: a massless tool at the equilibrium of coupling and contact.

    (K + C) d = F + K e

displaces the tool by d, one Newton step on the equilibrium `F(x) + K e(x) = 0` per tick (Barbic &
James, *Six-DoF haptic rendering of contact between geometrically complex reduced deformable
models*, 2008). In free space the hand feels no force, not even the tool's inertia. The coupling
adds no damping; the hand provides it.
"""

from __future__ import annotations

from asperity._core.kernels import kernel
from asperity.dynamics.virtual_coupling.loads import (
    all_finite,
    fill_contact_wrench,
    fill_spring,
    would_pull,
)
from asperity.geometry.rigid_body import apply_displacement, solve_cholesky


@kernel
def static_step(coupling, tool, handle, contact, workspace, wrench_out):
    """Advance a coupled tool by one tick; see `virtual_coupling.records` for the arguments."""
    body, gains, dt = coupling
    pose, momentum, velocity = tool
    touches = fill_contact_wrench(pose, body.centre, contact, workspace)
    fill_spring(pose, body.centre, handle, workspace)
    step, solved = workspace.step, True
    if touches:
        for i in range(6):
            stiffness = gains.stiffness if i < 3 else gains.rotational_stiffness
            step[i] = workspace.contact_wrench[i] + stiffness * workspace.extension[i]
            for j in range(6):
                workspace.matrix[i, j] = contact.stiffness[i, j]
            workspace.matrix[i, i] += stiffness
        solved = solve_cholesky(workspace.matrix, step)
        touches = not would_pull(contact, workspace, step, 1.0)
    for i in range(6):
        stiffness = gains.stiffness if i < 3 else gains.rotational_stiffness
        if not touches:
            step[i] = workspace.extension[i]
        momentum[i], velocity[i] = 0.0, step[i] / dt
        wrench_out[i] = stiffness * (step[i] - workspace.extension[i])
    apply_displacement(pose, step, body.centre, workspace.vector)
    return solved and all_finite(tool, wrench_out)
