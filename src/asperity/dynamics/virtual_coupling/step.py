r"""One tick of a coupled tool: contact and coupling linearised, one system of six equations.

    (M + dt (B + D) + dt^2 (K + C)) V_1 = M V_0 + dt (F + K e + B V_h)

is solved for the velocity V_1 at the end of the tick. M is mass and inertia; K and B are stiffness
and damping of the coupling; F, C and D are wrench, stiffness and damping of the contact; e is the
displacement from tool to handle, and V_h the handle's velocity (Otaduy & Lin, *A modular haptic
rendering algorithm for stable and transparent 6-DoF manipulation*, 2006). The three schemes are

- *implicit*: as above, backward Euler;
- *semi-implicit*: the coupling acts with its force at the beginning of the tick, `K e + B (V_h -
  V_0)`, and is not in the matrix. No numerical damping is added to the coupling, but the step is
  conditionally stable: `(K dt^2 + 2 B dt) / m < 4`;
- *static*: without M. Tool and coupling balance the contact at all times, and in free space the
  hand feels no force (Barbic & James, *Six-DoF haptic rendering of contact between geometrically
  complex reduced deformable models*, 2008). The damper keeps the tool from jumping between walls.

In all of them the contact is implicit. C and D are positive semidefinite, so that the matrix is
positive definite, the step bounded however stiff the contact, and D dissipative. If the contact
would pull at the end of the step, the tool has left it, and the step is repeated without contact.

*Two walls.* In a groove the deepest contact alternates between the two walls. A step that uses only
the wall of the last tick passes through the other one, and the tool oscillates without end. So the
last wall in another direction is kept (`walls`), and the step minimises the larger of both
energies: the walls are weighted so that, after the step, the energies are equal.
"""

from __future__ import annotations

import math

from asperity._core.kernels import inner_kernel, kernel
from asperity.dynamics.virtual_coupling.loads import all_finite, fill_coupling
from asperity.dynamics.virtual_coupling.walls import energy_after, fill_load
from asperity.geometry.rigid_body import (
    apply_displacement,
    fill_rotation,
    fill_world_tensor,
    solve_cholesky,
)

RETURN = 0.05
"""Largest speed, relative to the handle, at which a tool without mass returns to it [m/s].

A project default: if a contact ends during a push, the tool must not pass through the surface in
one tick.
"""
CATCHING_UP = 0.02
"""Time constant of the return from far away [s]; a project default."""
_HALVINGS = 6
"""Bisection steps for the weight at which both walls have equal energies."""


@kernel
def coupled_step(coupling, tool, handle, walls, workspace, wrench_out):
    """Advance a coupled tool by one tick; see `virtual_coupling.records` for the arguments."""
    body = coupling.body
    pose, momentum, velocity = tool
    fill_load(pose, body.centre, walls.latest, walls.is_known[0], workspace, workspace.latest)
    fill_load(pose, body.centre, walls.other, walls.is_known[1], workspace, workspace.other)
    fill_rotation(pose, workspace.rotation)
    fill_coupling(coupling, pose, handle, workspace)
    _fill_inertia(body, coupling.scheme, workspace)
    solved = True
    if not coupling.scheme.is_implicit:
        solved = _fill_free_velocity(momentum, workspace)
    share = 1.0
    solved = _solve(coupling, momentum, walls, share, workspace, velocity) and solved
    if _is_other_deeper(coupling, walls, workspace, velocity):
        low, high = 0.0, 1.0
        solved = _solve(coupling, momentum, walls, low, workspace, velocity) and solved
        if not _is_other_deeper(coupling, walls, workspace, velocity):
            for _ in range(_HALVINGS):
                share = 0.5 * (low + high)
                solved = _solve(coupling, momentum, walls, share, workspace, velocity) and solved
                if _is_other_deeper(coupling, walls, workspace, velocity):
                    high = share
                else:
                    low = share
    _fill_wrench(coupling, workspace, velocity, wrench_out)
    for i in range(6):
        momentum[i] = 0.0
        for j in range(6):
            momentum[i] += workspace.inertia[i, j] * velocity[j]
        workspace.step[i] = coupling.dt * velocity[i]
    apply_displacement(pose, workspace.step, body.centre, workspace.vector)
    return solved and all_finite(tool, wrench_out)


@inner_kernel
def _is_other_deeper(coupling, walls, workspace, velocity):
    """Return whether the other wall has more energy than the latest after moving at a velocity."""
    if not workspace.other.acts[0]:
        return False
    other = energy_after(walls.other, workspace.other, velocity, coupling.dt)
    return other > energy_after(walls.latest, workspace.latest, velocity, coupling.dt)


@inner_kernel
def _fill_inertia(body, scheme, workspace):
    """Fill mass and inertia (6, 6) in world axes; zero for a tool without mass."""
    inertia = workspace.inertia
    fill_world_tensor(workspace.rotation, body.axes, body.moments, workspace.tensor)
    for i in range(6):
        for j in range(6):
            inertia[i, j] = 0.0
    if scheme.has_mass:
        for i in range(3):
            inertia[i, i] = body.mass
            for j in range(3):
                inertia[3 + i, 3 + j] = workspace.tensor[i, j]


