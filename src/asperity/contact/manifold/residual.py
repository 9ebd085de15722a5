"""The part of one direction's overlap that remains after the tool has left by another.

Both sides of a convex edge see the same overlap, so that leaving by one side resolves the other.
The walls of a groove are two contacts, and both have to be left. The two cases differ in where the
overlap seen from direction d lies relative to the plane of direction c, which is normal to c's mean
normal through the centroid of its region. Leaving by c resolves the part of d where

- B's surface lies *behind* the plane of c, so that B is convex there, and
- A's surface lies *within* reach of it: no deeper behind the plane than the tool is moved.

The *residual* rises smoothly from 0 to 1 with the fraction of the region's volume that is not
resolved.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import clear, inner_kernel
from asperity._core.stack import stack_array
from asperity._core.structures import by_reference
from asperity.contact.broad_phase.facet_bvh import DIRECTIONS
from asperity.contact.broad_phase.facet_pairs import are_convex
from asperity.contact.manifold.overlap_region import (
    BEHIND,
    WITHIN,
    clip_piece,
    clip_polygon,
    piece_volume,
)
from asperity.contact.manifold.region_gradient import add_piece_gradient
from asperity.contact.manifold.separation import smooth_step, smooth_step_slope
from asperity.contact.response.contact_forces import add_at_point

_RESOLVED, _REMAINS = 0.25, 0.75
"""Unresolved fractions of the volume between which a residual rises from 0 to 1."""
_REACH = 1.25
"""Depth behind the plane within which A's surface is resolved, over the overlap along c including
textures."""

_COPLANAR = 1e-3
"""Fraction of that depth by which a facet may lie before the plane, to include coplanar facets."""


@by_reference
class Residuals(NamedTuple):
    """How much of each direction remains after the tool has left by another."""

    value: NDArray[np.float64]
    """Residual of the direction of the row, given that of the column; nan if unknown; (6, 6)."""
    slope: NDArray[np.float64]
    """Its derivative by the resolved fraction of the volume, (6, 6)."""
    rate: NDArray[np.float64]
    """Derivative of the way out by the residual [m], (6, 6)."""


class Leaving(NamedTuple):
    """The plane of the direction that the tool leaves by, B's frame."""

    place: NDArray[np.float64]
    """Centroid of its region, (3,) [m]."""
    normal: NDArray[np.float64]
    """(3,)"""
    depth: float
    """Depth behind the plane within which A's surface is resolved [m]."""


def residuals() -> Residuals:
    """Allocate memory for the residuals of one body."""
    return Residuals(*(np.zeros((DIRECTIONS, DIRECTIONS)) for _ in range(3)))


@inner_kernel
def _fill_plane(sums, reach, place_out):
    """Fill `place` (3,) of a `Leaving`; return its `depth` [m]."""
    for k in range(3):
        place_out[k] = sums.first_moment[k] / sums.volume
    return _REACH * (sums.deepest + reach)


@inner_kernel
def _clip_resolved(table, pair, query, leaving, region):
    """Clip a piece to the part that is resolved; return its buffer and its number of corners."""
    f, g = pair
    polygon, (here, count) = region.polygon, clip_piece(table, query, f, g, region)
    if count < 3:
        return here, count
    o, x, y, z = table.origin[g], table.axes[g, 0], table.axes[g, 1], table.axes[g, 2]
    n = leaving.normal
    above = along_x = along_y = along_z = 0.0
    for k in range(3):
        above += n[k] * (o[k] - leaving.place[k])
        along_x, along_y, along_z = (
            along_x + n[k] * x[k],
            along_y + n[k] * y[k],
            along_z + n[k] * z[k],
        )
    if count >= 3:
        behind = (above - _COPLANAR * leaving.depth, along_x, along_y, 0.0)
        here, count = clip_polygon(polygon, here, count, behind, BEHIND)
    if count >= 3:
        within = (-above - leaving.depth, -along_x, -along_y, along_z)
        here, count = clip_polygon(polygon, here, count, within, WITHIN)
    return here, count


@inner_kernel
def _height_range(leaving, middle, radius, corners, count, level):
    """Return bounds on the height of a facet above the plane [m].

    They are those of its bounding circle, unless that straddles `level`.
    """
    n, place = leaving.normal, leaving.place
    above = n[0] * (middle[0] - place[0]) + n[1] * (middle[1] - place[1])
    above += n[2] * (middle[2] - place[2])
    low, high = above - radius, above + radius
    if low < level and high > level:
        low, high = np.inf, -np.inf
        for i in range(count):
            p = corners[i]
            above = n[0] * (p[0] - place[0]) + n[1] * (p[1] - place[1]) + n[2] * (p[2] - place[2])
            low, high = min(low, above), max(high, above)
    return low, high


