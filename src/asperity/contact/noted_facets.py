"""What facets were near, and face each other: noted for some ticks, in two rings.

A tool moves little in a tick. So facets are looked for somewhat farther than they have to be, and
noted; what is noted holds until the tool has moved that far (Verlet, 1967, of molecules). The inner
ring is gone through in each tick. It is taken, every ten ticks or so, from the outer one, which
reaches several times as far; of each pair it is known how far the tool has to move until it may be
of the inner ring. While that outer ring still holds, the trees are gone through for the next one, a
few boxes in each tick, so that no tick has to wait for it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.compiled import inner_kernel
from asperity.contact.chart import FLATTEST
from asperity.contact.facet_table import FacetTable
from asperity.contact.facing import (
    STACK,
    cosine_of,
    facing_pairs,
    far_by,
    moved_since,
    turn_facet,
    walk,
)
from asperity.stack import stack_array

MAX_NOTED = 8192

_TICKS = 10.0
"""For so many ticks of the present speed what is noted should hold,"""
_LEAST_SPARE, _MOST_SPARE = 2e-4, 1e-3
"""looked for this much farther at least, and at most [m]."""
_OUTER, _NARROWEST = 4.0, 2.0
"""So many times as far facets of the outer ring are looked for; half of that where there is no room
for so many, and none below the second.
"""
_OLD = 0.55
"""When so much of its spare is used up, the next outer ring is begun,"""
_IN_TICKS = 4.0
"""to be done after so many ticks, if it takes as many visits as the last."""
_FIRST_VISITS = 5000.0

# Of `NotedFacets.holds` and `outer_holds`.
_NEAR, _REACH, _SPARE, _COUNT = 0, 1, 2, 3
_NONE, _TOO_MANY = -1.0, -2.0
# Of `NotedFacets.under_way`, which begins as those do.
_TOP, _VISITS, _USUAL, _TIMES = 4, 5, 6, 7


class NotedFacets(NamedTuple):
    """What facets of a tool were near each body of the scene, and for how long that holds."""

    pairs: NDArray[np.int64]
    """(bodies, n, 2)"""
    holds: NDArray[np.float64]
    """For what depths, and how far sideways [m]; until the tool has moved so far [m]; how many
    there are, or why there are none. (bodies, 4)"""
    way: NDArray[np.float64]
    """From the tool's frame to the body's when they were noted, (bodies, 3, 4)."""
    travelled: NDArray[np.float64]
    """How far the tool has moved from note to note, and what is near has widened [m], (bodies,)."""
    outer_pairs: NDArray[np.int64]
    outer_holds: NDArray[np.float64]
    outer_way: NDArray[np.float64]
    outer_beyond: NDArray[np.float64]
    """How far it will have, at least, when a pair may be one of the inner ring [m], (bodies, n)."""
    next_pairs: NDArray[np.int64]
    under_way: NDArray[np.float64]
    """Of the next outer ring, as `holds`; how many pairs of boxes are still to be gone through, how
    many were, and how many were for the last one; and how many times as far they reach. (bodies, 8)
    """
    next_way: NDArray[np.float64]
    next_beyond: NDArray[np.float64]
    stack: NDArray[np.int64]
    """Those pairs of boxes, (bodies, 512, 2)."""


def noted_facets(bodies: int) -> NotedFacets:
    """Return room for the facets near so many bodies; none are noted."""
    noted = NotedFacets(
        *_ring(bodies, 4),
        np.zeros(bodies),
        *_ring(bodies, 4),
        np.zeros((bodies, MAX_NOTED)),
        *_ring(bodies, 8),
        np.zeros((bodies, MAX_NOTED)),
        stack=np.zeros((bodies, STACK, 2), np.int64),
    )
    note_nothing(noted)
    return noted


def _ring(
    bodies: int, numbers: int
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Return pairs, what there is to know of them, and a way, of each body."""
    pairs = np.zeros((bodies, MAX_NOTED, 2), np.int64)
    return pairs, np.zeros((bodies, numbers)), np.zeros((bodies, 3, 4))


