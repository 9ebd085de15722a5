r"""The walls of a coupled tool: its latest contact, and the last one in another direction.

Each is a quadratic model of the contact's energy about the pose of its query,

    U(d) = U_0 - F . d + 1/2 d . C d,

and 0 where its force would reverse. The depth of a contact is a maximum, so where the surface is
concave the true energy is the larger of the two. Over a ridge the other wall overestimates it: it
is dropped if its energy, extrapolated to the tool's pose, exceeds that of the contact found there.
It is also dropped far from the pose of its query, and after two ticks without contact.
"""

from __future__ import annotations

import math

from asperity._core.kernels import inner_kernel, kernel
from asperity.geometry.rigid_body import fill_displacement

SAME = 0.999
"""Two forces whose directions have at least this cosine belong to one wall; a project default."""
FAR, LEVER = 1e-3, 0.05
"""Displacement from its query at which a wall is dropped [m], and the lever arm that converts
rotations to displacements [m]; project defaults."""


@inner_kernel
def fill_load(pose, centre, wall, is_known, workspace, load_out):
    """Extrapolate a wall to the tool's pose (7,): its force on a tool at rest, and its energy.

    A contact cannot pull: where its force has reversed, it does not act.
    """
    fill_displacement(wall.pose, pose, centre, workspace.vector, workspace.moved)
    wrench, moved = load_out.wrench, workspace.moved
    energy, along = wall.energy[0], 0.0
    for i in range(6):
        at_rest, change = wall.wrench[i] - wall.damped[i], 0.0
        for j in range(6):
            change += wall.stiffness[i, j] * moved[j]
        wrench[i] = at_rest - change
        energy -= (at_rest - 0.5 * change) * moved[i]
        if i < 3:
            along += at_rest * wrench[i]
    load_out.energy[0] = energy
    load_out.acts[0] = is_known and along > 0.0


@inner_kernel
def energy_after(wall, load, velocity, dt):
    """Return the energy of a wall [J] after moving at a velocity (6,) for `dt`."""
    if not load.acts[0]:
        return 0.0
    energy, along = load.energy[0], 0.0
    for i in range(6):
        change = 0.0
        for j in range(6):
            change += wall.stiffness[i, j] * dt * velocity[j]
        energy -= (load.wrench[i] - 0.5 * change) * dt * velocity[i]
        if i < 3:
            along += load.wrench[i] * (load.wrench[i] - change)
    return energy if along > 0.0 else 0.0


@kernel
def learn_wall(new, centre, walls, workspace):
    """Make a new contact the latest wall, and keep or replace the other one."""
    latest, other, is_known = walls.latest, walls.other, walls.is_known
    along = square = size = 0.0
    for i in range(3):
        now, before = new.wrench[i] - new.damped[i], latest.wrench[i] - latest.damped[i]
        along += now * before
        square += before * before
        size += now * now
    if size == 0.0:
        # Between two walls the tool may be free for one tick; after two, no wall is kept.
        if is_known[0]:
            _copy(latest, other)
        is_known[1], is_known[0] = is_known[0], False
    else:
        if is_known[0] and along < SAME * math.sqrt(square * size):
            _copy(latest, other)
            is_known[1] = True
        is_known[0] = True
    _copy(new, latest)
    if is_known[1]:
        fill_load(new.pose, centre, other, True, workspace, workspace.other)
        distance = 0.0
        for i in range(3):
            distance += workspace.moved[i] ** 2 + (LEVER * workspace.moved[3 + i]) ** 2
        energy = workspace.other.energy[0]
        is_too_deep = workspace.other.acts[0] and not 0.0 <= energy <= new.energy[0]
        if is_too_deep or distance > FAR * FAR:
            is_known[1] = False


@inner_kernel
def _copy(wall, wall_out):
    for i in range(7):
        wall_out.pose[i] = wall.pose[i]
    for i in range(6):
        wall_out.wrench[i], wall_out.damped[i] = wall.wrench[i], wall.damped[i]
        for j in range(6):
            wall_out.stiffness[i, j] = wall.stiffness[i, j]
            wall_out.damping[i, j] = wall.damping[i, j]
    wall_out.energy[0] = wall.energy[0]


@kernel
def extrapolate_wrench(pose, centre, wall, workspace, wrench_out):
    """Fill the wrench (6,) of a wall, to first order, with the tool at `pose`; return U [J]."""
    latest = workspace.latest
    fill_load(pose, centre, wall, True, workspace, latest)
    for i in range(6):
        wrench_out[i] = latest.wrench[i] if latest.acts[0] else 0.0
    return max(latest.energy[0], 0.0) if latest.acts[0] else 0.0