@inner_kernel
def _fill_free_velocity(momentum, workspace):
    """Fill the velocity (6,) that belongs to the momentum at the present orientation."""
    for i in range(6):
        workspace.velocity[i] = momentum[i]
        for j in range(6):
            workspace.matrix[i, j] = workspace.inertia[i, j]
    return solve_cholesky(workspace.matrix, workspace.velocity)


@inner_kernel
def _solve(coupling, momentum, walls, share, workspace, velocity_out):
    """Fill the velocity (6,) at the end of the tick, with the latest wall weighted by `share`.

    The other wall has the weight `1 - share`. Return whether the matrix was positive definite.
    """
    latest = share if workspace.latest.acts[0] else 0.0
    other = 1.0 - share if workspace.other.acts[0] else 0.0
    workspace.held[0], solved = latest + other > 0.0, True
    if workspace.held[0]:
        solved = _solve_with(coupling, momentum, walls, latest, other, workspace, velocity_out)
        workspace.held[0] = not _would_pull(coupling, walls, latest, other, workspace, velocity_out)
    if not workspace.held[0]:
        if coupling.scheme.has_mass:
            solved = _solve_with(coupling, momentum, walls, 0.0, 0.0, workspace, velocity_out)
        else:
            _fill_return(coupling.dt, workspace, velocity_out)
    return solved


@inner_kernel
def _solve_with(coupling, momentum, walls, latest, other, workspace, velocity_out):
    scheme, dt = coupling.scheme, coupling.dt
    matrix, damper, spring = workspace.matrix, workspace.damper, workspace.spring
    for i in range(6):
        load = spring[i] * workspace.extension[i]
        load += latest * workspace.latest.wrench[i] + other * workspace.other.wrench[i]
        for j in range(6):
            matrix[i, j] = workspace.inertia[i, j]
            damping = latest * walls.latest.damping[i, j] + other * walls.other.damping[i, j]
            stiffness = latest * walls.latest.stiffness[i, j] + other * walls.other.stiffness[i, j]
            matrix[i, j] += dt * (damping + dt * stiffness)
            if scheme.is_implicit:
                matrix[i, j] += dt * damper[i, j]
                load += damper[i, j] * workspace.handle_velocity[j]
            else:
                load += damper[i, j] * (workspace.handle_velocity[j] - workspace.velocity[j])
        if scheme.is_implicit:
            matrix[i, i] += dt * dt * spring[i]
        velocity_out[i] = dt * load
        if scheme.has_mass:
            velocity_out[i] += momentum[i]
    return solve_cholesky(matrix, velocity_out)


@inner_kernel
def _would_pull(coupling, walls, latest, other, workspace, velocity):
    """Return whether the force of both walls would reverse on moving at a velocity (6,)."""
    dt, along = coupling.dt, 0.0
    for i in range(3):
        before = latest * workspace.latest.wrench[i] + other * workspace.other.wrench[i]
        after = before
        for j in range(6):
            stiffness = latest * walls.latest.stiffness[i, j] + other * walls.other.stiffness[i, j]
            damping = latest * walls.latest.damping[i, j] + other * walls.other.damping[i, j]
            after -= (damping + dt * stiffness) * velocity[j]
        along += before * after
    return along < 0.0


@inner_kernel
def _fill_return(dt, workspace, velocity_out):
    """Fill the velocity (6,) at which a tool without mass and contact returns to its handle."""
    square, handle = 0.0, workspace.handle_velocity
    for i in range(3):
        square += (workspace.extension[i] / dt - handle[i]) ** 2
    speed = math.sqrt(square)
    share = min(1.0, RETURN / speed + dt / CATCHING_UP) if speed > 0.0 else 1.0
    for i in range(6):
        approach = workspace.extension[i] / dt - handle[i]
        velocity_out[i] = handle[i] + share * approach
        workspace.lag[i] = dt * (1.0 - share) * approach


@inner_kernel
def _fill_wrench(coupling, workspace, velocity, wrench_out):
    """Fill the wrench (6,) of the coupling on the hand."""
    scheme, dt = coupling.scheme, coupling.dt
    damper, handle = workspace.damper, workspace.handle_velocity
    for i in range(6):
        # Without mass and contact only the remaining lag loads the spring.
        pull = workspace.spring[i] * workspace.lag[i]
        if scheme.has_mass or workspace.held[0]:
            pull = workspace.spring[i] * workspace.extension[i]
            if scheme.is_implicit:
                pull -= workspace.spring[i] * dt * velocity[i]
            for j in range(6):
                after = velocity[j] if scheme.is_implicit else workspace.velocity[j]
                pull += damper[i, j] * (handle[j] - after)
        wrench_out[i] = -pull
