"""Places where bodies that touch over an area were deepest a moment ago.

Such bodies have many places that are nearly as deep. The deepest hops from one to another as the
body tilts by a micrometre, and the torque with it: a body that lies on a rough plate would rattle
for ever. So a place that was the deepest is remembered, with its depth carried on to first order,
until the body has slipped over it by a part of the shortest wave. Contacts that hardly slip are
divided between their places, in proportion to the depths; those that slip are not.

Yet a body may go on rocking by micrometres, from one set of places to another. Once it has not
left its place for a while it lies on constant springs at the places that are remembered then, on
which it comes to rest, until it moves on. Their force follows that of the search slowly, so that
the body comes to rest at the depth that was searched.
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
"""How far the surfaces may part at a remembered place [m]."""
_ALONG = 0.9
"""Least cosine between the normals of places of one contact."""
_CREEP = 1e-2
"""Speed of slip from which a contact is not divided [m/s]."""
_WHILE = 0.05
"""Time after which a body that has not left its place lies on constant springs [s]."""
_HELD = 3.0
"""How much farther than others these may slip, so that settling does not end them."""
_FOLLOW = 0.05
"""Time in which their force follows that of the search [s]."""


@by_reference
class Places(NamedTuple):
    """Remembered places; the first `count[0]` rows are valid.

    In the axes of the other bodies' first pose, but for `on_tool`.
    """

    count: NDArray[np.int64]  # type: ignore[assignment]  # hides tuple.count
    """(1,)"""
    point: NDArray[np.float64]
    """Where the tool's point was [m], (n, 3)."""
    on_tool: NDArray[np.float64]
    """The same in the tool's frame [m], (n, 3)."""
    now: NDArray[np.float64]
    """Where it is in this step [m], (n, 3)."""
    slope_normal: NDArray[np.float64]
    """m, (n, 3)"""
    depth: NDArray[np.float64]
    """[m], (n,)"""
    contact: NDArray[np.int64]
    """The contact of this step that it is a place of; -1 for none, (n,)."""
    present: NDArray[np.float64]
    """Its depth in this step [m], (n,)."""
    is_fresh: NDArray[np.bool_]
    """Whether it is the deepest place in this step, (n,)."""
    body: NDArray[np.int64]
    """The scene body that it lies on, (n,)."""
    share: NDArray[np.float64]
    """Stiffness of its spring over that of a contact of weight 1, (n,)."""
    still: NDArray[np.float64]
    """How long the body has not left its place [s], (1,)."""
    was: NDArray[np.float64]
    """The tool's frame since then, (3, 4) [m]."""
    reach: NDArray[np.float64]
    """How far a place may be slipped over, and how far apart two places are, [m]; (2,)."""


def places(room: int, slip: float, apart: float) -> Places:
    """Allocate room for places; none is remembered with `room` 0."""
    return Places(
        np.zeros(1, np.int64), np.zeros((room, 3)), np.zeros((room, 3)), np.zeros((room, 3)),
        np.zeros((room, 3)), np.zeros(room), np.full(room, -1, np.int64), np.zeros(room),
        np.zeros(room, bool), np.zeros(room, np.int64), np.zeros(room), np.zeros(1),
        np.zeros((3, 4)), np.array([slip, apart]),
    )  # fmt: skip


@inner_kernel
def _copy(memory, source, target):
    """Copy what is remembered of a place to another row."""
    memory.depth[target], memory.share[target] = memory.depth[source], memory.share[source]
    memory.body[target] = memory.body[source]
    for k in range(3):
        memory.point[target, k] = memory.point[source, k]
        memory.on_tool[target, k] = memory.on_tool[source, k]
        memory.slope_normal[target, k] = memory.slope_normal[source, k]


@inner_kernel
def _along_and_across(moved, m):
    """Return a motion (3,) times m (3,), and the square of its part across m."""
    along = square = slip = 0.0
    for k in range(3):
        along += moved[k] * m[k]
        square += m[k] * m[k]
        slip += moved[k] * moved[k]
    return along, slip - along * along / square


@inner_kernel
def _carry_on(memory, pose, is_at_rest):
    """Carry the depths of remembered places on to a pose (3, 4) of the tool; drop what is old.

    Returns whether none was dropped; at rest one that bears nothing may be.
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
    """Return the remembered place nearest to contact `c`, and its distance squared [m^2]."""
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
def _renew(memory, contacts, c, pose):
    """Remember the place of contact `c`, instead of one that is near; of the nearest without room.

    Places all over the body stay so, and it is borne wherever it rocks to.
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
    """Give each remembered place that is still deep to the nearest contact of about its normal."""
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
    """Return how far contacts over an area are at rest, 0 to 1, at a speed of slip [m/s]."""
    return max(1.0 - (speed / _CREEP) ** 2, 0.0)


@inner_kernel
def _has_left(memory):
    """Return whether some place has slipped out of reach since the tool was where it `was`."""
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
def _wait(memory, pose, dt):
    """Return whether the tool has not left its place for a while, `dt` [s] after the last step.

    If so, the places are remembered as they are now, with equal springs: those that are not the
    deepest just now, as the body rocks, must bear it as well.
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
def _bears(memory):
    """Return whether the springs bear the body: one of their places is deep."""
    is_deep = False
    for i in range(memory.count[0]):
        is_deep = is_deep or memory.present[i] > 0.0
    return is_deep


@inner_kernel
def _follow(memory, contacts, pose, dt):
    """Let constant springs follow the search slowly, so that nothing kicks the body.

    A place that the search finds where none is remembered bears as soon as the body sinks on it.
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
            _renew(memory, contacts, c, pose)
            memory.depth[at] = memory.present[at] = 0.0
            memory.is_fresh[at], memory.share[at] = False, memory.share[0]
    for i in range(memory.count[0] if total > 0.0 else 0):
        rise = min(dt / _FOLLOW, 1.0) * (wanted - given) / total
        memory.depth[i] += rise
        memory.present[i] += rise


@inner_kernel
def recall(memory, contacts, pose, dt):
    """Carry the places of contact on to a pose; return whether they are constant springs.

    If not, the places of all contacts are remembered, and each remembered one belongs to a contact.

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
    are_all = _carry_on(memory, pose, is_at_rest)
    if is_at_rest and not (are_all and _bears(memory)):
        is_at_rest, memory.still[0] = False, 0.0
    elif not is_at_rest:
        is_at_rest = _wait(memory, pose, dt)
    if is_at_rest:
        _follow(memory, contacts, pose, dt)
        return True
    for c in range(contacts.count[0]):
        _renew(memory, contacts, c, pose)
    _assign(memory, contacts)
    return False


@inner_kernel
def share_out(memory, contacts, calm):
    """Divide the stiffness of each contact between its places, in proportion to their depths.

    Parameters
    ----------
    calm : (contacts,) array
        How much places count that are not the deepest; see `calmness`.
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
