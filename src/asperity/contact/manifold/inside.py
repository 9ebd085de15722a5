"""A ray test of whether the overlap of two facets is one of the bodies.

A facet of A may lie behind a facet of B though the bodies are apart, across a cavity or a thin
wall; or they overlap, but the tool leaves sooner by the other side of a wall. Along a ray from one
facet to the other, the thicknesses of A and B behind their facets must together cover the distance
between the facets, and more.
"""

from __future__ import annotations

import numpy as np

from asperity._core.kernels import inner_kernel, kernel, small_kernel
from asperity._core.stack import stack_array
from asperity.contact.broad_phase.facet_bvh import FacetTable
from asperity.contact.broad_phase.facet_pairs import (
    MAX_FACET_PAIRS,
    BvhTraversal,
    half_diagonal,
    pair_limits,
    traverse_bvh,
)
from asperity.contact.manifold.overlap_region import clip_pair, overlap_region
from asperity.contact.response.ways_out import RATIO
from asperity.geometry.frames import to_body, to_world

_LEAST = 1e-9
"""Smallest cosine between ray and facet normal, and least distance from the ray's start [m]."""
_TOWARDS_MIDDLE = 0.0137
"""Fraction by which a tested corner is moved towards the middle of its piece, off any edge."""
_MAX_CROSSINGS = 32
WALL = 0.05
"""Thickness over half the diagonal of a body, from which behind a facet is no thin wall."""
_COVERED = 1.0 + 1.0 / RATIO
"""Part of the distance between two facets that the thicknesses of the bodies must cover.

Below, the bodies are free sooner the other way along the ray, by more than `RATIO`.
"""
_FACING = 0.05
"""Least cosine between the normals of the two sides of a wall, one of them reversed."""
_PAIRS_PER_FACET = 32
"""Room for pairs of sides. If it or the visits are used up, all walls count as thin."""
_VISITS = 100_000_000


@inner_kernel
def _crossing(table: FacetTable, g, start, along, length):
    """Return where a ray crosses facet `g` [m], inf if nowhere, and whether it leaves the body.

    The ray goes from `start` (3,) along a unit vector (3,), both in the body's frame, for `length`
    [m].
    """
    o, x, y, z = table.origin[g], table.axes[g, 0], table.axes[g, 1], table.axes[g, 2]
    cosine = along[0] * z[0] + along[1] * z[1] + along[2] * z[2]
    if abs(cosine) < _LEAST:
        return np.inf, False
    t = ((o[0] - start[0]) * z[0] + (o[1] - start[1]) * z[1] + (o[2] - start[2]) * z[2]) / cosine
    if t < _LEAST or t > length:
        return np.inf, False
    a = b = 0.0
    for k in range(3):
        off = start[k] + t * along[k] - o[k]
        a, b = a + off * x[k], b + off * y[k]
    if abs(a) > table.half[g, 0] or abs(b) > table.half[g, 1]:
        return np.inf, False
    for r in range(table.count_rows[g]):
        row = table.rows[g, r]
        if row[0] + row[1] * a + row[2] * b > 0.0:
            return np.inf, False
    return t, cosine > 0.0


@small_kernel
def _meets_box(table: FacetTable, node, start, along, length):
    """Return whether a ray, see `_crossing`, meets a box of the tree; by separating axes."""
    reach, half = table.reach[node], 0.5 * length
    x, y, z = half * along[0], half * along[1], half * along[2]
    off_x = start[0] + x - table.middle[node, 0]
    off_y = start[1] + y - table.middle[node, 1]
    off_z = start[2] + z - table.middle[node, 2]
    if (
        abs(off_x) > reach[0] + abs(x)
        or abs(off_y) > reach[1] + abs(y)
        or abs(off_z) > reach[2] + abs(z)
    ):
        return False
    x_y, y_z, z_x = y * off_x - x * off_y, z * off_y - y * off_z, x * off_z - z * off_x
    return (
        abs(x_y) <= reach[0] * abs(y) + reach[1] * abs(x) + _LEAST * half
        and abs(y_z) <= reach[1] * abs(z) + reach[2] * abs(y) + _LEAST * half
        and abs(z_x) <= reach[2] * abs(x) + reach[0] * abs(z) + _LEAST * half
    )


