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

import numpy as np

from asperity._core.kernels import inner_kernel
from asperity._core.stack import stack_array
from asperity.contact.broad_phase.facet_bvh import FacetTable
from asperity.contact.broad_phase.facet_pairs import (
    cosine_of,
    facing_pairs,
    far_by,
    moved_since,
    size_of,
    turn_facet,
    walk,
)
from asperity.contact.broad_phase.neighbour_records import (
    COUNT,
    MAX_NOTED,
    NEAR,
    NONE,
    REACH,
    SPARE,
    TIMES,
    TOO_MANY,
    TOP,
    USUAL,
    VISITS,
    keep_pair,
    keep_ring,
    keep_way,
)
from asperity.contact.narrow_phase.surface_patch import FLATTEST

_TICKS = 10.0
"""For so many ticks of the present speed what is noted should hold,"""
_LEAST_SPARE, _MOST_SPARE = 2e-4, 1e-3
"""looked for this much farther at least, and at most [m]."""
_NARROWEST = 2.0
"""Where there is no room for an outer ring the next one reaches half as many times as far; there is
none that would reach less than so many times as far as the inner one.
"""
_OLD = 0.55
"""When so much of its spare is used up, the next outer ring is begun,"""
_IN_TICKS = 4.0
"""to be done after so many ticks, if it takes as many visits as the last."""


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
def _take_from_outer(table: FacetTable, b, way, near, reach, flattest, size, noted, facing):
    """Note what is wanted of the facets of the outer ring; return how many."""
    facing.clock[0] += 1
    facing.clock[1] = 0
    turn, shift, travelled = way[:, :3], way[:, 3], noted.travelled[b]
    outer, kept = noted.outer, np.int64(0)
    for i in range(int(outer.holds[b, COUNT])):
        if travelled < outer.beyond[b, i]:
            continue
        f, g = outer.pairs[b, i, 0], outer.pairs[b, i, 1]
        if facing.stamp[f] != facing.clock[0]:
            turn_facet(table, f, turn, shift, facing)
        beyond = _beyond_by(table, f, g, near, reach, flattest, size, facing)
        outer.beyond[b, i] = travelled + max(beyond, 0.0)
        if beyond <= 0.0:
            kept = keep_pair(noted.inner.pairs, b, kept, f, g)
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
        if _apart_by(table, f, g, near, reach, facing) <= 0.0:
            kept = keep_pair(noted.inner.pairs, b, kept, f, g)
    return kept


@inner_kernel
def _note(table: FacetTable, a, b, way, near, reach, spare, size, noted, facing):
    """Note the facets that `near_pairs` wants, and those that it may while A moves by `spare`."""
    near, reach, flattest = near + spare, reach + spare, FLATTEST - spare / size
    holds, outer = noted.inner.holds[b], noted.outer.holds[b]
    # What was too far away by something may be near when the tool has moved by that, or when that
    # much farther ones are wanted.
    wider = max(near - holds[NEAR], reach - holds[REACH], spare - holds[SPARE], 0.0)
    noted.travelled[b] += moved_since(table, a, noted.inner.way[b], way) + wider
    holds[NEAR], holds[REACH], holds[SPARE] = near, reach, spare
    keep_way(way, noted.inner.way[b])
    moved = moved_since(table, a, noted.outer.way[b], way)
    if (
        outer[COUNT] >= 0.0
        and moved + spare <= outer[SPARE]
        and near + moved <= outer[NEAR]
        and reach + moved <= outer[REACH]
    ):
        kept = _take_from_outer(table, b, way, near, reach, flattest, size, noted, facing)
    else:
        kept = _take_from_all(table, a, b, way, near, reach, flattest, noted, facing)
    fits = kept <= MAX_NOTED and facing.clock[1] == 0
    holds[COUNT] = float(kept) if fits else TOO_MANY


@inner_kernel
def _measure(table: FacetTable, a, b, way, size, first, last, noted, facing):
    """Fill from when on pairs of the next outer ring may be wanted, as seen from here."""
    holds, pairs = noted.inner.holds[b], noted.coming.pairs
    # From here to wherever the next note is made is at most as far as from here back to where the
    # last one was, and from there to the next.
    travelled = noted.travelled[b] - moved_since(table, a, noted.inner.way[b], way)
    flattest = FLATTEST - holds[SPARE] / size
    for i in range(first, last):
        f, g = pairs[b, i, 0], pairs[b, i, 1]
        beyond = _beyond_by(table, f, g, holds[NEAR], holds[REACH], flattest, size, facing)
        noted.coming.beyond[b, i] = travelled + max(beyond, 0.0)


