"""Pairs of facets of two bodies that face each other and may overlap.

A simultaneous traversal of both bodies' bounding volume hierarchies finds them. It visits about
5000 pairs of boxes for two bodies of 700 facets, so its result is kept over several ticks: see
`neighbour_list`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, small_kernel
from asperity._core.stack import stack_array
from asperity._core.structures import by_reference
from asperity.contact.broad_phase.facet_bvh import FacetTable
from asperity.contact.narrow_phase.steep_plane import STEEPEST

MAX_FACET_PAIRS = 32768
LEAST_COSINE = 0.01
"""Smallest cosine to n, and to each other, of facets that overlap."""
_LEAST_LISTED = -0.5
"""Smallest cosine to each other of facets of two convex bodies that are listed."""
STACK = 512
"""Maximum number of pairs of boxes on the stack of a traversal."""
_UNLIMITED = np.int64(1) << 40

PLACED_FACET = np.dtype(
    [
        ("normal", "f8", 3),  # unit normal
        ("centre", "f8", 3),  # centre of its bounding rectangle [m]
        ("radius", "f8"),  # largest distance of a corner from the centre [m]
        ("tick", "i8"),  # `SEARCH_STATE.tick` at which the facet was transformed
    ],
    align=True,
)
"""A facet of body A in B's frame."""

SEARCH_STATE = np.dtype(
    [
        ("tick", "i8"),  # counts the relative poses for which facets were transformed
        ("dropped", "i8"),  # pairs of the last search dropped for lack of room
    ],
    align=True,
)


@by_reference
class FacetPairs(NamedTuple):
    """Facet pairs of bodies A and B at one relative pose, and scratch memory to find them."""

    pairs: NDArray[np.int64]
    """Facet of A, facet of B; (MAX_FACET_PAIRS, 2)."""
    stack: NDArray[np.int64]
    """Pairs of boxes still to be visited, (STACK, 2)."""
    corners: NDArray[np.float64]
    """Corners of A's facets in B's frame [m], (facets, 8, 3)."""
    placed: NDArray[np.void]
    """A's facets in B's frame, `PLACED_FACET` records (facets,)."""
    state: NDArray[np.void]
    """One `SEARCH_STATE` record, (1,)."""


class PairLimits(NamedTuple):
    """Limits on the pairs of facets to find."""

    max_depth: float
    """Largest smooth overlap [m]."""
    reach: float
    """Largest distance of facets that do not overlap, along B's normal and in its plane [m]."""
    margin: float
    """Largest distance between the bounding boxes of facets [m]."""
    min_cosine: float
    """Smallest cosine of the angle between A's normal and minus B's."""


class BvhTraversal(NamedTuple):
    """A simultaneous traversal of two BVHs that can be interrupted and resumed."""

    stack: NDArray[np.int64]
    """Pairs of boxes still to be visited, (STACK, 2)."""
    stack_size: int
    """Number of them."""
    pairs: NDArray[np.int64]
    """Pairs of facets found, (n, 2)."""
    pair_count: int
    """Number of them."""


def facet_pairs(facets: int) -> FacetPairs:
    """Allocate memory for the facet pairs of bodies with `facets` facets in all."""
    return FacetPairs(
        pairs=np.zeros((MAX_FACET_PAIRS, 2), np.int64),
        stack=np.zeros((STACK, 2), np.int64),
        corners=np.zeros((facets, 8, 3)),
        placed=np.zeros(facets, PLACED_FACET),
        state=np.zeros(1, SEARCH_STATE),
    )


@small_kernel
def pair_limits(max_depth, reach, min_cosine):
    """Return the limits for pairs that overlap by less than `max_depth`; see `PairLimits`."""
    # Textures displace points sideways by no more than their height.
    return PairLimits(max_depth, reach, math.hypot(max_depth, reach), min_cosine)


@inner_kernel
def relative_transform(body_a, body_b, transform_out):
    """Fill the rotation and translation (3, 4) from A's frame to B's, from the poses (3, 4)."""
    for i in range(3):
        transform_out[i, 3] = 0.0
        for j in range(3):
            transform_out[i, 3] += body_b[j, i] * (body_a[j, 3] - body_b[j, 3])
            transform_out[i, j] = 0.0
            for k in range(3):
                transform_out[i, j] += body_b[k, i] * body_a[k, j]


@small_kernel
def are_convex(table: FacetTable, a, b):
    """Return whether two bodies are convex."""
    return table.is_convex[a] and table.is_convex[b]


@small_kernel
def flattest(table: FacetTable, a, b):
    """Return the least cosine to n of smooth facets of two bodies that are searched.

    Facets of convex bodies may be steep: the tip of a needle has no others. In a cavity a steep
    facet may be behind the opposite wall.
    """
    return LEAST_COSINE if are_convex(table, a, b) else STEEPEST


@small_kernel
def least_cosine(table: FacetTable, a, b):
    """Return the least cosine between facets of two bodies that are listed.

    Round edges and corners of convex bodies facets are searched that face n, but not each other.
    """
    return _LEAST_LISTED if are_convex(table, a, b) else STEEPEST


@inner_kernel
def half_diagonal(table: FacetTable, a):
    """Return half the diagonal of the bounding box of body `a` [m]."""
    reach = table.reach[table.root[a]]
    return math.sqrt(reach[0] * reach[0] + reach[1] * reach[1] + reach[2] * reach[2])


