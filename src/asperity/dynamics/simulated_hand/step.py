"""One tick of the simulated hand, compiled: see `simulated_hand`."""

from __future__ import annotations

from asperity._core.kernels import kernel
from asperity.geometry.rigid_body import apply_displacement, fill_displacement, fill_lever_arm

OFFSET, TICK, STIFFNESS, DAMPING, MASS, NUMBERS = range(6)
"""Places in `numbers`: how far the hand presses beyond its target [m], the tick [s]; the hand's."""


@kernel
def hand_tick(wrench, following, centre, normal, along, pressing, turning, numbers, state, room):
    """Move a hand on by a tick under a wrench (6,) about its centre of mass.

    `following` (7,) is the target at the tick's end. `along`, `pressing`, `turning` (6,) are what
    place and velocity become of place, velocity and force: two rows of three. `room` has three
    rows of six numbers.
    """
    aim, pose, velocity, acceleration, arm = state
    drive, lag, step = room
    dt, offset = numbers[TICK], numbers[OFFSET]
    fill_displacement(aim, following, centre, arm, drive)
    fill_displacement(aim, pose, centre, arm, lag)
    deep, rise, push = offset, 0.0, 0.0
    for i in range(3):
        slip = velocity[i] - drive[i] / dt
        acceleration[i] = (
            wrench[i] - numbers[STIFFNESS] * lag[i] - numbers[DAMPING] * slip
        ) / numbers[MASS]
        deep += lag[i] * normal[i]
        rise += slip * normal[i]
        push += wrench[i] * normal[i]
    deeper = pressing[0] * deep + pressing[1] * rise + pressing[2] * push
    risen = pressing[3] * deep + pressing[4] * rise + pressing[5] * push
    for i in range(3):
        n = normal[i]
        side, aside = lag[i] - (deep - offset) * n, wrench[i] - push * n
        flank = velocity[i] - drive[i] / dt - rise * n
        step[i] = along[0] * side + along[1] * flank + along[2] * aside + (deeper - offset) * n
        flank = along[3] * side + along[4] * flank + along[5] * aside
        velocity[i] = drive[i] / dt + flank + risen * n
        j = 3 + i
        spin = velocity[j] - drive[j] / dt
        step[j] = turning[0] * lag[j] + turning[1] * spin + turning[2] * wrench[j]
        spin = turning[3] * lag[j] + turning[4] * spin + turning[5] * wrench[j]
        velocity[j] = drive[j] / dt + spin
    pose[:] = following
    apply_displacement(pose, step, centre, arm)
    fill_lever_arm(pose, centre, arm)
    aim[:] = following