def note_nothing(noted: NotedFacets) -> None:
    """Forget what facets were near."""
    noted.holds[:, _COUNT] = _NONE
    noted.outer_holds[:, _COUNT] = _NONE
    noted.under_way[:, _TOP] = _NONE
    noted.under_way[:, _USUAL], noted.under_way[:, _TIMES] = _FIRST_VISITS, _OUTER
    noted.travelled[:] = 0.0


@inner_kernel
def _apart_by(table: FacetTable, f, g, near, reach, facing):
    """Return by how much more than `reach` a facet of A is beside g, or out of g's [-reach, near].

    As seen along g's normal: one side of either has the other beyond it. At least by so much [m]; 0
    or less if it is neither.
    """
    seen = stack_array((8, 2))
    o, x, y, z = table.origin[g], table.axes[g, 0], table.axes[g, 1], table.axes[g, 2]
    count = table.sides[f]
    low_x, low_y, shallowest = np.inf, np.inf, np.inf
    high_x, high_y, deepest = -np.inf, -np.inf, -np.inf
    for c in range(count):
        # Seen from B's side A's facet runs round the other way.
        p = facing.turned[f, count - 1 - c]
        d0, d1, d2 = p[0] - o[0], p[1] - o[1], p[2] - o[2]
        on_x = d0 * x[0] + d1 * x[1] + d2 * x[2]
        on_y = d0 * y[0] + d1 * y[1] + d2 * y[2]
        deep = -(d0 * z[0] + d1 * z[1] + d2 * z[2])
        seen[c, 0], seen[c, 1] = on_x, on_y
        low_x, high_x = min(low_x, on_x), max(high_x, on_x)
        low_y, high_y = min(low_y, on_y), max(high_y, on_y)
        shallowest, deepest = min(shallowest, deep), max(deepest, deep)
    wide_x, wide_y = table.half[g, 0] + reach, table.half[g, 1] + reach
    apart = max(shallowest - near, -deepest - reach)
    apart = max(apart, low_x - wide_x, -high_x - wide_x, low_y - wide_y, -high_y - wide_y)
    if apart > 0.0:
        return apart
    for r in range(table.count_rows[g]):
        row = table.rows[g, r]
        least = np.inf
        for c in range(count):
            least = min(least, row[0] + row[1] * seen[c, 0] + row[2] * seen[c, 1])
        apart = max(apart, least - reach)
    if apart > 0.0:
        return apart
    box = table.count_rows[g] == 0
    for c in range(count):
        after = c + 1 if c + 1 < count else 0
        out_x, out_y = seen[after, 1] - seen[c, 1], seen[c, 0] - seen[after, 0]
        size = math.sqrt(out_x * out_x + out_y * out_y)
        base = out_x * seen[c, 0] + out_y * seen[c, 1] + size * reach
        if box:
            least = -abs(out_x) * table.half[g, 0] - abs(out_y) * table.half[g, 1]
        else:
            least = np.inf
            for k in range(table.sides[g]):
                corner = table.corners[g, k]
                least = min(least, out_x * corner[0] + out_y * corner[1])
        if least > base:
            return (least - base) / size
    return apart


@inner_kernel
def _beyond_by(table: FacetTable, f, g, near, reach, flattest, size, facing):
    """Return how far A has to move, at least, until a pair is wanted [m]; 0 or less if it is."""
    by = (flattest - cosine_of(table, f, g, facing)) * size
    by = max(by, far_by(table, f, g, math.hypot(near, reach), reach, facing))
    return by if by > 0.0 else _apart_by(table, f, g, near, reach, facing)


@inner_kernel
def _keep_way(way, way_out):
    for i in range(3):
        for k in range(4):
            way_out[i, k] = way[i, k]


