"""Kernels that take contacts of textured pairs out of MuJoCo's list, and put asperity's in.

A contact of asperity's has depth delta, deepest point x*, and force F along m (not of unit length).
As a contact of MuJoCo's it has `dist = -delta / |m|`, `pos = x*` and the normal m / |m|. What its
constraint is made of is then set (`set_constraints`), since MuJoCo's own mixing of `solref` and
`solimp` gives no stiffness that one could ask for.

MuJoCo's normal force is `(aref - a) / R` with `aref = K I depth - B v`, a the acceleration of the
contact and v its velocity. So a contact is a spring of the stiffness `K I / R`, a damper `B / R`,
and a mass 1 / R that moves with it. K is chosen so that the spring's force is F, B for the damping
of Hunt & Crossley, and R so that the mass is a thousandth of that of the bodies: then the force
hardly depends on the solver. Where the step is too long for such a spring the mass is larger, by
just as much as keeps it stable: forces at rest stay right, fast ones are smoothed.

Friction keeps MuJoCo's own R and B. With a pyramidal cone these are those of the normal too: the
rows of a contact share the force F when at rest, and B is MuJoCo's.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, kernel
from asperity._core.records import copy_record
from asperity._core.stack import stack_array

MARK = -7391
"""`vert[1]` of asperity's contacts in MuJoCo's list."""
LIGHT = 1e-3
"""Mass of a contact over that of the bodies at it."""
STEADY = 0.5
"""Square of the phase [rad^2] by which a contact's spring may swing in a step."""
_LEAST_FRICTION = 1e-5
"""As in MuJoCo, which divides by it."""
_PYRAMIDAL = int(mujoco.mjtConstraint.mjCNSTR_CONTACT_PYRAMIDAL)
_ELLIPTIC = int(mujoco.mjtConstraint.mjCNSTR_CONTACT_ELLIPTIC)


class Tables(NamedTuple):
    """Which geoms are whose."""

    owner: NDArray[np.int64]
    """Number of asperity's body of each geom, -1 for none; (ngeom,)."""
    is_textured: NDArray[np.bool_]
    """(ngeom,)"""
    pair: NDArray[np.int64]
    """Number of the pair that searches contact between two bodies, -1 for none; (bodies, bodies).
    """
    least: NDArray[np.float64]
    """Least distance that is passed on for each geom [m], (ngeom,)."""
    friction: NDArray[np.float64]
    """Coulomb's coefficient of each geom's surface, nan for MuJoCo's; (ngeom,)."""


class Found(NamedTuple):
    """Contacts of MuJoCo's that were taken out of its list."""

    geoms: NDArray[np.int32]
    """(n, 2)"""
    points: NDArray[np.float64]
    """[m], (n, 3)"""
    distances: NDArray[np.float64]
    """[m], (n,)"""
    margins: NDArray[np.float64]
    """[m], (n,)"""
    pair: NDArray[np.int64]
    """Number of the pair of bodies, (n,)."""
    seen: NDArray[np.bool_]
    """Which pairs of bodies have some, (pairs,)."""


class Placed(NamedTuple):
    """What is remembered of the contacts that were put into MuJoCo's list, a row each."""

    push: NDArray[np.float64]
    """Force along the normal [N], (n,)."""
    steepness: NDArray[np.float64]
    """|m|, (n,)."""
    pair: NDArray[np.int64]
    """Number of the pair, (n,)."""
    weight: NDArray[np.float64]
    """Share of the pair's stiffness, (n,)."""


def placed(room: int) -> Placed:
    """Allocate room for contacts."""
    return Placed(np.zeros(room), np.zeros(room), np.zeros(room, np.int64), np.zeros(room))


@kernel
def take_out(records, count, tables, templates, found):
    """Take the contacts of textured pairs out of the list.

    Parameters
    ----------
    records : contact records
        The first `count` are the list; those that stay are moved to the front.
    tables : Tables
    templates : contact records
        Filled with those that were taken out.
    found : Found
        Filled likewise.

    Returns
    -------
    (int, int)
        How many stay, and how many were taken out; (-1, 0) if the list has asperity's already.
    """
    for c in range(count):
        if records[c].vert[1] == MARK:
            return -1, 0
    kept = taken = 0
    for c in range(count):
        one = records[c]
        g, h, pair = one.geom[0], one.geom[1], -1
        if g >= 0 and h >= 0 and (tables.is_textured[g] or tables.is_textured[h]):
            a, b = tables.owner[g], tables.owner[h]
            if a >= 0 and b >= 0:
                pair = tables.pair[a, b]
        if pair >= 0 and taken < templates.size:
            copy_record(templates[taken], one)
            found.geoms[taken, 0], found.geoms[taken, 1] = g, h
            found.distances[taken] = max(one.dist, max(tables.least[g], tables.least[h]))
            found.margins[taken], found.pair[taken] = one.includemargin, pair
            for k in range(3):
                found.points[taken, k] = one.pos[k]
            found.seen[pair] = True
            taken += 1
        else:
            if kept != c:
                copy_record(records[kept], one)
            kept += 1
    return kept, taken


