"""Which facets of two bodies face each other and are near, found anew or from tick to tick.

Boxes round the facets of each body, in trees, are gone through from the top: for two bodies of
seven hundred facets that visits some five thousand pairs of boxes. A tool moves little in a tick.
So facets are looked for somewhat farther than they have to be, and noted; what is noted holds
until the tool has moved that far (Verlet, 1967, of molecules).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.compiled import inner_kernel, small_kernel
from asperity.contact.chart import FLATTEST
from asperity.contact.facet_table import FacetTable
from asperity.stack import stack_array

MAX_FACINGS = 32768
MAX_NOTED = 8192
_STACK = 512

_TICKS = 10.0
"""For so many ticks of the present speed what is noted should hold,"""
_LEAST_SPARE, _MOST_SPARE = 2e-4, 1e-3
"""looked for this much farther at least, and at most [m]."""

# Of `NotedFacets.holds`.
_NEAR, _REACH, _SPARE, _COUNT = 0, 1, 2, 3
_NONE, _TOO_MANY = -1.0, -2.0


class Facing(NamedTuple):
    """The pairs of facets that face each other at one pose, and the room to find them."""

    pairs: NDArray[np.int64]
    """Of A, of B; (n, 2)."""
    stack: NDArray[np.int64]
    turned: NDArray[np.float64]
    """Corners of A's facets in B's frame, (facets, 8, 3)."""
    normals: NDArray[np.float64]
    """Of A's facets in B's frame: normal, middle, how far the corners are from it; (facets, 7)."""
    stamp: NDArray[np.int64]
    """When a facet was turned, (facets,)."""
    clock: NDArray[np.int64]
    """Counts the poses; and how often there was no room for all pairs at this one. (2,)"""


class NotedFacets(NamedTuple):
    """What facets of a tool were near each body of the scene, and for how long that holds."""

    pairs: NDArray[np.int32]
    """(bodies, n, 2)"""
    holds: NDArray[np.float64]
    """For what depths, and how far sideways [m]; until the tool has moved so far [m]; how many
    there are, or why there are none. (bodies, 4)"""
    way: NDArray[np.float64]
    """From the tool's frame to the body's when they were noted, (bodies, 3, 4)."""


def facing_space(facets: int) -> Facing:
    """Return room for the facing facets of bodies with so many facets in all."""
    return Facing(
        pairs=np.zeros((MAX_FACINGS, 2), np.int64),
        stack=np.zeros((_STACK, 2), np.int64),
        turned=np.zeros((facets, 8, 3)),
        normals=np.zeros((facets, 7)),
        stamp=np.zeros(facets, np.int64),
        clock=np.zeros(2, np.int64),
    )


def noted_facets(bodies: int) -> NotedFacets:
    """Return room for the facets near so many bodies; none are noted."""
    noted = NotedFacets(
        pairs=np.zeros((bodies, MAX_NOTED, 2), np.int32),
        holds=np.zeros((bodies, 4)),
        way=np.zeros((bodies, 3, 4)),
    )
    note_nothing(noted)
    return noted


def note_nothing(noted: NotedFacets) -> None:
    """Forget what facets were near."""
    noted.holds[:, _COUNT] = _NONE


@inner_kernel
def between_bodies(body_a, body_b, turn_out, shift_out):
    """Fill the way from A's frame to B's, (3, 3) and (3,), from their poses (3, 4)."""
    for i in range(3):
        shift_out[i] = 0.0
        for j in range(3):
            shift_out[i] += body_b[j, i] * (body_a[j, 3] - body_b[j, 3])
            turn_out[i, j] = 0.0
            for k in range(3):
                turn_out[i, j] += body_b[k, i] * body_a[k, j]


@inner_kernel
def moved_since(before, after, size):
    """Return how far a point within `size` of a body's origin has moved at most [m].

    `before` and `after` (3, 4) are its rotation and, in the last column, its origin's place.
    """
    turned = away = 0.0
    for i in range(3):
        away += (after[i, 3] - before[i, 3]) ** 2
        for k in range(3):
            turned += (after[i, k] - before[i, k]) ** 2
    return math.sqrt(away) + math.sqrt(turned) * size


@inner_kernel
def _turn_facet(table: FacetTable, f, turn, shift, facing):
    """Note a facet of A in B's frame."""
    facing.stamp[f] = facing.clock[0]
    for i in range(3):
        total, middle = 0.0, shift[i]
        for k in range(3):
            total += turn[i, k] * table.axes[f, 2, k]
            middle += turn[i, k] * table.origin[f, k]
        facing.normals[f, i], facing.normals[f, 3 + i] = total, middle
        for c in range(table.sides[f]):
            place = shift[i]
            for k in range(3):
                place += turn[i, k] * table.points[f, c, k]
            facing.turned[f, c, i] = place
    half_x, half_y = table.half[f, 0], table.half[f, 1]
    facing.normals[f, 6] = math.sqrt(half_x * half_x + half_y * half_y)


@small_kernel
def _far(table: FacetTable, f, g, near, beside, facing):
    """Return whether facets are farther apart than `near` [m], or `beside` sideways.

    By the middle of A's, whatever way it is turned; most are.
    """
    m, o = facing.normals[f], table.origin[g]
    x, y, z = table.axes[g, 0], table.axes[g, 1], table.axes[g, 2]
    d0, d1, d2 = m[3] - o[0], m[4] - o[1], m[5] - o[2]
    round_f = m[6] + beside
    off_x = abs(d0 * x[0] + d1 * x[1] + d2 * x[2]) > table.half[g, 0] + round_f
    off_y = abs(d0 * y[0] + d1 * y[1] + d2 * y[2]) > table.half[g, 1] + round_f
    off_z = abs(d0 * z[0] + d1 * z[1] + d2 * z[2]) > near + m[6]
    return off_x | off_y | off_z