@inner_kernel
def largest_displacement(table: FacetTable, a, before, after):
    """Return an upper bound of the distance that any point of body `a` has moved [m].

    It is the largest displacement of a corner of the body's bounding box, and at least the chord
    of the rotation times `half_diagonal`. So a direction fixed in the body has changed by at most
    the returned distance over `half_diagonal`.

    Parameters
    ----------
    before, after : (3, 4) arrays
        The body's rotation and, in the last column, its position [m].
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
    # Half the squared Frobenius norm is the largest squared chord of a rotated unit vector.
    return max(math.sqrt(farthest), math.sqrt(0.5 * turned) * half_diagonal(table, a))


@inner_kernel
def place_facet(table: FacetTable, f, transform, facets):
    """Transform facet `f` of A to B's frame."""
    placed = facets.placed[f]
    placed.tick = facets.state[0].tick
    for i in range(3):
        total, middle = 0.0, transform[i, 3]
        for k in range(3):
            total += transform[i, k] * table.axes[f, 2, k]
            middle += transform[i, k] * table.origin[f, k]
        placed.normal[i], placed.centre[i] = total, middle
        for c in range(table.sides[f]):
            place = transform[i, 3]
            for k in range(3):
                place += transform[i, k] * table.points[f, c, k]
            facets.corners[f, c, i] = place
    half_x, half_y = table.half[f, 0], table.half[f, 1]
    placed.radius = math.sqrt(half_x * half_x + half_y * half_y)


@small_kernel
def sphere_separation(table: FacetTable, f, g, limits, facets):
    """Return a lower bound of the motion until a pair is within `limits` [m], from A's sphere.

    If it is 0 or less, the pair may be within them. The bounding sphere of A's facet, whatever its
    orientation, rejects most pairs.
    """
    c, o = facets.placed[f].centre, table.origin[g]
    radius = facets.placed[f].radius
    x, y, z = table.axes[g, 0], table.axes[g, 1], table.axes[g, 2]
    d0, d1, d2 = c[0] - o[0], c[1] - o[1], c[2] - o[2]
    beside = radius + limits.reach
    off_x = abs(d0 * x[0] + d1 * x[1] + d2 * x[2]) - (table.half[g, 0] + beside)
    off_y = abs(d0 * y[0] + d1 * y[1] + d2 * y[2]) - (table.half[g, 1] + beside)
    off_z = abs(d0 * z[0] + d1 * z[1] + d2 * z[2]) - (limits.margin + radius)
    return max(off_x, off_y, off_z)


@small_kernel
def facing_cosine(table: FacetTable, f, g, facets):
    """Return the cosine of the angle between A's normal and minus B's."""
    n, other = facets.placed[f].normal, table.axes[g, 2]
    return -(n[0] * other[0] + n[1] * other[1] + n[2] * other[2])


@inner_kernel
def traverse_bvh(table: FacetTable, transform, limits, traversal, visits, facets):
    """Visit pairs of boxes from the top of the stack; append pairs of facets within `limits`.

    Parameters
    ----------
    transform : (3, 4) array
        From A's frame to B's.
    limits : PairLimits
    traversal : BvhTraversal
        Its arrays are changed.
    visits : int
        Interrupt the traversal after this many pairs of boxes.

    Returns
    -------
    stack_size, count : int
        Number of pairs of boxes, and of facets, in `traversal` now.
    visits : int
        Number of visits not used.
    dropped : int
        Number of pairs dropped for lack of room.
    """
    stack, top, pairs, count = (
        traversal.stack, traversal.stack_size, traversal.pairs, traversal.pair_count,
    )  # fmt: skip
    margin = limits.margin
    dropped = np.int64(0)
    size = stack_array((3, 3))
    for k in range(3):
        for m in range(3):
            size[k, m] = abs(transform[k, m])
    while top > 0 and visits > 0:
        top -= 1
        visits -= 1
        i, j = stack[top, 0], stack[top, 1]
        inner_a, inner_b = table.child[i] >= 0, table.child[j] >= 0
        if inner_a or inner_b:
            if top + 4 > STACK:
                dropped += 1
                continue
            # Branchless, since the branch predictor cannot know which boxes overlap.
            first_a, last_a = (table.child[i], table.child[i] + 2) if inner_a else (i, i + 1)
            first_b, last_b = (table.child[j], table.child[j] + 2) if inner_b else (j, j + 1)
            for c in range(first_a, last_a):
                m, h, t = table.middle[c], table.reach[c], transform
                x = t[0, 3] + t[0, 0] * m[0] + t[0, 1] * m[1] + t[0, 2] * m[2]
                y = t[1, 3] + t[1, 0] * m[0] + t[1, 1] * m[1] + t[1, 2] * m[2]
                z = t[2, 3] + t[2, 0] * m[0] + t[2, 1] * m[1] + t[2, 2] * m[2]
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
            if facets.placed[f].tick != facets.state[0].tick:
                place_facet(table, f, transform, facets)
            for g in range(table.first[j], table.last[j]):
                if count == pairs.shape[0]:
                    dropped += 1
                    continue
                faces = facing_cosine(table, f, g, facets) >= limits.min_cosine
                far = sphere_separation(table, f, g, limits, facets) > 0.0
                pairs[count, 0], pairs[count, 1] = f, g
                count += np.int64(faces & ~far)
    return top, count, visits, dropped


@inner_kernel
def overlapping_facet_pairs(table, a, b, transform, limits, facets):
    """Fill `facets.pairs` with the facets of bodies `a` and `b` that may be within `limits`.

    Returns their number. Pairs without room are dropped and counted in `facets.state[0].dropped`.
    """
    facets.state[0].tick += 1
    facets.stack[0, 0], facets.stack[0, 1] = table.root[a], table.root[b]
    start = BvhTraversal(facets.stack, np.int64(1), facets.pairs, np.int64(0))
    _, count, _, dropped = traverse_bvh(table, transform, limits, start, _UNLIMITED, facets)
    facets.state[0].dropped = dropped
    return count
