"""Kernels that remove contacts of textured pairs from MuJoCo's list, and set their replacements.

`set_constraints` sets the parameters of asperity's constraints directly, since MuJoCo's mixing of
`solref` and `solimp` cannot give a prescribed stiffness.

MuJoCo's normal force is `(aref - a) / R` with `aref = K I depth - B v`, a the acceleration of the
contact and v its velocity. So a contact is a spring of the stiffness `K I / R`, a damper `B / R`,
and a mass 1 / R that moves with it. K is chosen so that the spring's force is F, B for the damping
of Hunt & Crossley, and R so that the mass is a thousandth of that of the bodies: then the force
hardly depends on the solver. If the step is too long for such a spring, the mass is increased as
much as stability requires: forces at rest stay correct, fast ones are smoothed.

Contacts over an area that hardly slip (see `places`) have the mass of MuJoCo's default, and more
damping; those that slip are light. A body at rest is on constant springs, which need less mass.

Friction keeps MuJoCo's B, and its R unless a body would creep on the slopes of a texture. With a
pyramidal cone the same rows hold the normal force: they share the force F at rest, and B is
MuJoCo's.
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
from asperity._core.structures import by_reference
from asperity.mujoco.places import calmness

MARK = -7391
"""`vert[1]` of asperity's contacts in MuJoCo's list."""
LIGHT = 1e-3
"""Mass of a contact over that of the bodies."""
STEADY = 0.25
"""Upper limit of k dt^2 / m of a contact's spring, its squared phase in a step [rad^2].

With 0.5, one in nine rough boxes and capsules gained energy in corner impacts; with 0.25 none of
180.
"""
_HEAVY = 19.0
"""Mass of an area contact at rest over that of the bodies: R of a `solimp` of 0.95."""
_LYING = 1.0
"""The same on constant springs (see `places`), for faster settling."""
_DAMPED = 250.0
"""B of such a contact [1/s], but at most half of 1 / step."""
_STICKING, _LYING_STICKS = 1e-3, 1e-5
"""Upper limit of R of friction over the bodies' inverse mass; and on constant springs."""
_PYRAMIDAL = int(mujoco.mjtConstraint.mjCNSTR_CONTACT_PYRAMIDAL)
_ELLIPTIC = int(mujoco.mjtConstraint.mjCNSTR_CONTACT_ELLIPTIC)


@by_reference
class Tables(NamedTuple):
    """Properties of geoms, and pairs of bodies."""

    owner: NDArray[np.int64]
    """Number of asperity's body of each geom, -1 for none; (ngeom,)."""
    is_textured: NDArray[np.bool_]
    """(ngeom,)"""
    pair: NDArray[np.int64]
    """Number of the pair of two bodies, -1 for none; (bodies, bodies)."""
    least: NDArray[np.float64]
    """Lower limit of the distance passed to the search for each geom [m], (ngeom,)."""
    friction: NDArray[np.float64]
    """Coulomb's coefficient of each geom's surface, nan for MuJoCo's; (ngeom,)."""


@by_reference
class Found(NamedTuple):
    """Contacts removed from MuJoCo's list."""

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
    near: NDArray[np.int64]
    """Numbers of the pairs of bodies with such contacts, without duplicates; (pairs,)."""
    is_near: NDArray[np.bool_]
    """Whether a pair is in `near`, (pairs,); false between calls."""


@by_reference
class PlacedContacts(NamedTuple):
    """Data of the contacts appended to MuJoCo's list; rows are contacts."""

    push: NDArray[np.float64]
    """Force along the normal [N], (n,)."""
    steepness: NDArray[np.float64]
    """|m|, (n,)."""
    pair: NDArray[np.int64]
    """Number of the pair, (n,)."""
    slip: NDArray[np.float64]
    """Velocity of the tool normal to the force [m/s], world axes (n, 3)."""
    parting: NDArray[np.float64]
    """Its velocity along the force [m/s], (n,)."""
    is_second: NDArray[np.bool_]
    """Whether the contact's second geom is the tool's, (n,)."""
    calm: NDArray[np.float64]
    """`calmness` at each contact of a pair, (n,)."""
    lies: NDArray[np.bool_]
    """Whether the contact is a constant spring, (n,)."""


