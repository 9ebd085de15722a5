"""The records that a step of the virtual coupling takes.

Its signature is `step(coupling, tool, handle, walls, workspace, wrench_out)`:

- `coupling` is what stays constant while the tool moves;
- `tool` is its state, advanced in place by one tick;
- `handle` and `walls` are what acts on it during the tick;
- `workspace` is scratch memory;
- `wrench_out` (6,) is filled with the wrench on the hand, about the tool's centre of mass, in world
  axes [N, N m].

It returns whether the new state is finite and, where a system of equations was solved, whether it
was positive definite.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array
from asperity._core.structures import by_reference
from asperity.dynamics.virtual_coupling.settings import Gains
from asperity.geometry.rigid_body import RigidBody


class Scheme(NamedTuple):
    """How a tool is advanced; see `virtual_coupling.step`."""

    has_mass: bool
    is_implicit: bool
    """Whether the coupling acts with its force at the end of the tick."""


class Coupling(NamedTuple):
    """A tool's mass properties, the spring and damper that hold it, and the tick."""

    body: RigidBody
    gains: Gains
    scheme: Scheme
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


@by_reference
class ContactWall(NamedTuple):
    """A contact to first order, as `LinearContact` has it."""

    pose: Array
    """Pose of the tool's frame at the contact query (7,)."""
    wrench: Array
    """(6,)"""
    stiffness: Array
    """(6, 6)"""
    damping: Array
    """(6, 6)"""
    damped: Array
    """(6,)"""
    energy: Array
    """[J], (1,)"""


@by_reference
class Walls(NamedTuple):
    """The walls of a tool; see `virtual_coupling.walls`."""

    latest: ContactWall
    other: ContactWall
    is_known: Array
    """Whether there is a latest one, and another one (2,) of bool."""


@by_reference
class Load(NamedTuple):
    """A wall at the tool's pose."""

    wrench: Array
    """Of a tool at rest (6,)."""
    energy: Array
    """[J], (1,)"""
    acts: Array
    """Whether it pushes (1,) of bool."""


@by_reference
class IntegratorWorkspace(NamedTuple):
    """Scratch memory of one tick, allocated once."""

    moved: Array
    """Displacement from the pose of the contact query to the tool (6,)."""
    extension: Array
    """Displacement from the tool to the handle: the extension of the spring (6,)."""
    handle_velocity: Array
    """Velocity of the handle at the tool's centre of mass (6,)."""
    velocity: Array
    """Velocity of the tool at the beginning of the tick (6,), where the scheme needs it."""
    lag: Array
    """Displacement from a tool without mass to its handle after the tick (6,)."""
    step: Array
    """Displacement of the tool in this tick (6,)."""
    spring: Array
    """Stiffness of the coupling: translation (three times), rotation (three times) (6,)."""
    damper: Array
    """Damping of the coupling in world axes (6, 6)."""
    inertia: Array
    """Mass and inertia in world axes (6, 6)."""
    matrix: Array
    """Matrix of the linear system (6, 6)."""
    rotation: Array
    """Rotation matrix of the tool (3, 3)."""
    tensor: Array
    """(3, 3)"""
    vector: Array
    """(3,)"""
    latest: Load
    other: Load
    held: Array
    """Whether contact holds the tool in this tick (1,) of bool."""


def workspace() -> IntegratorWorkspace:
    """Return scratch memory for one tick."""
    shapes: tuple[tuple[int, ...], ...] = (*[(6,)] * 7, *[(6, 6)] * 3, (3, 3), (3, 3), (3,))
    arrays = [np.zeros(shape) for shape in shapes]
    return IntegratorWorkspace._make([*arrays, _no_load(), _no_load(), np.zeros(1, np.bool_)])


def _no_load() -> Load:
    return Load(np.zeros(6), np.zeros(1), np.zeros(1, np.bool_))


def no_walls() -> Walls:
    """Return the walls of a tool that has had no contact."""
    return Walls(no_wall(), no_wall(), np.zeros(2, np.bool_))


def no_wall() -> ContactWall:
    """Return a wall without force."""
    pose = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    square = np.zeros((6, 6))
    return ContactWall(pose, np.zeros(6), square, square.copy(), np.zeros(6), np.zeros(1))
