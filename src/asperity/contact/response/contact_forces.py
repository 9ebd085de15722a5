"""Contacts, their forces and their friction, added to the output of a tick.

Friction is that of an elastic bristle between tool and body: it is deflected by the tool's motion,
and its force is limited by Coulomb's coefficient times the normal force. Below the limit the
contact sticks; at the limit it slips.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import clear, inner_kernel
from asperity._core.stack import stack_array
from asperity.geometry.frames import material_displacement, to_body, to_world


class ToolFrames(NamedTuple):
    """The tool's frame now and one tick before."""

    frame: NDArray[np.float64]
    """Current frame, (3, 4)."""
    last_frame: NDArray[np.float64]
    """Frame one tick before, (3, 4)."""
    moves: bool
    """Whether there was a last tick, and time has passed since."""
    centre: NDArray[np.float64]
    """Centre of mass in world axes [m], (3,)."""
    dt: float
    """Time since that tick [s]."""


class Bristle(NamedTuple):
    """The elastic bristle of one contact."""

    deflection: NDArray[np.float64]
    """In the scene body's frame [m], (3,)."""
    stiffness: float
    """[N/m]"""
    friction: float
    """Coulomb's coefficient [-]."""


@inner_kernel
def write_contact(contacts, c, body, weight, result, centre):
    """Write the result of a search to row `c` of the contacts.

    Parameters
    ----------
    body : int
        Number of the scene body.
    weight : float
        Share of the body's stiffness.
    result : PENETRATION
    centre : (3,) array
        The tool's centre of mass in world axes [m].
    """
    contacts.body[c], contacts.weight[c] = body, weight
    contacts.depth[c], contacts.gap[c] = result.depth, result.gap
    contacts.status[c], contacts.nodes[c], contacts.ties[c] = (
        result.status, result.nodes, result.ties,
    )  # fmt: skip
    for k in range(3):
        contacts.slope_normal[c, k] = result.slope_normal[k]
        contacts.point[c, k] = result.point[k] + centre[k]


@inner_kernel
def damped_push(push, dissipation, result, motion):
    """Return the normal force `push` [N] of a contact with damping (Hunt & Crossley 1975).

    It is `push (1 + a v)`, and at least 0, with a the `dissipation` [s/m] and v the rate of the
    depth.
    """
    if dissipation == 0.0 or not motion.moves:
        return push
    moved, rate = stack_array((3,)), 0.0
    material_displacement(True, motion.last_frame, motion.frame, result.point, motion.centre, moved)
    for k in range(3):
        rate -= result.slope_normal[k] * moved[k] / motion.dt
    return push * max(1.0 + dissipation * rate, 0.0)


@inner_kernel
def add_texture_force(out, c, push, result):
    """Add the force of Otaduy & Lin, `push` [N] times m, to contact `c` and to the wrench."""
    force = out.contacts.force[c]
    for k in range(3):
        force[k] = push * result.slope_normal[k]
        out.wrench[k] += force[k]
        out.wrench[3 + k] += push * result.moment[k]


@inner_kernel
def add_at_point(wrench, point, force):
    """Add a force (3,) [N] at a point (3,) relative to the centre of mass [m] to a wrench (6,)."""
    for k in range(3):
        one, two = (k + 1) % 3, (k + 2) % 3
        wrench[k] += force[k]
        wrench[3 + k] += point[one] * force[two] - point[two] * force[one]


@inner_kernel
def add_friction(out, c, point, body_frame, bristle, motion):
    """Move the bristle of contact `c` with the tool; add its force to the contact and the wrench.

    Parameters
    ----------
    point : (3,) array
        The contact's point relative to the tool's centre of mass [m].
    body_frame : (3, 4) array
        The scene body's frame.
    bristle : Bristle
        Its deflection is changed.
    motion : ToolFrames
    """
    contacts = out.contacts
    contacts.friction[c], contacts.bristle_stiffness[c] = bristle.friction, bristle.stiffness
    if bristle.friction == 0.0:
        clear(bristle.deflection)  # with a map, friction may return
        return
    moved, local, across, drag = (
        stack_array((3,)), stack_array((3,)), stack_array((3,)), stack_array((3,)),
    )  # fmt: skip
    force = out.contacts.force[c]
    material_displacement(
        motion.moves, motion.last_frame, motion.frame, point, motion.centre, moved
    )
    to_body(body_frame, moved, local)
    to_body(body_frame, out.contacts.slope_normal[c], across)
    limit = bristle.friction * math.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2)
    bristle_force(bristle.deflection, local, across, bristle.stiffness, limit, drag)
    to_world(body_frame, drag, local)
    for k in range(3):
        force[k] += local[k]
    add_at_point(out.wrench, point, local)


@inner_kernel
def bristle_force(deflection_io, moved, across, stiffness, limit, force_out):
    """Deflect a bristle by the tool's motion and fill its force.

    Parameters
    ----------
    deflection_io : (3,) array
        Deflection [m]; shortened if the bristle slips.
    moved : (3,) array
        Motion of the tool's material [m].
    across : (3,) array
        Normal of the surfaces, not of unit length; the bristle stays perpendicular to it.
    stiffness : float
        [N/m]
    limit : float
        Largest force [N].
    force_out : (3,) array
        [N]
    """
    square = across[0] ** 2 + across[1] ** 2 + across[2] ** 2
    along = 0.0
    for i in range(3):
        deflection_io[i] += moved[i]
        along += deflection_io[i] * across[i]
    length = 0.0
    for i in range(3):
        deflection_io[i] -= along * across[i] / square
        length += deflection_io[i] * deflection_io[i]
    length = math.sqrt(length)
    scale = 1.0
    if stiffness * length > limit:
        scale = limit / (stiffness * length)
    for i in range(3):
        deflection_io[i] *= scale
        force_out[i] = -stiffness * deflection_io[i]
