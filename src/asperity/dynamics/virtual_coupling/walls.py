r"""The walls that a coupled tool knows: its latest contact, and the last of another direction.

Each is a model of the contact's energy about the pose of its query,

    U(d) = U_0 - F . d + 1/2 d . C d,

0 where its force would reverse. The depth of a contact is a maximum, so that the true energy is the
larger of both as long as the surface is hollow. Over a ridge it is not: there the other wall, taken
on to the tool's pose, has more energy than the contact found, and is forgotten. So it is far away
from its query, and after two ticks without contact.
"""

from __future__ import annotations

import math

from asperity._core.kernels import inner_kernel, kernel
from asperity.geometry.rigid_body import fill_displacement

SAME = 0.999
"""Cosine between two forces from which on they count as of one wall; a project default."""
FAR, LEVER = 1e-3, 0.05
"""Way from a wall's query at which it is forgotten [m], and the length that converts rotations to
ways [m]; project defaults."""


@inner_kernel
def fill_load(pose, centre, wall, is_known, workspace, load_out):
    """Take a wall on to the tool's pose (7,): its force at rest, and its energy.

    A contact pushes and cannot pull: where its force points the other way, it does not act.
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
    latest, other, knows = walls.latest, walls.other, walls.knows
    along = square = size = 0.0
    for i in range(3):
        now, before = new.wrench[i] - new.damped[i], latest.wrench[i] - latest.damped[i]
        along += now * before
        square += before * before
        size += now * now
    if size == 0.0:
        # Between two walls the tool may be free for a tick, but not for longer.
        if knows[0]:
            _copy(latest, other)
        knows[1], knows[0] = knows[0], False
    else:
        if knows[0] and along < SAME * math.sqrt(square * size):
            _copy(latest, other)
            knows[1] = True
        knows[0] = True
    _copy(new, latest)
    if knows[1]:
        fill_load(new.pose, centre, other, True, workspace, workspace.other)
        away = 0.0
        for i in range(3):
            away += workspace.moved[i] ** 2 + (LEVER * workspace.moved[3 + i]) ** 2
        energy = workspace.other.energy[0]
        is_refuted = workspace.other.acts[0] and not 0.0 <= energy <= new.energy[0]
        if is_refuted or away > FAR * FAR:
            knows[1] = False


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