@inner_kernel
def _take_from_outer(table: FacetTable, b, way, near, reach, flattest, size, noted, facing):
    """Note what is wanted of the facets of the outer ring; return how many."""
    facing.clock[0] += 1
    facing.clock[1] = 0
    turn, shift, travelled = way[:, :3], way[:, 3], noted.travelled[b]
    kept = np.int64(0)
    for i in range(int(noted.outer_holds[b, _COUNT])):
        if travelled < noted.outer_beyond[b, i]:
            continue
        f, g = noted.outer_pairs[b, i, 0], noted.outer_pairs[b, i, 1]
        if facing.stamp[f] != facing.clock[0]:
            turn_facet(table, f, turn, shift, facing)
        beyond = _beyond_by(table, f, g, near, reach, flattest, size, facing)
        noted.outer_beyond[b, i] = travelled + max(beyond, 0.0)
        if beyond <= 0.0:
            if kept < MAX_NOTED:
                noted.pairs[b, kept, 0], noted.pairs[b, kept, 1] = f, g
            kept += 1
    return kept


@inner_kernel
def _take_from_all(table: FacetTable, a, b, way, near, reach, flattest, noted, facing):
    """Do so of all facets."""
    # Sideways textures move points no farther than they rise.
    margin = math.hypot(near, reach)
    count = facing_pairs(table, a, b, way[:, :3], way[:, 3], margin, reach, flattest, facing)
    kept = np.int64(0)
    for i in range(count):
        f, g = facing.pairs[i, 0], facing.pairs[i, 1]
        if _apart_by(table, f, g, near, reach, facing) > 0.0:
            continue
        if kept < MAX_NOTED:
            noted.pairs[b, kept, 0], noted.pairs[b, kept, 1] = f, g
        kept += 1
    return kept


@inner_kernel
def _note(table: FacetTable, a, b, way, near, reach, spare, size, noted, facing):
    """Note the facets that `near_pairs` wants, and those that it may while A moves by `spare`."""
    near, reach, flattest = near + spare, reach + spare, FLATTEST - spare / size
    holds, outer = noted.holds[b], noted.outer_holds[b]
    # What was too far away by something may be near when the tool has moved by that, or when that
    # much farther ones are wanted.
    wider = max(near - holds[_NEAR], reach - holds[_REACH], spare - holds[_SPARE], 0.0)
    noted.travelled[b] += moved_since(noted.way[b], way, size) + wider
    holds[_NEAR], holds[_REACH], holds[_SPARE] = near, reach, spare
    _keep_way(way, noted.way[b])
    moved = moved_since(noted.outer_way[b], way, size)
    if (
        outer[_COUNT] >= 0.0
        and moved + spare <= outer[_SPARE]
        and near + moved <= outer[_NEAR]
        and reach + moved <= outer[_REACH]
    ):
        kept = _take_from_outer(table, b, way, near, reach, flattest, size, noted, facing)
    else:
        kept = _take_from_all(table, a, b, way, near, reach, flattest, noted, facing)
    fits = kept <= MAX_NOTED and facing.clock[1] == 0
    holds[_COUNT] = float(kept) if fits else _TOO_MANY


@inner_kernel
def _measure(table: FacetTable, b, way, size, first, last, noted, facing):
    """Fill from when on pairs of the next outer ring may be wanted, as seen from here."""
    holds = noted.holds[b]
    travelled = noted.travelled[b] + moved_since(noted.way[b], way, size)
    flattest = FLATTEST - holds[_SPARE] / size
    for i in range(first, last):
        f, g = noted.next_pairs[b, i, 0], noted.next_pairs[b, i, 1]
        beyond = _beyond_by(table, f, g, holds[_NEAR], holds[_REACH], flattest, size, facing)
        noted.next_beyond[b, i] = travelled + max(beyond, 0.0)