@inner_kernel
def _nearest(templates, taken, found, pair, tables, tool, body, point):
    """Return the contact of MuJoCo's between two bodies that is nearest to a point, -1 for none."""
    best, which = np.inf, -1
    for t in range(taken):
        if found.pair[t] != pair:
            continue
        a, b = tables.owner[found.geoms[t, 0]], tables.owner[found.geoms[t, 1]]
        is_these = (a == tool and b == body) or (a == body and b == tool)
        far = 0.0 if is_these else 1e6
        for k in range(3):
            far += (templates[t].pos[k] - point[k]) ** 2
        if far < best:
            best, which = far, t
    return which


@inner_kernel
def _fill_frame(frame, old, normal):
    """Fill a contact's axes (9,): a normal, and the old first tangent turned to be across it."""
    along = 0.0
    for k in range(3):
        along += old[3 + k] * normal[k]
    size = 0.0
    for k in range(3):
        frame[k] = normal[k]
        frame[3 + k] = old[3 + k] - along * normal[k]
        size += frame[3 + k] ** 2
    if size < 1e-6:
        # The old tangent lies along the new normal: any other will do.
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


@kernel
def put_in(contacts, records, total, kept, templates, taken, found, tables, pair, place, placed):
    """Append the contacts of one pair to the list, and return how many it has.

    Parameters
    ----------
    contacts : Contacts
        In the axes of the other bodies' first pose.
    records : contact records
        The list; `total` are in it, of which the first `kept` are MuJoCo's own.
    templates, taken, found, tables
        See `take_out`.
    pair : (int, int)
        Numbers of the pair and of its tool among asperity's bodies.
    place : (3, 4) array
        Motion of the other bodies from their first pose [m].
    placed : Placed
        Row `i` is that of `records[kept + i]`.
    """
    number, tool = pair
    point, force, old = stack_array((3,)), stack_array((3,)), stack_array((9,))
    for c in range(contacts.count[0]):
        size = steep = 0.0
        for i in range(3):
            point[i], force[i] = place[i, 3], 0.0
            for k in range(3):
                point[i] += place[i, k] * contacts.point[c, k]
                force[i] += place[i, k] * contacts.force[c, k]
            size += force[i] * force[i]
            steep += contacts.slope_normal[c, i] ** 2
        size, steep = math.sqrt(size), math.sqrt(steep)
        row = total - kept
        if not size > 0.0 or row == placed.push.size or total == records.size:
            continue
        t = _nearest(
            templates, taken, found, number, tables, tool, contacts.body[c], point
        )
        if t < 0:
            continue
        one = records[total]
        copy_record(one, templates[t])
        sign = 1.0 if tables.owner[one.geom[1]] == tool else -1.0
        for k in range(9):
            old[k] = one.frame[k]
        for k in range(3):
            one.pos[k] = point[k]
            force[k] *= sign / size
        _fill_frame(one.frame, old, force)
        one.dist, one.includemargin, one.exclude = -contacts.depth[c] / steep, 0.0, 0
        one.efc_address, one.vert[1] = -1, MARK
        sliding, other = tables.friction[one.geom[0]], tables.friction[one.geom[1]]
        if not sliding >= other:
            sliding = other if other == other else sliding
        if sliding == sliding:
            one.friction[0] = one.friction[1] = max(sliding, _LEAST_FRICTION)
        placed.push[row], placed.steepness[row] = size, steep
        placed.pair[row], placed.weight[row] = number, contacts.weight[c]
        total += 1
    return total


class Rows(NamedTuple):
    """The constraints of MuJoCo's that are changed; see `MjData`."""

    kind: NDArray[np.int32]
    resistance: NDArray[np.float64]
    """R [1/kg]"""
    inverse: NDArray[np.float64]
    """D = 1 / R"""
    reference: NDArray[np.float64]
    """K, B, I, P; (n, 4)."""