@inner_kernel
def _thickness(table: FacetTable, body, start, along, length, stack):
    """Return the thickness of a body along a ray from its surface inwards, at most `length` [m].

    See `_crossing`. Overlapping or touching parts of a body are one.
    """
    at, count, top = stack_array((2, _MAX_CROSSINGS)), 0, 1
    stack[0, 0] = table.root[body]
    while top > 0:
        top -= 1
        node = stack[top, 0]
        if not _meets_box(table, node, start, along, length):
            continue
        if table.child[node] >= 0:
            stack[top, 0], stack[top + 1, 0] = table.child[node], table.child[node] + 1
            top += 2
            continue
        for g in range(table.first[node], table.last[node]):
            t, leaves = _crossing(table, g, start, along, length)
            if t == np.inf:
                continue
            if count == _MAX_CROSSINGS:
                return length
            # Sorted, so that a touching part begins before the previous one ends.
            t, layer = (t, -1.0) if leaves else (t - _LEAST, 1.0)
            i = count
            while i > 0 and at[0, i - 1] > t:
                at[0, i], at[1, i] = at[0, i - 1], at[1, i - 1]
                i -= 1
            at[0, i], at[1, i] = t, layer
            count += 1
    layers = 1.0
    for i in range(count):
        layers += at[1, i]
        if layers <= 0.0:
            return at[0, i]
    return length


def with_thickness(table: FacetTable) -> FacetTable:
    """Return a facet table in which the thickness of the bodies behind their facets is filled."""
    if table.is_convex.all():
        return table
    region = overlap_region(len(table.body))
    for body in np.flatnonzero(~table.is_convex):
        count = int((table.body == body).sum())
        pairs = np.zeros((_PAIRS_PER_FACET * count + MAX_FACET_PAIRS, 2), np.int64)
        traversal = BvhTraversal(region.facets.stack, 1, pairs, 0)
        if not _fill_thickness(table, int(body), traversal, region):
            table.thickness[table.body == body] = 0.0
    return table


@kernel
def _fill_thickness(table, body, traversal, region):
    """Fill the thickness behind a body's facets; return whether there was room for all pairs.

    A facet that overlaps another one of the same body, in the sense of `clip_pair`, is the
    other side of a wall.
    """
    transform, facets = stack_array((3, 4)), region.facets
    thickest = WALL * half_diagonal(table, body)
    for k in range(3):
        for m in range(4):
            transform[k, m] = 1.0 if k == m else 0.0
    facets.state[0].tick += 1
    traversal.stack[0, 0], traversal.stack[0, 1] = table.root[body], table.root[body]
    limits = pair_limits(thickest, 0.0, _FACING)
    _, count, visits, dropped = traverse_bvh(table, transform, limits, traversal, _VISITS, facets)
    for i in range(count):
        f, g = traversal.pairs[i, 0], traversal.pairs[i, 1]
        here, corners = clip_pair(table, f, g, 0.0, 0.0, thickest, region)
        for c in range(corners):
            thickness = region.polygon[here, c, 2]
            table.thickness[g] = min(table.thickness[g], thickness)
    return dropped == 0 and visits > 0


@inner_kernel
def _overlaps(table: FacetTable, f, g, place, query, stack):
    """Return whether A behind facet `f` and B behind `g` overlap at the point x, y, d on `g`."""
    o, x, y, z = table.origin[g], table.axes[g, 0], table.axes[g, 1], table.axes[g, 2]
    on_b, down, on_a, up = (
        stack_array((3,)), stack_array((3,)), stack_array((3,)), stack_array((3,)),
    )  # fmt: skip
    for k in range(3):
        on_b[k] = o[k] + place[0] * x[k] + place[1] * y[k]
        down[k] = -z[k]
    length = _COVERED * place[2]
    apart = length - _thickness(table, table.body[g], on_b, down, length, stack)
    if apart <= 0.0:
        return True
    world, normal = stack_array((3,)), stack_array((3,))
    for k in range(3):
        on_a[k] = on_b[k] + place[2] * down[k]
    to_world(query.frame_b, on_a, world)
    to_world(query.frame_b, z, normal)
    for k in range(3):
        world[k] += query.frame_b[k, 3] - query.frame_a[k, 3]
    to_body(query.frame_a, world, on_a)
    to_body(query.frame_a, normal, up)
    return _thickness(table, table.body[f], on_a, up, apart, stack) >= apart


@inner_kernel
def is_across_cavity(table: FacetTable, f, g, piece, query, region):
    """Return whether facet `f` of A lies behind facet `g` of B without an overlap of the bodies.

    This is false for a piece that reaches the facet. Else its deepest corner and its middle are
    tested.

    Parameters
    ----------
    piece : tuple of int
        See `overlap_region.clip_pair`.
    query : BodyQuery
    region : OverlapRegion
    """
    here, count = piece
    x = y = d = 0.0
    deepest = 0
    for i in range(count):
        corner = region.polygon[here, i]
        if corner[2] <= _LEAST:
            return False
        if corner[2] > region.polygon[here, deepest, 2]:
            deepest = i
        x, y, d = x + corner[0] / count, y + corner[1] / count, d + corner[2] / count
    corner, part = region.polygon[here, deepest], _TOWARDS_MIDDLE
    place = (
        corner[0] + part * (x - corner[0]),
        corner[1] + part * (y - corner[1]),
        corner[2] + part * (d - corner[2]),
    )
    stack = region.facets.stack
    if _overlaps(table, f, g, place, query, stack):
        return False
    return not _overlaps(table, f, g, (x, y, d), query, stack)