@small_kernel
def _faces(table: FacetTable, f, g, facing):
    """Return the cosine between a facet of A and the one of B that it faces."""
    n, other = facing.normals[f], table.axes[g, 2]
    return -(n[0] * other[0] + n[1] * other[1] + n[2] * other[2])


@inner_kernel
def facing_pairs(table: FacetTable, a, b, turn, shift, margin, beside, flattest, facing):
    """Fill `facing.pairs` with facets of bodies a and b that are near and face each other.

    Parameters
    ----------
    a, b : int
        Numbers of the bodies.
    turn, shift : (3, 3), (3,) arrays
        From A's frame to B's.
    margin, beside : float
        How near [m]; sideways.
    flattest : float
        The least cosine between two that face each other.

    Returns
    -------
    int
        How many. Those that there is no room for are left out, and counted in `facing.clock[1]`.
    """
    facing.clock[0] += 1
    facing.clock[1] = 0
    stack = facing.stack
    size = stack_array((3, 3))
    for k in range(3):
        for m in range(3):
            size[k, m] = abs(turn[k, m])
    stack[0, 0], stack[0, 1] = table.root[a], table.root[b]
    top, count = np.int64(1), np.int64(0)
    while top > 0:
        top -= 1
        i, j = stack[top, 0], stack[top, 1]
        inner_a, inner_b = table.child[i] >= 0, table.child[j] >= 0
        if inner_a or inner_b:
            if top + 4 > _STACK:
                facing.clock[1] += 1
                continue
            # Without branches: which boxes are apart no processor can foretell.
            first_a, last_a = (table.child[i], table.child[i] + 2) if inner_a else (i, i + 1)
            first_b, last_b = (table.child[j], table.child[j] + 2) if inner_b else (j, j + 1)
            for c in range(first_a, last_a):
                m, h = table.middle[c], table.reach[c]
                x = shift[0] + turn[0, 0] * m[0] + turn[0, 1] * m[1] + turn[0, 2] * m[2]
                y = shift[1] + turn[1, 0] * m[0] + turn[1, 1] * m[1] + turn[1, 2] * m[2]
                z = shift[2] + turn[2, 0] * m[0] + turn[2, 1] * m[1] + turn[2, 2] * m[2]
                wide_x = size[0, 0] * h[0] + size[0, 1] * h[1] + size[0, 2] * h[2] + margin
                wide_y = size[1, 0] * h[0] + size[1, 1] * h[1] + size[1, 2] * h[2] + margin
                wide_z = size[2, 0] * h[0] + size[2, 1] * h[1] + size[2, 2] * h[2] + margin
                for d in range(first_b, last_b):
                    near_x = abs(x - table.middle[d, 0]) <= wide_x + table.reach[d, 0]
                    near_y = abs(y - table.middle[d, 1]) <= wide_y + table.reach[d, 1]
                    near_z = abs(z - table.middle[d, 2]) <= wide_z + table.reach[d, 2]
                    stack[top, 0], stack[top, 1] = c, d
                    top += np.int64(near_x & near_y & near_z)
            continue
        for f in range(table.first[i], table.last[i]):
            if facing.stamp[f] != facing.clock[0]:
                _turn_facet(table, f, turn, shift, facing)
            for g in range(table.first[j], table.last[j]):
                if count == MAX_FACINGS:
                    facing.clock[1] += 1
                    continue
                faces = _faces(table, f, g, facing) >= flattest
                far = _far(table, f, g, margin, beside, facing)
                facing.pairs[count, 0], facing.pairs[count, 1] = f, g
                count += np.int64(faces & ~far)
    return count


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
def _note(table: FacetTable, a, b, way, near, reach, spare, size, noted, facing):
    """Note the facets that `near_pairs` wants, and those that it may while A moves by `spare`."""
    # Sideways textures move points no farther than they rise.
    margin = math.hypot(near + spare, reach + spare)
    near, reach, flattest = near + spare, reach + spare, FLATTEST - spare / size
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
    for i in range(3):
        for k in range(4):
            noted.way[b, i, k] = way[i, k]


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
    if (
        holds[_COUNT] == _NONE
        or moved > holds[_SPARE]
        or near + moved > holds[_NEAR]
        or reach + moved > holds[_REACH]
    ):
        spare = min(_LEAST_SPARE + _TICKS * speed, _MOST_SPARE)
        if spare < 2.0 * speed:
            spare = 0.0  # nothing noted would hold
        _note(table, a, b, way, near, reach, spare, size, noted, facing)
    if holds[_COUNT] == _TOO_MANY:
        return facing_pairs(
            table, a, b, turn, shift, math.hypot(near, reach), reach, FLATTEST, facing
        )
    if facing.clock[0] == seen:
        facing.clock[0] += 1
        facing.clock[1] = 0
    count = np.int64(0)
    for i in range(int(holds[_COUNT])):
        f, g = np.int64(noted.pairs[b, i, 0]), np.int64(noted.pairs[b, i, 1])
        if facing.stamp[f] != facing.clock[0]:
            _turn_facet(table, f, turn, shift, facing)
        if _faces(table, f, g, facing) >= FLATTEST:
            facing.pairs[count, 0], facing.pairs[count, 1] = f, g
            count += 1
    return count
