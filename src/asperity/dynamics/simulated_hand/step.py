"""One tick of the simulated hand, compiled: see `simulated_hand.hand`."""

from __future__ import annotations

from typing import NamedTuple

from asperity._core.arrays import Array
from asperity._core.kernels import kernel
from asperity._core.stack import stack_array
from asperity._core.structures import by_reference
from asperity.geometry.rigid_body import apply_displacement, fill_displacement, fill_lever_arm


@by_reference
class HandModel(NamedTuple):
    """The constants of a hand.

    A transition (2, 3) maps displacement, velocity and held force to the displacement (first row)
    and the velocity (second row) one tick later.
    """

    centre: Array
    """Centre of mass in the handle's frame [m], (3,)."""
    normal: Array
    """Unit normal of the surface, world axes (3,)."""
    tangential: Array
    """Transition across the normal (2, 3)."""
    pressing: Array
    """Transition along the normal (2, 3)."""
    rotational: Array
    """Transition of rotations (2, 3)."""
    dt: float
    """Tick [s]."""
    mass: float
    """[kg]"""
    stiffness: float
    """[N/m]"""
    damping: float
    """[N s/m]"""


@by_reference
class HandState(NamedTuple):
    """The state of a hand, advanced in place."""

    target: Array
    """Pose that the hand aims at (7,)."""
    pose: Array
    """Pose of the handle (7,)."""
    velocity: Array
    """Velocity of the centre of mass [m/s] and angular velocity [rad/s], world axes (6,)."""
    acceleration: Array
    """Acceleration of the centre of mass at the beginning of the tick (3,) [m/s^2]."""
    arm: Array
    """From the handle's origin to the centre of mass, world axes (3,) [m]."""


@kernel
def hand_step(model, state, wrench, target, offset):
    """Advance a hand by one tick under a wrench held constant over it.

    Parameters
    ----------
    model : HandModel
    state : HandState
    wrench : (6,) array
        On the hand about its centre of mass [N, N m].
    target : (7,) array
        Pose that the hand aims at, at the end of the tick.
    offset : float
        Distance by which the hand aims beyond its target, against the normal [m].
    """
    centre, normal, dt = model.centre, model.normal, model.dt
    tangential, pressing, rotational = model.tangential, model.pressing, model.rotational
    pose, velocity, arm = state.pose, state.velocity, state.arm
    target_step, lag, step = stack_array((6,)), stack_array((6,)), stack_array((6,))
    fill_displacement(state.target, target, centre, arm, target_step)
    fill_displacement(state.target, pose, centre, arm, lag)
    # Along the normal: displacement, velocity relative to the target, and force.
    depth, rise, push = offset, 0.0, 0.0
    for i in range(3):
        slip = velocity[i] - target_step[i] / dt
        state.acceleration[i] = (
            wrench[i] - model.stiffness * lag[i] - model.damping * slip
        ) / model.mass
        depth += lag[i] * normal[i]
        rise += slip * normal[i]
        push += wrench[i] * normal[i]
    new_depth = pressing[0, 0] * depth + pressing[0, 1] * rise + pressing[0, 2] * push
    new_rise = pressing[1, 0] * depth + pressing[1, 1] * rise + pressing[1, 2] * push
    for i in range(3):
        n = normal[i]
        side, force = lag[i] - (depth - offset) * n, wrench[i] - push * n
        slide = velocity[i] - target_step[i] / dt - rise * n
        step[i] = (
            tangential[0, 0] * side
            + tangential[0, 1] * slide
            + tangential[0, 2] * force
            + (new_depth - offset) * n
        )
        slide = tangential[1, 0] * side + tangential[1, 1] * slide + tangential[1, 2] * force
        velocity[i] = target_step[i] / dt + slide + new_rise * n
        j = 3 + i
        spin = velocity[j] - target_step[j] / dt
        step[j] = rotational[0, 0] * lag[j] + rotational[0, 1] * spin + rotational[0, 2] * wrench[j]
        spin = rotational[1, 0] * lag[j] + rotational[1, 1] * spin + rotational[1, 2] * wrench[j]
        velocity[j] = target_step[j] / dt + spin
    pose[:] = target
    apply_displacement(pose, step, centre, arm)
    fill_lever_arm(pose, centre, arm)
    state.target[:] = target
