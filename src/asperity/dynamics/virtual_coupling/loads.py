"""What every integrator of a held tool begins with: how it is pushed, and how it is pulled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, kernel
from asperity.geometry.rigid_body import fill_displacement, fill_lever_arm

FASTEST, FASTEST_TURN = 10.0, 100.0
"""No hand moves faster [m/s], [rad/s]: a handle that leaps is not followed by its damper."""


class Room(NamedTuple):
    """Where a tick is worked out; allocated once."""

    away: NDArray[np.float64]
    """From where the contact was looked at to the tool (6,)."""
    pull: NDArray[np.float64]
    """From the tool to the handle (6,)."""
    drive: NDArray[np.float64]
    """Velocity of the handle at the tool's centre of mass (6,)."""
    push: NDArray[np.float64]
    """Of the contact where the tool is (6,)."""
    values: NDArray[np.float64]
    matrix: NDArray[np.float64]
    turned: NDArray[np.float64]
    inertia: NDArray[np.float64]
    damping: NDArray[np.float64]
    vector: NDArray[np.float64]


def room() -> Room:
    """Return room for the work of one tick."""
    return Room(
        away=np.zeros(6),
        pull=np.zeros(6),
        drive=np.zeros(6),
        push=np.zeros(6),
        values=np.zeros(6),
        matrix=np.zeros((6, 6)),
        turned=np.zeros((3, 3)),
        inertia=np.zeros((3, 3)),
        damping=np.zeros((3, 3)),
        vector=np.zeros(3),
    )


@inner_kernel
def push_at(pose, centre, contact_pose, contact_wrench, contact_stiffness, room):
    """Fill `room.push` with a contact's wrench where the tool is; return whether it touches.

    A contact pushes and does not pull: moved out of it, the tool has left.
    """
    fill_displacement(contact_pose, pose, centre, room.vector, room.away)
    for i in range(6):
        total = contact_wrench[i]
        for j in range(6):
            total -= contact_stiffness[i, j] * room.away[j]
        room.push[i] = total
    if _pulls(contact_wrench, room.push):
        for i in range(6):
            room.push[i] = 0.0
        return False
    return True


@inner_kernel
def _pulls(first, now):
    """Return whether the force of a contact has turned round."""
    return first[0] * now[0] + first[1] * now[1] + first[2] * now[2] < 0.0


@inner_kernel
def would_pull(contact_wrench, contact_stiffness, room, step, dt):
    """Return whether the contact's force turns round on the way `step` (6,) times `dt`."""
    along = 0.0
    for i in range(3):
        force = room.push[i]
        for j in range(6):
            force -= contact_stiffness[i, j] * dt * step[j]
        along += force * contact_wrench[i]
    return along < 0.0


@inner_kernel
def pull_to(pose, centre, handle_pose, handle_twist, room):
    """Fill `room.pull` and `room.drive`: where the handle is from the tool, and how it moves."""
    fill_displacement(pose, handle_pose, centre, room.vector, room.pull)
    speed = turning = 0.0
    for i in range(3):
        speed += handle_twist[i] ** 2
        turning += handle_twist[3 + i] ** 2
    slower = min(1.0, FASTEST / max(np.sqrt(speed), 1e-300))
    less = min(1.0, FASTEST_TURN / max(np.sqrt(turning), 1e-300))
    drive = room.drive
    for i in range(3):
        drive[3 + i] = less * handle_twist[3 + i]
    # As if the handle reached as far as the tool's centre of mass.
    fill_lever_arm(pose, centre, room.vector)
    for i in range(3):
        room.vector[i] += pose[i] - handle_pose[i]
    for i in range(3):
        one, two = (i + 1) % 3, (i + 2) % 3
        drive[i] = slower * handle_twist[i]
        drive[i] += drive[3 + one] * room.vector[two] - drive[3 + two] * room.vector[one]


@inner_kernel
def all_finite(pose, momentum, wrench):
    """Return whether a tick has come out in numbers."""
    total = 0.0
    for i in range(7):
        total += abs(pose[i])
    for i in range(6):
        total += abs(momentum[i]) + abs(wrench[i])
    return total < 1e300


@kernel
def extrapolated(pose, centre, contact_pose, contact_wrench, contact_stiffness, room, out):
    """Fill the wrench (6,) of a contact where the tool is now."""
    push_at(pose, centre, contact_pose, contact_wrench, contact_stiffness, room)
    for i in range(6):
        out[i] = room.push[i]


@kernel
def fill_port_twist(last_handle, handle, pose, centre, dt, vector, out):
    """Fill the mean velocity (6,) of the handle at the centre of mass of a tool at `pose`."""
    fill_displacement(last_handle, handle, centre, vector, out)
    # From the handle's idea of that centre to where the tool has it.
    fill_lever_arm(handle, centre, vector)
    x, y, z = handle[0] + vector[0], handle[1] + vector[1], handle[2] + vector[2]
    fill_lever_arm(pose, centre, vector)
    x, y, z = pose[0] + vector[0] - x, pose[1] + vector[1] - y, pose[2] + vector[2] - z
    a, b, c = out[3], out[4], out[5]
    out[0] += b * z - c * y
    out[1] += c * x - a * z
    out[2] += a * y - b * x
    for i in range(6):
        out[i] /= dt