@inner_kernel
def _classify_pair(table, f, g, leaving, region):
    """Return 1 or 0 where all or nothing of a pair's overlap is resolved, -1 if it is clipped."""
    edge, deep, half = _COPLANAR * leaving.depth, -leaving.depth, table.half[g]
    low, high = _height_range(
        leaving, table.origin[g], half[0] + half[1], table.points[g], table.sides[g], edge
    )
    if low >= edge:
        return 0
    is_behind, facet = high <= edge, region.facets.placed[f]
    low, high = _height_range(
        leaving, facet.centre, facet.radius, region.facets.corners[f], table.sides[f], deep
    )
    if high <= deep:
        return 0
    return 1 if is_behind and low >= deep else -1


@inner_kernel
def fill_residuals(table, query, count, c, space):
    """Fill the residuals of all directions after the tool has left by direction `c`.

    `count` is the number of facet pairs, `query` the `BodyQuery`.
    """
    region, found = space.region, space.residuals
    if are_convex(table, query.first, query.second):
        for d in range(DIRECTIONS):
            found.value[d, c] = 0.0  # each direction separates the bodies completely
        return
    place, resolved = stack_array((3,)), stack_array((DIRECTIONS,))
    clear(resolved)
    depth = _fill_plane(region.sums[c], query.raised, place)
    leaving = Leaving(place, space.directions[c].normal, depth)
    for i in range(count):
        f, g = region.facets.pairs[i, 0], region.facets.pairs[i, 1]
        total = 0.0
        for d in range(DIRECTIONS):
            if d != c:
                total += region.volumes[i, d]
        if total == 0.0:
            continue
        share = _classify_pair(table, f, g, leaving, region)
        if share == 0:
            continue
        part = 1.0
        if share < 0:
            piece = _clip_resolved(table, (f, g), query, leaving, region)
            part = piece_volume(piece, query.raised, region) if piece[1] >= 3 else 0.0
        for d in range(DIRECTIONS):
            resolved[d] += part * (region.volumes[i, d] if share > 0 else table.shares[g, d])
    for d in range(DIRECTIONS):
        if d != c and region.sums[d].volume > 0.0:
            x = (1.0 - resolved[d] / region.sums[d].volume - _RESOLVED) / (_REMAINS - _RESOLVED)
            found.value[d, c] = smooth_step(x)
            found.slope[d, c] = -smooth_step_slope(x) / (_REMAINS - _RESOLVED)