def placed(room: int) -> PlacedContacts:
    """Allocate memory for `room` contacts."""
    return PlacedContacts(
        np.zeros(room), np.zeros(room), np.zeros(room, np.int64), np.zeros((room, 3)),
        np.zeros(room), np.zeros(room, bool), np.zeros(room), np.zeros(room, bool),
    )  # fmt: skip


@kernel
def take_out(records, count, tables, templates, found):
    """Remove the contacts of textured pairs from the list.

    Parameters
    ----------
    records : contact records
        The first `count` are the list; the remaining ones are moved to the front.
    tables : Tables
    templates : contact records
        Filled with the removed ones.
    found : Found
        Filled with the removed ones.

    Returns
    -------
    (int, int, int)
        Numbers of remaining contacts, of removed ones, and of their pairs; (-1, 0, 0) if the list
        already has contacts of asperity's.
    """
    for c in range(count):
        if records[c].vert[1] == MARK:
            return -1, 0, 0
    kept = taken = pairs = 0
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
            if not found.is_near[pair]:
                found.is_near[pair], found.near[pairs] = True, pair
                pairs += 1
            taken += 1
        else:
            if kept != c:
                copy_record(records[kept], one)
            kept += 1
    for i in range(pairs):
        found.is_near[found.near[i]] = False
    return kept, taken, pairs


class Rows(NamedTuple):
    """Fields of MuJoCo's constraints that are changed; see `MjData`."""

    kind: NDArray[np.int32]
    resistance: NDArray[np.float64]
    """R [1/kg]"""
    inverse: NDArray[np.float64]
    """D = 1 / R"""
    reference: NDArray[np.float64]
    """K, B, I, P; (n, 4)."""


@kernel
def set_constraints(records, first, count, placed, rows, by_facets, dissipation, dt):
    """Set the constraints of asperity's contacts, `count` from record `first` on.

    Parameters
    ----------
    records : contact records
    placed : PlacedContacts
    rows : Rows
    by_facets : (pairs,) array of bool
        Whether pairs touch over an area.
    dissipation : float
        a of Hunt & Crossley [s/m].
    dt : float
        The step [s].

    Returns
    -------
    (int, float)
        The contact with the largest increase of mass, -1 for none, and its mass over that of the
        bodies.
    """
    most, worst = 0.0, -1
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
        # MuJoCo's estimate of the bodies' inverse mass at the contact, from which R was made.
        given = rows.reference[row, 2]
        inverse = rows.resistance[row] * given / (1.0 - given)
        wanted = max(spring * dt * dt / STEADY, 2.0 * damper * dt) * inverse - 1.0
        if wanted > most:
            most, worst = wanted, i
        calm = 0.0
        if by_facets[placed.pair[i]]:
            slip = placed.slip[i]
            speed = math.sqrt(slip[0] ** 2 + slip[1] ** 2 + slip[2] ** 2)
            calm = calmness(speed)
        heavy = _LYING if placed.lies[i] else _HEAVY
        mass = max(wanted, LIGHT + heavy * calm) * push / (depth * spring) / inverse
        old, new = rows.resistance[row], 1.0 / mass
        share = inverse / (inverse + new)
        rows.resistance[row], rows.inverse[row] = new, mass
        rows.reference[row, 0] = push * new / (depth * share)
        damped = dissipation * push * placed.steepness[i] * new
        rows.reference[row, 1] = max(damped, calm * min(_DAMPED, 0.5 / dt))
        rows.reference[row, 2], rows.reference[row, 3] = share, 0.0
        if rows.kind[row] == _ELLIPTIC:
            sticking = _LYING_STICKS if placed.lies[i] else _STICKING
            stiffer = min(sticking * inverse / rows.resistance[row + 1], 1.0)
            for j in range(row + 1, row + one.dim):
                rows.resistance[j] *= stiffer
                rows.inverse[j] /= stiffer
            one.mu *= math.sqrt(stiffer * old / new)
    return worst, most


