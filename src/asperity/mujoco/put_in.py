"""Conversion of contacts found by a search to contacts of MuJoCo's list.

A contact of asperity's has depth delta, deepest point x*, and force F along m (not of unit length).
As a contact of MuJoCo's it has `dist = -delta / |m|`, `pos = x*` and the normal m / |m|.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, kernel
from asperity._core.records import copy_record
from asperity._core.stack import stack_array
from asperity.mujoco.places import calmness, divide_stiffness, update_places
from asperity.mujoco.rows import MARK, Found, Tables

LEAST_FRICTION = 1e-5
"""Smallest coefficient of friction, as in MuJoCo, which divides by it."""


class Velocities(NamedTuple):
    """Velocities of the bodies of a model, as in `MjData` and `MjModel`."""

    cvel: NDArray[np.float64]
    """Angular and linear velocity, (nbody, 6) [rad/s, m/s]."""
    origin: NDArray[np.float64]
    """`subtree_com`, reference point of the linear velocity of a root's bodies, (nbody, 3) [m]."""
    root: NDArray[np.int32]
    """`body_rootid`, (nbody,)."""


@inner_kernel
def _fill_slip(velocities, carriers, point, force, slip_out):
    """Fill the tool's velocity relative to the other body at a point, normal to a force (3,).

    Returns the speed along the force.
    """
    along = size = 0.0
    for k in range(3):
        one, two, slip_out[k] = (k + 1) % 3, (k + 2) % 3, 0.0
        for b in range(2):
            body = carriers[b]
            v, origin = velocities.cvel[body], velocities.origin[velocities.root[body]]
            own = v[3 + k] + v[one] * (point[two] - origin[two])
            own -= v[two] * (point[one] - origin[one])
            slip_out[k] += own if b == 0 else -own
        along += slip_out[k] * force[k]
        size += force[k] * force[k]
    for k in range(3):
        slip_out[k] -= along * force[k] / size
    return along / math.sqrt(size)


@inner_kernel
def _fill_record(one, depth, force, place):
    """Fill contact record `one`: its point, and the axes of a force (3,) on its second geom.

    Returns the force's magnitude.
    """
    size, old, normal = 0.0, stack_array((9,)), stack_array((3,))
    for k in range(3):
        size += force[k] * force[k]
    size = math.sqrt(size)
    for k in range(9):
        old[k] = one.frame[k]
    for k in range(3):
        one.pos[k], normal[k] = place[k], force[k] / size
    _fill_frame(one.frame, old, normal)
    one.dist, one.includemargin, one.exclude = -depth, 0.0, 0
    one.efc_address, one.vert[1] = -1, MARK
    return size


@inner_kernel
def _nearest(templates, taken, found, pair, tables, tool, body, point):
    """Return MuJoCo's contact between two bodies that is nearest to a point, -1 for none."""
    best, nearest = np.inf, -1
    for t in range(taken):
        if found.pair[t] != pair:
            continue
        a, b = tables.owner[found.geoms[t, 0]], tables.owner[found.geoms[t, 1]]
        is_these = (a == tool and b == body) or (a == body and b == tool)
        far = 0.0 if is_these else 1e6
        for k in range(3):
            far += (templates[t].pos[k] - point[k]) ** 2
        if far < best:
            best, nearest = far, t
    return nearest


@inner_kernel
def _fill_frame(frame, old, normal):
    """Fill a contact's axes (9,): a normal, and the old first tangent projected normal to it."""
    along = 0.0
    for k in range(3):
        along += old[3 + k] * normal[k]
    size = 0.0
    for k in range(3):
        frame[k] = normal[k]
        frame[3 + k] = old[3 + k] - along * normal[k]
        size += frame[3 + k] ** 2
    if size < 1e-6:
        # The old tangent is along the new normal: take any other.
        least = 0
        for k in range(1, 3):
            if abs(normal[k]) < abs(normal[least]):
                least = k
        size = 0.0
        for k in range(3):
            frame[3 + k] = (1.0 if k == least else 0.0) - normal[least] * normal[k]
            size += frame[3 + k] ** 2
    size = math.sqrt(size)
    for k in range(3):
        frame[3 + k] /= size
    for k in range(3):
        one, two = (k + 1) % 3, (k + 2) % 3
        frame[6 + k] = frame[one] * frame[3 + two] - frame[two] * frame[3 + one]


@inner_kernel
def _own_friction(one, tables):
    """Set the friction of a contact record if it was given for one of its geoms."""
    sliding, other = tables.friction[one.geom[0]], tables.friction[one.geom[1]]
    if not sliding >= other:
        sliding = other if other == other else sliding
    if sliding == sliding:
        one.friction[0] = one.friction[1] = max(sliding, LEAST_FRICTION)


class Taken(NamedTuple):
    """Contacts removed from MuJoCo's list."""

    templates: NDArray[np.void]
    found: Found
    tables: Tables


class Bodies(NamedTuple):
    """The bodies of a pair."""

    number: int
    """Of the pair."""
    tool: int
    """Number of its tool among asperity's bodies."""
    carriers: NDArray[np.int64]
    """Bodies of the model that carry the tool and the others, (2,)."""
    motion: NDArray[np.float64]
    """The tool's frame among the others at their first pose, and their motion from it [m],
    (2, 3, 4)."""
    velocities: Velocities
    stiffness: float
    """Of a contact of weight 1 [N/m]."""
    dt: float
    """Time since the last step [s]."""


