r"""Static coupling: a tool without mass, put where coupling and contact are in balance.

    (K + C) d = F + K e

moves the tool by d: one Newton step on the balance `F(x) + K e(x) = 0` in each tick (Barbic &
James, *Six-DoF haptic rendering of contact between geometrically complex reduced deformable
models*, 2008). Nothing is felt in free flight, not even the tool's inertia, and there is no
damping: what damps is the hand.
"""

from __future__ import annotations

from asperity._core.kernels import kernel
from asperity.dynamics.virtual_coupling.loads import all_finite, pull_to, push_at, would_pull
from asperity.geometry.rigid_body import apply_displacement, solve_cholesky


@kernel
def static_step(
    body, gains, dt, pose, momentum, velocity, handle_pose, handle_twist, contact_pose,
    contact_wrench, contact_stiffness, room, wrench_out,
):  # fmt: skip
    """Move the tool on by a tick; as `implicit_step`."""
    touches = push_at(pose, body.centre, contact_pose, contact_wrench, contact_stiffness, room)
    pull_to(pose, body.centre, handle_pose, handle_twist, room)
    step, well = room.values, True
    if touches:
        for i in range(6):
            spring = gains.stiffness if i < 3 else gains.rotational_stiffness
            step[i] = room.push[i] + spring * room.pull[i]
            for j in range(6):
                room.matrix[i, j] = contact_stiffness[i, j]
            room.matrix[i, i] += spring
        well = solve_cholesky(room.matrix, step)
        touches = not would_pull(contact_wrench, contact_stiffness, room, step, 1.0)
    for i in range(6):
        spring = gains.stiffness if i < 3 else gains.rotational_stiffness
        if not touches:
            step[i] = room.pull[i]
        momentum[i], velocity[i] = 0.0, step[i] / dt
        wrench_out[i] = spring * (step[i] - room.pull[i])
    apply_displacement(pose, step, body.centre, room.vector)
    return well and all_finite(pose, momentum, wrench_out)
