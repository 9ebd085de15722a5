"""Which facets of two bodies face each other and are near.

Boxes round the facets of each body, in trees, are gone through from the top: for two bodies of
seven hundred facets that visits some five thousand pairs of boxes. So what is found is noted for
some ticks: `noted_facets`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, small_kernel
from asperity._core.stack import stack_array
from asperity.contact.broad_phase.facet_bvh import FacetTable

MAX_FACINGS = 32768
_ALL = np.int64(1) << 40
STACK = 512
"""Pairs of boxes that a walk may have before it."""


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


def facing_space(facets: int) -> Facing:
    """Return room for the facing facets of bodies with so many facets in all."""
    return Facing(
        pairs=np.zeros((MAX_FACINGS, 2), np.int64),
        stack=np.zeros((STACK, 2), np.int64),
        turned=np.zeros((facets, 8, 3)),
        normals=np.zeros((facets, 7)),
        stamp=np.zeros(facets, np.int64),
        clock=np.zeros(2, np.int64),
    )


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
def size_of(table: FacetTable, a):
    """Return half the diagonal of the box round a body [m]."""
    reach = table.reach[table.root[a]]
    return math.sqrt(reach[0] * reach[0] + reach[1] * reach[1] + reach[2] * reach[2])


@inner_kernel
def moved_since(table: FacetTable, a, before, after):
    """Return how far a point of body `a` has moved at most [m].

    `before` and `after` (3, 4) are its rotation and, in the last column, its origin's place. No
    corner of the box round it has moved farther. And it is no less than what `size_of` makes of
    the turn: a direction fixed in the body has changed by at most this over that size.
    """
    middle, reach = table.middle[table.root[a]], table.reach[table.root[a]]
    turned = farthest = 0.0
    for i in range(3):
        for k in range(3):
            turned += (after[i, k] - before[i, k]) ** 2
    for corner in range(8):
        square = 0.0
        for i in range(3):
            away = after[i, 3] - before[i, 3]
            for k in range(3):
                place = middle[k] + (reach[k] if corner >> k & 1 else -reach[k])
                away += (after[i, k] - before[i, k]) * place
            square += away * away
        farthest = max(farthest, square)
    # Half the sum of squares is the square of the chord, of whatever is turned most.
    return max(math.sqrt(farthest), math.sqrt(0.5 * turned) * size_of(table, a))


@inner_kernel
def turn_facet(table: FacetTable, f, turn, shift, facing):
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
def far_by(table: FacetTable, f, g, near, beside, facing):
    """Return by how much facets are farther apart than `near` [m], or `beside` sideways.

    By the middle of A's, whatever way it is turned; most are. 0 or less if they may be near.
    """
    m, o = facing.normals[f], table.origin[g]
    x, y, z = table.axes[g, 0], table.axes[g, 1], table.axes[g, 2]
    d0, d1, d2 = m[3] - o[0], m[4] - o[1], m[5] - o[2]
    round_f = m[6] + beside
    off_x = abs(d0 * x[0] + d1 * x[1] + d2 * x[2]) - (table.half[g, 0] + round_f)
    off_y = abs(d0 * y[0] + d1 * y[1] + d2 * y[2]) - (table.half[g, 1] + round_f)
    off_z = abs(d0 * z[0] + d1 * z[1] + d2 * z[2]) - (near + m[6])
    return max(off_x, off_y, off_z)


@small_kernel
def cosine_of(table: FacetTable, f, g, facing):
    """Return the cosine between a facet of A and the one of B that it faces."""
    n, other = facing.normals[f], table.axes[g, 2]
    return -(n[0] * other[0] + n[1] * other[1] + n[2] * other[2])


@inner_kernel
def walk(
    table: FacetTable, turn, shift, margin, beside, flattest, stack, top, visits, pairs_io, count,
    facing,
):  # fmt: skip
    """Go through pairs of boxes from the top of a stack; add facets that are near and face.

    Parameters
    ----------
    turn, shift : (3, 3), (3,) arrays
        From A's frame to B's.
    margin, beside : float
        How near [m]; sideways.
    flattest : float
        The least cosine between two that face each other.
    stack : (512, 2) array
        Pairs of boxes, of which there are `top`.
    visits : int
        After so many pairs of boxes it ends, and may go on another time.
    pairs_io : (n, 2) array
        Facets of A, of B; there are `count`.

    Returns
    -------
    int, int, int, int
        How many pairs of boxes and of facets there are now, of how many visits nothing has come,
        and how often there was no room.
    """
    lost = np.int64(0)
    size = stack_array((3, 3))
    for k in range(3):
        for m in range(3):
            size[k, m] = abs(turn[k, m])
    while top > 0 and visits > 0:
        top -= 1
        visits -= 1
        i, j = stack[top, 0], stack[top, 1]
        inner_a, inner_b = table.child[i] >= 0, table.child[j] >= 0
        if inner_a or inner_b:
            if top + 4 > STACK:
                lost += 1
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
                turn_facet(table, f, turn, shift, facing)
            for g in range(table.first[j], table.last[j]):
                if count == pairs_io.shape[0]:
                    lost += 1
                    continue
                faces = cosine_of(table, f, g, facing) >= flattest
                far = far_by(table, f, g, margin, beside, facing) > 0.0
                pairs_io[count, 0], pairs_io[count, 1] = f, g
                count += np.int64(faces & ~far)
    return top, count, visits, lost


@inner_kernel
def facing_pairs(table: FacetTable, a, b, turn, shift, margin, beside, flattest, facing):
    """Fill `facing.pairs` with facets of bodies a and b that are near and face each other.

    `a`, `b` are the numbers of the bodies; for the others see `walk`. Returns how many pairs there
    are. Those that there is no room for are left out, and counted in `facing.clock[1]`.
    """
    facing.clock[0] += 1
    facing.stack[0, 0], facing.stack[0, 1] = table.root[a], table.root[b]
    _, count, _, lost = walk(
        table, turn, shift, margin, beside, flattest, facing.stack, np.int64(1), _ALL,
        facing.pairs, np.int64(0), facing,
    )  # fmt: skip
    facing.clock[1] = lost
    return count