@inner_kernel
def _go_on(table: FacetTable, a, b, way, near, reach, spare, size, noted, facing):
    """Look at some boxes for the next outer ring, if the present one will not hold much longer."""
    outer, coming = noted.outer_holds[b], noted.under_way[b]
    if coming[_TOP] == _TOO_MANY or spare == 0.0:
        return
    if coming[_TOP] == _NONE:
        moved = moved_since(noted.outer_way[b], way, size)
        if (
            outer[_COUNT] >= 0.0
            and moved <= _OLD * outer[_SPARE]
            and near + spare + moved <= outer[_NEAR]
            and reach + spare + moved <= outer[_REACH]
        ):
            return
        wide = coming[_TIMES] * spare
        coming[_NEAR], coming[_REACH], coming[_SPARE] = near + wide, reach + wide, wide
        coming[_COUNT], coming[_TOP], coming[_VISITS] = 0.0, 1.0, 0.0
        noted.stack[b, 0, 0], noted.stack[b, 0, 1] = table.root[a], table.root[b]
        _keep_way(way, noted.next_way[b])
    # What is looked for is what may be near while the tool is within the spare of where it was when
    # this began; seen from where it is now that is farther by how far it has moved since.
    moved = moved_since(noted.next_way[b], way, size)
    if moved > coming[_SPARE]:
        coming[_TOP], coming[_USUAL] = _NONE, 2.0 * coming[_USUAL]
        return
    near, reach = coming[_NEAR] + moved, coming[_REACH] + moved
    visits, before = np.int64(coming[_USUAL] / _IN_TICKS) + 1, np.int64(coming[_COUNT])
    top, count, left, lost = walk(
        table, way[:, :3], way[:, 3], math.hypot(near, reach), reach,
        FLATTEST - (coming[_SPARE] + moved) / size, noted.stack[b], np.int64(coming[_TOP]), visits,
        noted.next_pairs[b], before, facing,
    )  # fmt: skip
    _measure(table, b, way, size, before, count, noted, facing)
    coming[_VISITS] += float(visits - left)
    coming[_TOP], coming[_COUNT] = float(top), float(count)
    if lost > 0:
        coming[_TIMES] *= 0.5
        coming[_TOP] = _NONE if coming[_TIMES] >= _NARROWEST else _TOO_MANY
    elif top == 0:
        for k in range(4):
            outer[k] = coming[k]
        for i in range(count):
            for k in range(2):
                noted.outer_pairs[b, i, k] = noted.next_pairs[b, i, k]
            noted.outer_beyond[b, i] = noted.next_beyond[b, i]
        _keep_way(noted.next_way[b], noted.outer_way[b])
        coming[_TOP], coming[_USUAL] = _NONE, coming[_VISITS]


@inner_kernel
def near_pairs(table: FacetTable, a, b, way, near, reach, size, speed, noted, facing):
    """Do what `facing_pairs` does, mostly from what was noted before.

    Pairs are those of facets that overlap by more than `-reach` and by less than `near`, and are
    not farther apart than `reach` sideways; few others.

    Parameters
    ----------
    way : (3, 4) array
        From A's frame to B's: rotation, and in the last column the shift.
    near, reach : float
        [m]
    size : float
        How far A's points are from its frame's origin at most [m].
    speed : float
        How far the tool has moved in the last tick [m].
    """
    holds, seen = noted.holds[b], facing.clock[0]
    turn, shift = way[:, :3], way[:, 3]
    moved = moved_since(noted.way[b], way, size)
    spare = min(_LEAST_SPARE + _TICKS * speed, _MOST_SPARE)
    if spare < 2.0 * speed:
        spare = 0.0  # nothing noted would hold
    if (
        holds[_COUNT] == _NONE
        or moved > holds[_SPARE]
        or near + moved > holds[_NEAR]
        or reach + moved > holds[_REACH]
    ):
        _note(table, a, b, way, near, reach, spare, size, noted, facing)
    if holds[_COUNT] == _TOO_MANY:
        return facing_pairs(
            table, a, b, turn, shift, math.hypot(near, reach), reach, FLATTEST, facing
        )
    if facing.clock[0] == seen:
        facing.clock[0] += 1
        facing.clock[1] = 0
        # In a tick in which nothing was noted.
        _go_on(table, a, b, way, near, reach, spare, size, noted, facing)
    count = np.int64(0)
    for i in range(int(holds[_COUNT])):
        f, g = noted.pairs[b, i, 0], noted.pairs[b, i, 1]
        if facing.stamp[f] != facing.clock[0]:
            turn_facet(table, f, turn, shift, facing)
        if cosine_of(table, f, g, facing) >= FLATTEST:
            facing.pairs[count, 0], facing.pairs[count, 1] = f, g
            count += 1
    return count
