"""What facets were near, and face each other: noted for some ticks, in two rings.

A tool moves little in a tick. So facets are looked for somewhat farther than they have to be, and
noted; what is noted holds until the tool has moved that far (Verlet, 1967, of molecules). The inner
ring is gone through in each tick. It is taken, every ten ticks or so, from the outer one, which
reaches several times as far; and while that still holds, the trees are gone through for the next
one, a few boxes in each tick, so that no tick has to wait for it.
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
    is_far,
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
_OUTER = 4.0
"""So many times as far facets of the outer ring are looked for."""
_OLD = 0.4
"""When so much of its spare is used up, the next outer ring is begun,"""
_IN_TICKS = 8.0
"""to be done after so many ticks, if it takes as many visits as the last."""
_FIRST_VISITS = 800.0

# Of `NotedFacets.holds` and `outer_holds`.
_NEAR, _REACH, _SPARE, _COUNT = 0, 1, 2, 3
_NONE, _TOO_MANY = -1.0, -2.0
# Of `NotedFacets.under_way`, which begins as those do.
_TOP, _VISITS, _USUAL = 4, 5, 6


class NotedFacets(NamedTuple):
    """What facets of a tool were near each body of the scene, and for how long that holds."""

    pairs: NDArray[np.int64]
    """(bodies, n, 2)"""
    holds: NDArray[np.float64]
    """For what depths, and how far sideways [m]; until the tool has moved so far [m]; how many
    there are, or why there are none. (bodies, 4)"""
    way: NDArray[np.float64]
    """From the tool's frame to the body's when they were noted, (bodies, 3, 4)."""
    outer_pairs: NDArray[np.int64]
    outer_holds: NDArray[np.float64]
    outer_way: NDArray[np.float64]
    next_pairs: NDArray[np.int64]
    under_way: NDArray[np.float64]
    """Of the next outer ring, as `holds`; how many pairs of boxes are still to be gone through, how
    many were, and how many were for the last one. (bodies, 7)"""
    next_way: NDArray[np.float64]
    stack: NDArray[np.int64]
    """Those pairs of boxes, (bodies, 512, 2)."""


def noted_facets(bodies: int) -> NotedFacets:
    """Return room for the facets near so many bodies; none are noted."""
    noted = NotedFacets(
        *ring(bodies, 4),
        *ring(bodies, 4),
        *ring(bodies, 7),
        stack=np.zeros((bodies, STACK, 2), np.int64),
    )
    note_nothing(noted)
    return noted


def ring(
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
    noted.under_way[:, _USUAL] = _FIRST_VISITS


@inner_kernel
def _beside_each_other(table: FacetTable, f, g, near, reach, facing):
    """Return whether a facet of A is beside g by more than `reach`, or out of g's [-reach, near].

    As seen along g's normal: one side of either has the other beyond it.
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
    if shallowest > near or deepest < -reach:
        return True
    wide_x, wide_y = table.half[g, 0] + reach, table.half[g, 1] + reach
    if low_x > wide_x or high_x < -wide_x or low_y > wide_y or high_y < -wide_y:
        return True
    for r in range(table.count_rows[g]):
        row = table.rows[g, r]
        least = np.inf
        for c in range(count):
            least = min(least, row[0] + row[1] * seen[c, 0] + row[2] * seen[c, 1])
        if least > reach:
            return True
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
            return True
    return False


@inner_kernel
def _keep_way(way, way_out):
    for i in range(3):
        for k in range(4):
            way_out[i, k] = way[i, k]


@inner_kernel
def _from_outer(table: FacetTable, b, way, near, reach, flattest, noted, facing):
    """Do what `facing_pairs` does, of the facets of the outer ring."""
    facing.clock[0] += 1
    facing.clock[1] = 0
    turn, shift, margin = way[:, :3], way[:, 3], math.hypot(near, reach)
    count = np.int64(0)
    for i in range(int(noted.outer_holds[b, _COUNT])):
        f, g = noted.outer_pairs[b, i, 0], noted.outer_pairs[b, i, 1]
        if facing.stamp[f] != facing.clock[0]:
            turn_facet(table, f, turn, shift, facing)
        faces = cosine_of(table, f, g, facing) >= flattest
        far = is_far(table, f, g, margin, reach, facing)
        facing.pairs[count, 0], facing.pairs[count, 1] = f, g
        count += np.int64(faces & ~far)
    return count


@inner_kernel
def _note(table: FacetTable, a, b, way, near, reach, spare, size, noted, facing):
    """Note the facets that `near_pairs` wants, and those that it may while A moves by `spare`."""
    near, reach, flattest = near + spare, reach + spare, FLATTEST - spare / size
    outer = noted.outer_holds[b]
    moved = moved_since(noted.outer_way[b], way, size)
    if (
        outer[_COUNT] >= 0.0
        and moved + spare <= outer[_SPARE]
        and near + moved <= outer[_NEAR]
        and reach + moved <= outer[_REACH]
    ):
        count = _from_outer(table, b, way, near, reach, flattest, noted, facing)
    else:
        # Sideways textures move points no farther than they rise.
        margin = math.hypot(near, reach)
        count = facing_pairs(table, a, b, way[:, :3], way[:, 3], margin, reach, flattest, facing)
    kept = np.int64(0)
    for i in range(count):
        f, g = facing.pairs[i, 0], facing.pairs[i, 1]
        if _beside_each_other(table, f, g, near, reach, facing):
            continue
        if kept < MAX_NOTED:
            noted.pairs[b, kept, 0], noted.pairs[b, kept, 1] = f, g
        kept += 1
    fits = kept <= MAX_NOTED and facing.clock[1] == 0
    holds = noted.holds[b]
    holds[_NEAR], holds[_REACH], holds[_SPARE] = near, reach, spare
    holds[_COUNT] = float(kept) if fits else _TOO_MANY
    _keep_way(way, noted.way[b])


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
        wide = _OUTER * spare
        coming[_NEAR], coming[_REACH], coming[_SPARE] = near + wide, reach + wide, wide
        coming[_COUNT], coming[_TOP], coming[_VISITS] = 0.0, 1.0, 0.0
        noted.stack[b, 0, 0], noted.stack[b, 0, 1] = table.root[a], table.root[b]
        _keep_way(way, noted.next_way[b])
    # What is looked for is what may be near while the tool is within the spare of where it was when
    # this began; seen from where it is now that is farther by how far it has moved since.
    moved = moved_since(noted.next_way[b], way, size)
    if moved > coming[_SPARE]:
        coming[_TOP] = _NONE
        return
    near, reach = coming[_NEAR] + moved, coming[_REACH] + moved
    visits = np.int64(coming[_USUAL] / _IN_TICKS) + 1
    top, count, left, lost = walk(
        table, way[:, :3], way[:, 3], math.hypot(near, reach), reach,
        FLATTEST - (coming[_SPARE] + moved) / size, noted.stack[b], np.int64(coming[_TOP]), visits,
        noted.next_pairs[b], np.int64(coming[_COUNT]), facing,
    )  # fmt: skip
    coming[_VISITS] += float(visits - left)
    coming[_TOP], coming[_COUNT] = float(top), float(count)
    if lost > 0:
        coming[_TOP] = _TOO_MANY
    elif top == 0:
        for k in range(4):
            outer[k] = coming[k]
        for i in range(count):
            for k in range(2):
                noted.outer_pairs[b, i, k] = noted.next_pairs[b, i, k]
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
