"""The records that every integrator of the virtual coupling takes.

All integrators have one signature, `step(coupling, tool, handle, contact, workspace, wrench_out)`:

- `coupling` is what stays constant while the tool moves;
- `tool` is its state, advanced in place by one tick;
- `handle` and `contact` (a `LinearContact`) are what acts on it during the tick;
- `workspace` is scratch memory;
- `wrench_out` (6,) is filled with the wrench on the hand, about the tool's centre of mass, in world
  axes [N, N m].

They return whether the new state is finite and, where a system of equations was solved, whether it
was positive definite.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array
from asperity.dynamics.virtual_coupling.settings import Gains
from asperity.geometry.rigid_body import RigidBody


class Coupling(NamedTuple):
    """A tool's mass properties, the spring and damper that hold it, and the tick."""

    body: RigidBody
    gains: Gains
    dt: float
    """[s]"""


class ToolMotion(NamedTuple):
    """The state of a coupled tool."""

    pose: Array
    """Pose of the tool's frame (7,): position [m], unit quaternion wxyz."""
    momentum: Array
    """Linear [kg m/s] and angular momentum about the centre of mass [kg m^2/s], world axes (6,)."""
    velocity: Array
    """Velocity of the centre of mass [m/s] and angular velocity [rad/s], world axes (6,)."""


class HandleMotion(NamedTuple):
    """The handle at the end of a tick."""

    pose: Array
    """Pose that the tool's frame is drawn to (7,): position [m], unit quaternion wxyz."""
    twist: Array
    """Velocity of its origin [m/s] and angular velocity [rad/s], world axes (6,)."""


class IntegratorWorkspace(NamedTuple):
    """Scratch memory of one tick, allocated once."""

    moved: Array
    """Displacement from the pose of the contact query to the tool (6,)."""
    extension: Array
    """Displacement from the tool to the handle: the extension of the spring (6,)."""
    handle_velocity: Array
    """Velocity of the handle at the tool's centre of mass (6,)."""
    contact_wrench: Array
    """Wrench of the contact, extrapolated to the tool's pose (6,)."""
    step: Array
    """Displacement of the tool in this tick (6,)."""
    matrix: Array
    """Matrix of the integrator's linear system (6, 6)."""
    rotation: Array
    """Rotation matrix of the tool (3, 3)."""
    inertia: Array
    """Inertia tensor, or its inverse, in world axes (3, 3)."""
    damping: Array
    """Rotational damping in world axes (3, 3) [N m s/rad]."""
    vector: Array
    """(3,)"""


def workspace() -> IntegratorWorkspace:
    """Return scratch memory for one tick."""
    shapes: tuple[tuple[int, ...], ...] = (*[(6,)] * 5, (6, 6), (3, 3), (3, 3), (3, 3), (3,))
    return IntegratorWorkspace(*(np.zeros(shape) for shape in shapes))
