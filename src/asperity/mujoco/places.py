"""Persistent contact points of bodies that touch over an area.

Such bodies have many points that are almost equally deep. The deepest one jumps between them as the
body tilts by a micrometre, and the torque with it: a body at rest on a rough plate would rattle for
ever. So the points that were deepest are stored as *places*, with depths extrapolated to first
order, until the body has slipped over them by a fraction of the shortest wavelength. A contact that
hardly slips is divided between its places, in proportion to their depths; one that slips is not.

A body may still rock by micrometres from one set of places to another. If it has not left its
position for a while, its places become constant springs, on which it comes to rest, until it moves
on. Their force slowly approaches that of the search, and so does the depth at rest.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, small_kernel
from asperity._core.stack import stack_array
from asperity._core.structures import by_reference

_LIFT = 2e-4
"""Largest separation of the surfaces at a stored place [m]."""
_ALONG = 0.9
"""Smallest cosine between the normals of places of one contact."""
_CREEP = 1e-2
"""Slip speed above which a contact is not divided [m/s]."""
_WHILE = 0.05
"""Time after which a body that has not left its position is on constant springs [s]."""
_HELD = 3.0
"""Factor on the slip limit of constant springs, so that settling does not end them."""
_FOLLOW = 0.05
"""Time constant with which their force approaches that of the search [s]."""


@by_reference
class Places(NamedTuple):
    """Stored places; the first `count[0]` rows are valid.

    In the axes of the other bodies' first pose, except `on_tool`.
    """

    count: NDArray[np.int64]  # type: ignore[assignment]  # hides tuple.count
    """(1,)"""
    point: NDArray[np.float64]
    """The tool's point when the place was stored [m], (n, 3)."""
    on_tool: NDArray[np.float64]
    """The same in the tool's frame [m], (n, 3)."""
    now: NDArray[np.float64]
    """The tool's point in this step [m], (n, 3)."""
    slope_normal: NDArray[np.float64]
    """m, (n, 3)"""
    depth: NDArray[np.float64]
    """[m], (n,)"""
    contact: NDArray[np.int64]
    """The contact of this step to which it belongs; -1 for none, (n,)."""
    present: NDArray[np.float64]
    """Its depth in this step [m], (n,)."""
    is_fresh: NDArray[np.bool_]
    """Whether it is a deepest point of this step, (n,)."""
    body: NDArray[np.int64]
    """The scene body that it is on, (n,)."""
    share: NDArray[np.float64]
    """Stiffness of its spring over that of a contact of weight 1, (n,)."""
    still: NDArray[np.float64]
    """Time since the body last left its position [s], (1,)."""
    was: NDArray[np.float64]
    """The tool's frame at that time, (3, 4) [m]."""
    reach: NDArray[np.float64]
    """Slip limit of a place, and least distance between two places [m]; (2,)."""


def places(room: int, slip: float, least_distance: float) -> Places:
    """Allocate memory for `room` places; none is stored with 0."""
    return Places(
        np.zeros(1, np.int64), np.zeros((room, 3)), np.zeros((room, 3)), np.zeros((room, 3)),
        np.zeros((room, 3)), np.zeros(room), np.full(room, -1, np.int64), np.zeros(room),
        np.zeros(room, bool), np.zeros(room, np.int64), np.zeros(room), np.zeros(1),
        np.zeros((3, 4)), np.array([slip, least_distance]),
    )  # fmt: skip


@inner_kernel
def _copy(memory, source, target):
    """Copy a stored place to another row."""
    memory.depth[target], memory.share[target] = memory.depth[source], memory.share[source]
    memory.body[target] = memory.body[source]
    for k in range(3):
        memory.point[target, k] = memory.point[source, k]
        memory.on_tool[target, k] = memory.on_tool[source, k]
        memory.slope_normal[target, k] = memory.slope_normal[source, k]


@inner_kernel
def _along_and_across(moved, m):
    """Return a motion (3,) times m (3,), and the square of its component normal to m."""
    along = square = slip = 0.0
    for k in range(3):
        along += moved[k] * m[k]
        square += m[k] * m[k]
        slip += moved[k] * moved[k]
    return along, slip - along * along / square