@inner_kernel
def _append(records, listed, taken, bodies, contact, placed):
    """Append a contact to the list; return the list's length.

    `contact` is (body, depth, |m|, point, force, whether it is a constant spring), world axes.
    """
    (total, kept, count), (body, depth, steep, point, force, lies) = listed, contact
    row, size = total - kept, force[0] ** 2 + force[1] ** 2 + force[2] ** 2
    if not size > 0.0 or row == placed.push.size or total == records.size:
        return total
    tables = taken.tables
    t = _nearest(
        taken.templates, count, taken.found, bodies.number, tables, bodies.tool, body, point
    )
    if t < 0:
        return total
    one, toward = records[total], stack_array((3,))
    copy_record(one, taken.templates[t])
    sign = 1.0 if tables.owner[one.geom[1]] == bodies.tool else -1.0
    for k in range(3):
        toward[k] = sign * force[k]
    placed.push[row] = _fill_record(one, depth / steep, toward, point)
    placed.steepness[row], placed.pair[row] = steep, bodies.number
    placed.parting[row] = _fill_slip(
        bodies.velocities, bodies.carriers, point, force, placed.slip[row]
    )
    placed.is_second[row], placed.lies[row] = sign > 0.0, lies
    _own_friction(one, tables)
    return total + 1


@inner_kernel
def _to_world(motion, point, force, point_out, force_out):
    """Transform a point (3,) and rotate a force (3,) by a motion (3, 4)."""
    for j in range(3):
        point_out[j], force_out[j] = motion[j, 3], 0.0
        for k in range(3):
            point_out[j] += motion[j, k] * point[k]
            force_out[j] += motion[j, k] * force[k]


@inner_kernel
def _fill_calmness(contacts, bodies, calm_out):
    """Fill the `calmness` at each contact."""
    point, force, slip = stack_array((3,)), stack_array((3,)), stack_array((3,))
    for c in range(contacts.count[0]):
        _to_world(bodies.motion[1], contacts.point[c], contacts.slope_normal[c], point, force)
        _fill_slip(bodies.velocities, bodies.carriers, point, force, slip)
        square = 0.0
        for k in range(3):
            square += slip[k] ** 2
        calm_out[c] = calmness(math.sqrt(square))


@inner_kernel
def _append_places(contacts, records, listed, taken, bodies, memory, placed):
    """Append the places of bodies that touch over an area; return the list's length."""
    (total, kept, count), motion, calm = listed, bodies.motion[1], placed.calm
    point, force, own = stack_array((3,)), stack_array((3,)), stack_array((3,))
    is_at_rest = update_places(memory, contacts, bodies.motion[0], bodies.dt)
    if not is_at_rest:
        _fill_calmness(contacts, bodies, calm)
        divide_stiffness(memory, contacts, calm)
    for i in range(memory.count[0]):
        depth, steep = memory.present[i], 0.0
        if depth <= 0.0 or memory.share[i] == 0.0:
            continue
        push = bodies.stiffness * memory.share[i] * depth
        for k in range(3):
            own[k] = push * memory.slope_normal[i, k]
            steep += memory.slope_normal[i, k] ** 2
        if memory.is_fresh[i] and not is_at_rest:
            # The part of the force beyond k w delta m jumps when another place becomes deepest.
            c = memory.contact[i]
            push = bodies.stiffness * contacts.weight[c] * contacts.depth[c]
            for k in range(3):
                rest = contacts.force[c, k] - push * contacts.slope_normal[c, k]
                own[k] += (1.0 - calm[c]) * rest
        _to_world(motion, memory.now[i], own, point, force)
        contact = (memory.body[i], depth, math.sqrt(steep), point, force, is_at_rest)
        total = _append(records, (total, kept, count), taken, bodies, contact, placed)
    return total


@kernel
def put_in(contacts, records, listed, taken, bodies, memory, placed):
    """Append the contacts of one pair to the list; return the list's length.

    Parameters
    ----------
    contacts : Contacts
        In the axes of the other bodies' first pose.
    records : contact records
        The list.
    listed : (int, int, int)
        Length of the list, number of MuJoCo's own contacts in it, number of removed ones.
    taken : Taken
    bodies : Bodies
    memory : Places
        Of bodies that touch over an area; of size 0 for others.
    placed : PlacedContacts
        Row `i` belongs to record `i` after MuJoCo's own.
    """
    total, kept, count = listed
    if memory.depth.size > 0:
        return _append_places(contacts, records, listed, taken, bodies, memory, placed)
    point, force = stack_array((3,)), stack_array((3,))
    for c in range(contacts.count[0]):
        steep = 0.0
        _to_world(bodies.motion[1], contacts.point[c], contacts.force[c], point, force)
        for k in range(3):
            steep += contacts.slope_normal[c, k] ** 2
        contact = (contacts.body[c], contacts.depth[c], math.sqrt(steep), point, force, False)
        total = _append(records, (total, kept, count), taken, bodies, contact, placed)
    return total
