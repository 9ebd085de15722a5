"""Places where bodies that touch over an area were deepest a moment ago.

Such bodies have many places that are nearly as deep. The deepest hops from one to another as the
body tilts by a micrometre, and the torque with it: a body that lies on a rough plate would rattle
for ever. So a place that was the deepest is remembered, with its depth carried on to first order,
until the body has slipped over it by a part of the shortest wave. Contacts that hardly slip are
divided between their places in proportion to the depths; those that slip are not.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel

_LIFT = 2e-4
"""How far the surfaces may part at a remembered place [m]."""
_ALONG = 0.9
"""Least cosine between the normals of places of one contact."""


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
    reach: NDArray[np.float64]
    """How far a place may be slipped over, and how far apart two places are, [m]; (2,)."""


def places(room: int, slip: float, apart: float) -> Places:
    """Allocate room for places; none is remembered with `room` 0."""
    return Places(
        np.zeros(1, np.int64), np.zeros((room, 3)), np.zeros((room, 3)), np.zeros((room, 3)),
        np.zeros((room, 3)), np.zeros(room), np.full(room, -1, np.int64), np.zeros(room),
        np.zeros(room, bool), np.array([slip, apart]),
    )  # fmt: skip


@inner_kernel
def _copy(memory, source, target):
    """Copy what is remembered of a place to another row."""
    memory.depth[target] = memory.depth[source]
    for k in range(3):
        memory.point[target, k] = memory.point[source, k]
        memory.on_tool[target, k] = memory.on_tool[source, k]
        memory.slope_normal[target, k] = memory.slope_normal[source, k]


@inner_kernel
def _carry_on(memory, pose):
    """Carry the depths of remembered places on to a pose (3, 4) of the tool; drop what is old."""
    kept = 0
    for i in range(memory.count[0]):
        along = square = slip = 0.0
        for k in range(3):
            now = pose[k, 3]
            for j in range(3):
                now += pose[k, j] * memory.on_tool[i, j]
            moved, m = now - memory.point[i, k], memory.slope_normal[i, k]
            memory.now[kept, k] = now
            along += moved * m
            square += m * m
            slip += moved * moved
        slip -= along * along / square
        present = memory.depth[i] - along
        if slip > memory.reach[0] ** 2 or present < -_LIFT:
            continue
        if kept != i:
            _copy(memory, i, kept)
        memory.present[kept], memory.contact[kept], memory.is_fresh[kept] = present, -1, False
        kept += 1
    memory.count[0] = kept


@inner_kernel
def _renew(memory, contacts, c, pose):
    """Remember the place of contact `c`, instead of one that is near, or of the least deep."""
    count, at, least = memory.count[0], memory.count[0], -1
    for i in range(count):
        if memory.is_fresh[i]:
            continue
        far = 0.0
        for k in range(3):
            far += (memory.now[i, k] - contacts.point[c, k]) ** 2
        if far < memory.reach[1] ** 2:
            at = i
        if least < 0 or memory.present[i] < memory.present[least]:
            least = i
    if at == memory.depth.size:
        at = least
    if at < 0:
        return
    if at == count:
        memory.count[0] += 1
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


@inner_kernel
def recall(memory, contacts, pose):
    """Remember the places of all contacts, and find which contact each remembered one belongs to.

    Parameters
    ----------
    memory : Places
    contacts : Contacts
    pose : (3, 4) array
        The tool's frame, in the axes of the other bodies' first pose.
    """
    _carry_on(memory, pose)
    for c in range(contacts.count[0]):
        _renew(memory, contacts, c, pose)
    _assign(memory, contacts)