@inner_kernel
def _go_on(table: FacetTable, a, b, way, near, reach, spare, size, noted, facing):
    """Look at some boxes for the next outer ring, if the present one will not hold much longer."""
    outer, coming, progress = noted.outer.holds[b], noted.coming.holds[b], noted.progress[b]
    if progress[TOP] == TOO_MANY or spare == 0.0:
        return
    if progress[TOP] == NONE:
        moved = moved_since(table, a, noted.outer.way[b], way)
        if (
            outer[COUNT] >= 0.0
            and moved <= _OLD * outer[SPARE]
            and near + spare + moved <= outer[NEAR]
            and reach + spare + moved <= outer[REACH]
        ):
            return
        wide = progress[TIMES] * spare
        coming[NEAR], coming[REACH], coming[SPARE] = near + wide, reach + wide, wide
        coming[COUNT], progress[TOP], progress[VISITS] = 0.0, 1.0, 0.0
        noted.stack[b, 0, 0], noted.stack[b, 0, 1] = table.root[a], table.root[b]
        keep_way(way, noted.coming.way[b])
    # What is looked for is what may be near while the tool is within the spare of where it was when
    # this began; seen from where it is now that is farther by how far it has moved since.
    moved = moved_since(table, a, noted.coming.way[b], way)
    if moved > coming[SPARE]:
        progress[TOP], progress[USUAL] = NONE, 2.0 * progress[USUAL]
        return
    near, reach = coming[NEAR] + moved, coming[REACH] + moved
    visits, before = np.int64(progress[USUAL] / _IN_TICKS) + 1, np.int64(coming[COUNT])
    top, count, left, lost = walk(
        table, way[:, :3], way[:, 3], math.hypot(near, reach), reach,
        FLATTEST - (coming[SPARE] + moved) / size, noted.stack[b], np.int64(progress[TOP]),
        visits, noted.coming.pairs[b], before, facing,
    )  # fmt: skip
    _measure(table, a, b, way, size, before, count, noted, facing)
    progress[VISITS] += float(visits - left)
    progress[TOP], coming[COUNT] = float(top), float(count)
    if lost > 0:
        progress[TIMES] *= 0.5
        progress[TOP] = NONE if progress[TIMES] >= _NARROWEST else TOO_MANY
    elif top == 0:
        keep_ring(noted.coming, b, count, noted.outer)
        progress[TOP], progress[USUAL] = NONE, progress[VISITS]


@inner_kernel
def near_pairs(table: FacetTable, a, b, way, near, reach, speed, noted, facing):
    """Do what `facing_pairs` does, mostly from what was noted before.

    Pairs are those of facets that overlap by more than `-reach` and by less than `near`, and are
    not farther apart than `reach` sideways; few others.

    Parameters
    ----------
    way : (3, 4) array
        From A's frame to B's: rotation, and in the last column the shift.
    near, reach : float
        [m]
    speed : float
        How far the tool has moved in the last tick [m].
    """
    size = size_of(table, a)
    inner, holds, seen = noted.inner, noted.inner.holds[b], facing.clock[0]
    turn, shift = way[:, :3], way[:, 3]
    moved = moved_since(table, a, inner.way[b], way)
    spare = min(_LEAST_SPARE + _TICKS * speed, _MOST_SPARE)
    if spare < 2.0 * speed:
        spare = 0.0  # nothing noted would hold
    if (
        holds[COUNT] == NONE
        or moved > holds[SPARE]
        or near + moved > holds[NEAR]
        or reach + moved > holds[REACH]
    ):
        _note(table, a, b, way, near, reach, spare, size, noted, facing)
    if holds[COUNT] == TOO_MANY:
        return facing_pairs(
            table, a, b, turn, shift, math.hypot(near, reach), reach, FLATTEST, facing
        )
    if facing.clock[0] == seen:
        facing.clock[0] += 1
        facing.clock[1] = 0
        # In a tick in which nothing was noted.
        _go_on(table, a, b, way, near, reach, spare, size, noted, facing)
    count = np.int64(0)
    for i in range(int(holds[COUNT])):
        f, g = inner.pairs[b, i, 0], inner.pairs[b, i, 1]
        if facing.stamp[f] != facing.clock[0]:
            turn_facet(table, f, turn, shift, facing)
        if cosine_of(table, f, g, facing) >= FLATTEST:
            facing.pairs[count, 0], facing.pairs[count, 1] = f, g
            count += 1
    return count