@kernel
def set_constraints(records, first, count, placed, rows, dissipation, dt):
    """Set the constraints of asperity's contacts, `count` from record `first` on.

    Parameters
    ----------
    records : contact records
    placed : Placed
    rows : Rows
    dissipation : float
        a of Hunt & Crossley [s/m].
    dt : float
        The step [s].

    Returns
    -------
    (int, float)
        The contact whose mass had to be increased most, -1 for none, and the mass that it got over
        that of the bodies.
    """
    worst, which = 0.0, -1
    for i in range(count):
        one = records[first + i]
        row = one.efc_address
        if row < 0:
            continue
        push, depth = placed.push[i], -one.dist
        if rows.kind[row] == _PYRAMIDAL:
            edges = 2 * (one.dim - 1)
            for j in range(row, row + edges):
                part = push * rows.resistance[j] / edges
                rows.reference[j, 0] = part / (depth * rows.reference[j, 2])
            continue
        spring = damper = 0.0
        for j in range(count):
            if placed.pair[j] == placed.pair[i]:
                spring -= placed.push[j] / records[first + j].dist
                damper += dissipation * placed.push[j] * placed.steepness[j]
        # MuJoCo's estimate of the bodies' inverse mass at the contact, of which it has made R.
        given = rows.reference[row, 2]
        inverse = rows.resistance[row] * given / (1.0 - given)
        wanted = max(spring * dt * dt / STEADY, 2.0 * damper * dt) * inverse - 1.0
        if wanted > worst:
            worst, which = wanted, i
        mass = max(wanted, LIGHT) * push / (depth * spring) / inverse
        old, new = rows.resistance[row], 1.0 / mass
        share = inverse / (inverse + new)
        rows.resistance[row], rows.inverse[row] = new, mass
        rows.reference[row, 0] = push * new / (depth * share)
        rows.reference[row, 1] = dissipation * push * placed.steepness[i] * new
        rows.reference[row, 2], rows.reference[row, 3] = share, 0.0
        if rows.kind[row] == _ELLIPTIC:
            one.mu *= math.sqrt(old / new)
    return which, worst


def rows_of(data: mujoco.MjData) -> Rows:
    """Return the constraints of `data`."""
    return Rows(data.efc_type, data.efc_R, data.efc_D, data.efc_KBIP)


def found(room: int, pairs: int) -> Found:
    """Allocate room for contacts that are taken out."""
    return Found(
        np.zeros((room, 2), np.int32), np.zeros((room, 3)), np.zeros(room), np.zeros(room),
        np.zeros(room, np.int64), np.zeros(max(pairs, 1), bool),
    )  # fmt: skip


@kernel
def relative_pose(xpos, xmat, carriers, locals_, home, pose_out, place_out):
    """Fill the tool's place among other bodies as if these were at their first pose.

    Parameters
    ----------
    xpos, xmat : (nbody, 3) and (nbody, 9) arrays
        Frames of MuJoCo's bodies.
    carriers : (2,) array of int
        That of the tool, and that of one of the others.
    locals_ : (2, 3, 4) array
        Frames of the tool, and of that other body, in their carriers.
    home : (3, 4) array
        First frame of that other body.
    pose_out : (3, 4) array
        The tool's frame.
    place_out : (3, 4) array
        Motion of the others from their first pose.
    """
    frame = stack_array((2, 3, 4))
    for b in range(2):
        for i in range(3):
            for j in range(4):
                frame[b, i, j] = xpos[carriers[b], i] if j == 3 else 0.0
                for k in range(3):
                    frame[b, i, j] += xmat[carriers[b], 3 * i + k] * locals_[b, k, j]
    for i in range(3):
        place_out[i, 3] = frame[1, i, 3]
        for j in range(3):
            place_out[i, j] = 0.0
            for k in range(3):
                place_out[i, j] += frame[1, i, k] * home[j, k]
        for k in range(3):
            place_out[i, 3] -= place_out[i, k] * home[k, 3]
    for i in range(3):
        for j in range(4):
            pose_out[i, j] = 0.0
            for k in range(3):
                moved = frame[0, k, j] - (place_out[k, 3] if j == 3 else 0.0)
                pose_out[i, j] += place_out[k, i] * moved