@inner_kernel
def _dot(a, b):
    """Return the product of two vectors (3,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner_kernel
def _fill_side(table, g, piece, i, reach, on_a, region, place_out):
    """Return the integral of w over side `i` of a piece [m^2]; fill that of w times the place (3,).

    The place is on A's surface if `on_a`, else on B's.
    """
    p, j = region.polygon[piece[0]], (i + 1) % piece[1]
    o, x, y, z = table.origin[g], table.axes[g, 0], table.axes[g, 1], table.axes[g, 2]
    length, total = math.hypot(p[j, 0] - p[i, 0], p[j, 1] - p[i, 1]), 0.0
    clear(place_out)
    for node in range(3):  # by Simpson's rule
        t, weight = 0.5 * node, (4.0 if node == 1 else 1.0) / 6.0 * length
        at_x, at_y = p[i, 0] + t * (p[j, 0] - p[i, 0]), p[i, 1] + t * (p[j, 1] - p[i, 1])
        d = p[i, 2] + t * (p[j, 2] - p[i, 2])
        weight *= d + reach
        total += weight
        for k in range(3):
            place = o[k] + at_x * x[k] + at_y * y[k] - (d * z[k] if on_a else 0.0)
            place_out[k] += weight * place
    return total


@inner_kernel
def _add_sides(table, pair, piece, query, leaving, region, moved_io):
    """Add the derivatives of the integral of w over a piece by its clipping planes.

    `moved_io` (11,) has the derivatives by the plane's offset along its normal, by the depth, by
    the plane's normal (3,), by the motion of A's surface (3,), and its moment (3,).
    """
    f, g = pair
    (here, count), n, m = piece, leaving.normal, region.facets.placed[f].normal
    x, y, z = table.axes[g, 0], table.axes[g, 1], table.axes[g, 2]
    on_x, on_y, on_z, cosine = _dot(n, x), _dot(n, y), _dot(n, z), _dot(m, z)
    place = stack_array((3,))
    for i in range(count):
        owner = region.polygon[here, i, 3]
        if owner == BEHIND:
            slope = math.hypot(on_x, on_y)
            total = _fill_side(table, g, piece, i, query.raised, False, region, place) / slope
            moved_io[0] += total
            moved_io[1] += _COPLANAR * total
            for k in range(3):
                moved_io[2 + k] -= place[k] / slope - total * leaving.place[k]
        elif owner == WITHIN:
            slope = math.hypot(on_z * _dot(m, x) / cosine - on_x, on_z * _dot(m, y) / cosine - on_y)
            total = _fill_side(table, g, piece, i, query.raised, True, region, place) / slope
            moved_io[0] -= total
            moved_io[1] += total
            part = on_z / cosine
            for k in range(3):
                one, two = (k + 1) % 3, (k + 2) % 3
                moved_io[2 + k] += place[k] / slope - total * leaving.place[k]
                moved_io[5 + k] += part * total * m[k]
                moved_io[8 + k] += part * (place[one] * m[two] - place[two] * m[one]) / slope


@inner_kernel
def add_residual_gradient(table, query, count, pair, centre, space, gradient_io):
    """Add the gradient of the way out through a residual.

    Parameters
    ----------
    query : BodyQuery
    count : int
        Number of facet pairs.
    pair : tuple of int
        Directions d and c: see `fill_residuals`.
    centre : (3,) array
        About which the tool turns, B's frame [m].
    space : FacetSpace
        The derivatives by c's normal and moments and by d's volume are added to.
    gradient_io : (6,) array
        By translation and rotation, B's frame.
    """
    d, c = pair
    region, found, direction, place = (
        space.region, space.residuals, space.directions[c], stack_array((3,)),
    )  # fmt: skip
    if found.rate[d, c] == 0.0 or found.slope[d, c] == 0.0:
        return
    sums, volume, resolved = region.sums[c], region.sums[d].volume, 0.0
    rate = found.rate[d, c] * found.slope[d, c] / volume
    leaving = Leaving(place, direction.normal, _fill_plane(sums, query.raised, place))
    q, moved = stack_array((6,)), stack_array((11,))
    clear(q)
    for i in range(count):
        f, g = region.facets.pairs[i, 0], region.facets.pairs[i, 1]
        if region.volumes[i, d] == 0.0:
            continue
        piece = _clip_resolved(table, (f, g), query, leaving, region)
        if piece[1] < 3:
            continue
        q[0] = rate * table.shares[g, d]
        resolved += table.shares[g, d] * piece_volume(piece, query.raised, region)
        add_piece_gradient(table, (f, g), piece, query.raised, q, centre, region, gradient_io)
        clear(moved)
        _add_sides(table, (f, g), piece, query, leaving, region, moved)
        _add_moved(moved, q[0], pair, place, centre, space, gradient_io)
    space.directions[d].volume_rate -= rate * resolved / volume


@inner_kernel
def add_deepest(sums, rate, centre, gradient_io):
    """Add the gradient of a region's largest overlap, times `rate`."""
    arm, force = stack_array((3,)), stack_array((3,))
    for k in range(3):
        arm[k] = sums.deepest_point[k] - centre[k]
        force[k] = -rate * sums.deepest_slope[k]
    add_at_point(gradient_io, arm, force)


@inner_kernel
def _add_moved(moved, rate, pair, place, centre, space, gradient_io):
    """Propagate the derivatives of `_add_sides`, times `rate`, to moments, normal and motion."""
    direction, sums = space.directions[pair[1]], space.region.sums[pair[1]]
    n = direction.normal
    for k in range(3):
        one, two = (k + 1) % 3, (k + 2) % 3
        direction.turn[k] += rate * moved[2 + k]
        direction.first_rate[k] += rate * moved[0] * n[k] / sums.volume
        direction.volume_rate -= rate * moved[0] * n[k] * place[k] / sums.volume
        gradient_io[k] += rate * moved[5 + k]
        gradient_io[3 + k] += rate * moved[8 + k]
        gradient_io[3 + k] -= rate * (centre[one] * moved[5 + two] - centre[two] * moved[5 + one])
    add_deepest(sums, rate * _REACH * moved[1], centre, gradient_io)