@inner_kernel
def _extrapolate(memory, pose, is_at_rest):
    """Extrapolate the depths of places to a pose (3, 4) of the tool; drop invalid places.

    Returns whether none was dropped; at rest, places without a load may be.
    """
    kept, are_all = 0, True
    reach, moved = memory.reach[0] * (_HELD if is_at_rest else 1.0), stack_array((3,))
    for i in range(memory.count[0]):
        for k in range(3):
            now = pose[k, 3]
            for j in range(3):
                now += pose[k, j] * memory.on_tool[i, j]
            moved[k], memory.now[kept, k] = now - memory.point[i, k], now
        along, slip = _along_and_across(moved, memory.slope_normal[i])
        present = memory.depth[i] - along
        if slip > reach * reach or present < -_LIFT:
            are_all = are_all and (is_at_rest and present < 0.0)
            continue
        if kept != i:
            _copy(memory, i, kept)
        memory.present[kept], memory.contact[kept], memory.is_fresh[kept] = present, -1, False
        kept += 1
    memory.count[0] = kept
    return are_all


@inner_kernel
def _nearest(memory, contacts, c):
    """Return the stored place nearest to contact `c`, and its squared distance [m^2]."""
    count, nearest, best = memory.count[0], -1, np.inf
    for i in range(count):
        if memory.is_fresh[i]:
            continue
        far = 0.0
        for k in range(3):
            far += (memory.now[i, k] - contacts.point[c, k]) ** 2
        if far < best:
            nearest, best = i, far
    return nearest, best


@inner_kernel
def _store(memory, contacts, c, pose):
    """Store the place of contact `c`, replacing one that is near, or the nearest without room.

    So places stay spread over the body, and support it wherever it rocks.
    """
    count, (nearest, best) = memory.count[0], _nearest(memory, contacts, c)
    at = count
    if best < memory.reach[1] ** 2 or count == memory.depth.size:
        at = nearest
    if at < 0:
        return
    if at == count:
        memory.count[0] += 1
    memory.body[at] = contacts.body[c]
    memory.depth[at] = memory.present[at] = contacts.depth[c]
    memory.contact[at], memory.is_fresh[at] = c, True
    for k in range(3):
        memory.point[at, k] = memory.now[at, k] = contacts.point[c, k]
        memory.slope_normal[at, k] = contacts.slope_normal[c, k]
    for j in range(3):
        memory.on_tool[at, j] = 0.0
        for k in range(3):
            memory.on_tool[at, j] += pose[k, j] * (contacts.point[c, k] - pose[k, 3])


@inner_kernel
def _assign(memory, contacts):
    """Assign each other loaded place to the nearest contact with a similar normal."""
    for i in range(memory.count[0]):
        if memory.is_fresh[i] or memory.present[i] <= 0.0:
            continue
        best = np.inf
        for c in range(contacts.count[0]):
            dot = one = two = far = 0.0
            for k in range(3):
                m, other = memory.slope_normal[i, k], contacts.slope_normal[c, k]
                dot += m * other
                one += m * m
                two += other * other
                far += (memory.now[i, k] - contacts.point[c, k]) ** 2
            if dot > _ALONG * math.sqrt(one * two) and far < best:
                best, memory.contact[i] = far, c
        if memory.contact[i] >= 0:
            deepest = contacts.depth[memory.contact[i]]
            memory.present[i] = min(memory.present[i], deepest)


@small_kernel
def calmness(speed):
    """Return the weight of area contacts as at rest, for a slip speed [m/s]: 1 at rest, then 0."""
    return max(1.0 - (speed / _CREEP) ** 2, 0.0)


@inner_kernel
def _has_left(memory):
    """Return whether a place has slipped beyond its limit since the tool was at `was`."""
    moved = stack_array((3,))
    for i in range(memory.count[0]):
        for k in range(3):
            moved[k] = memory.now[i, k] - memory.was[k, 3]
            for j in range(3):
                moved[k] -= memory.was[k, j] * memory.on_tool[i, j]
        _, slip = _along_and_across(moved, memory.slope_normal[i])
        if slip > memory.reach[0] ** 2:
            return True
    return memory.count[0] == 0