def rows_of(data: mujoco.MjData) -> Rows:
    """Return the constraints of `data`."""
    return Rows(data.efc_type, data.efc_R, data.efc_D, data.efc_KBIP)


def found(room: int, pairs: int) -> Found:
    """Allocate memory for `room` removed contacts."""
    return Found(
        np.zeros((room, 2), np.int32), np.zeros((room, 3)), np.zeros(room), np.zeros(room),
        np.zeros(room, np.int64), np.zeros(max(pairs, 1), np.int64), np.zeros(max(pairs, 1), bool),
    )  # fmt: skip


@kernel
def relative_pose(xpos, xmat, carriers, locals_, home, motion_out, pose_out):
    """Fill the tool's frame relative to other bodies, in the axes of their first pose.

    Parameters
    ----------
    xpos, xmat : (nbody, 3) and (nbody, 9) arrays
        Frames of MuJoCo's bodies.
    carriers : (2,) array of int
        Those of the tool and of one of the others.
    locals_ : (2, 3, 4) array
        Frames of the tool and of that other body in their carriers.
    home : (3, 4) array
        First frame of that other body.
    motion_out : (2, 3, 4) array
        The tool's frame, and the motion of the others from their first pose.
    pose_out : (7,) array
        The tool's frame as a pose.
    """
    frame, place = stack_array((2, 3, 4)), motion_out[1]
    for b in range(2):
        for i in range(3):
            for j in range(4):
                frame[b, i, j] = xpos[carriers[b], i] if j == 3 else 0.0
                for k in range(3):
                    frame[b, i, j] += xmat[carriers[b], 3 * i + k] * locals_[b, k, j]
    for i in range(3):
        place[i, 3] = frame[1, i, 3]
        for j in range(3):
            place[i, j] = 0.0
            for k in range(3):
                place[i, j] += frame[1, i, k] * home[j, k]
        for k in range(3):
            place[i, 3] -= place[i, k] * home[k, 3]
    for i in range(3):
        for j in range(4):
            motion_out[0, i, j] = 0.0
            for k in range(3):
                moved = frame[0, k, j] - (place[k, 3] if j == 3 else 0.0)
                motion_out[0, i, j] += place[k, i] * moved
        pose_out[i] = motion_out[0, i, 3]
    _fill_quaternion(motion_out[0], pose_out)


@inner_kernel
def _fill_quaternion(frame, pose_out):
    """Fill the unit quaternion of a frame (3, 4) into the last four numbers of a pose (7,)."""
    trace = frame[0, 0] + frame[1, 1] + frame[2, 2]
    largest = 0
    for k in range(1, 3):
        if frame[k, k] > frame[largest, largest]:
            largest = k
    if trace > frame[largest, largest]:
        w = 0.5 * math.sqrt(1.0 + trace)
        pose_out[3] = w
        for k in range(3):
            one, two = (k + 1) % 3, (k + 2) % 3
            pose_out[4 + k] = (frame[two, one] - frame[one, two]) / (4.0 * w)
    else:
        one, two = (largest + 1) % 3, (largest + 2) % 3
        rest = frame[largest, largest] - frame[one, one] - frame[two, two]
        x = 0.5 * math.sqrt(1.0 + rest)
        pose_out[3] = (frame[two, one] - frame[one, two]) / (4.0 * x)
        pose_out[4 + largest] = x
        pose_out[4 + one] = (frame[one, largest] + frame[largest, one]) / (4.0 * x)
        pose_out[4 + two] = (frame[two, largest] + frame[largest, two]) / (4.0 * x)
    size = 0.0
    for k in range(3, 7):
        size += pose_out[k] * pose_out[k]
    for k in range(3, 7):
        pose_out[k] /= math.sqrt(size)