@inner_kernel
def _comes_to_rest(memory, pose, dt):
    """Return whether the tool has not left its position for a while, `dt` [s] after the last step.

    If so, the places are stored in their current state, with equal springs: those that are not
    loaded at this moment, as the body rocks, must support it as well.
    """
    if _has_left(memory):
        memory.still[0] = 0.0
        for k in range(3):
            for j in range(4):
                memory.was[k, j] = pose[k, j]
    memory.still[0] += dt
    if memory.still[0] < _WHILE:
        return False
    force = depths = 0.0
    for i in range(memory.count[0]):
        depth = max(memory.present[i], 0.0)
        force += memory.share[i] * depth
        depths += depth
    if depths == 0.0:
        return False
    for i in range(memory.count[0]):
        memory.share[i] = force / depths
        memory.depth[i] = memory.present[i]
        for k in range(3):
            memory.point[i, k] = memory.now[i, k]
    return True


@inner_kernel
def _is_supported(memory):
    """Return whether a place has a positive depth."""
    is_deep = False
    for i in range(memory.count[0]):
        is_deep = is_deep or memory.present[i] > 0.0
    return is_deep


@inner_kernel
def _follow(memory, contacts, pose, dt):
    """Let the force of constant springs slowly approach that of the search, without impulses.

    A new place of the search, far from the stored ones, is added with depth 0.
    """
    given = wanted = total = 0.0
    for i in range(memory.count[0]):
        given += memory.share[i] * max(memory.present[i], 0.0)
        total += memory.share[i]
    for c in range(contacts.count[0]):
        wanted += contacts.weight[c] * contacts.depth[c]
        _, best = _nearest(memory, contacts, c)
        at = memory.count[0]
        if best >= memory.reach[1] ** 2 and 0 < at < memory.depth.size:
            _store(memory, contacts, c, pose)
            memory.depth[at] = memory.present[at] = 0.0
            memory.is_fresh[at], memory.share[at] = False, memory.share[0]
    for i in range(memory.count[0] if total > 0.0 else 0):
        rise = min(dt / _FOLLOW, 1.0) * (wanted - given) / total
        memory.depth[i] += rise
        memory.present[i] += rise


@inner_kernel
def update_places(memory, contacts, pose, dt):
    """Update the places for a new pose; return whether they are constant springs.

    If not, the places of all contacts are stored, and each stored one is assigned to a contact.

    Parameters
    ----------
    memory : Places
    contacts : Contacts
    pose : (3, 4) array
        The tool's frame, in the axes of the other bodies' first pose.
    dt : float
        Time since the last step [s].
    """
    is_at_rest = memory.still[0] >= _WHILE
    are_all = _extrapolate(memory, pose, is_at_rest)
    if is_at_rest and not (are_all and _is_supported(memory)):
        is_at_rest, memory.still[0] = False, 0.0
    elif not is_at_rest:
        is_at_rest = _comes_to_rest(memory, pose, dt)
    if is_at_rest:
        _follow(memory, contacts, pose, dt)
        return True
    for c in range(contacts.count[0]):
        _store(memory, contacts, c, pose)
    _assign(memory, contacts)
    return False


@inner_kernel
def divide_stiffness(memory, contacts, calm):
    """Divide the stiffness of each contact between its places, in proportion to their depths.

    Parameters
    ----------
    calm : (contacts,) array
        Weight of places that are not deepest points; see `calmness`.
    """
    for i in range(memory.count[0]):
        memory.share[i] = 0.0
    for c in range(contacts.count[0]):
        squares = 0.0
        for i in range(memory.count[0]):
            if memory.contact[i] == c:
                squares += memory.present[i] ** 2 * (1.0 if memory.is_fresh[i] else calm[c])
        for i in range(memory.count[0]):
            if memory.contact[i] == c and squares > 0.0:
                count = 1.0 if memory.is_fresh[i] else calm[c]
                wanted = contacts.weight[c] * contacts.depth[c]
                memory.share[i] = wanted * memory.present[i] * count / squares
