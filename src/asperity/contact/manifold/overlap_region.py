"""The region in which two smooth bodies overlap, as integrals over pairs of facets.

A facet of A that faces a facet of B is projected onto B's plane along B's normal, and clipped to
where the overlap d is between `-reach`, minus the height of both textures, and the limit on the
overlap. The integrals over all such pieces do not depend on the tessellation, and they change
continuously with the pose. Everything about a contact but its depth follows from them.

The pieces are summed for six directions, the positive and negative axes of B's frame. A facet's
weight in each direction is in `FacetTable.shares`, so that the opposite walls of a hole are
separate contacts.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, small_kernel
from asperity._core.stack import stack_array
from asperity._core.structures import by_reference
from asperity.contact.broad_phase.facet_bvh import DIRECTIONS, FacetTable
from asperity.contact.broad_phase.facet_pairs import (
    LEAST_COSINE,
    MAX_FACET_PAIRS,
    FacetPairs,
    facet_pairs,
    facing_cosine,
)
from asperity.contact.manifold.records import MAX_DIRECTIONS, OVERLAP_SUMS

_CORNERS = 24
_PARALLEL = 1e-9
"""Sine of the angle between two edges below which they count as parallel."""

CUT, OF_A, OF_B, BEHIND, WITHIN, DEEP = 0.0, 1.0, 2.0, 3.0, 4.0, 5.0
"""Owner of the side from a corner to the next: a body, or the plane that clipped it."""


@by_reference
class OverlapRegion(NamedTuple):
    """The overlap region of two bodies, and scratch memory for the integrals over it."""

    facets: FacetPairs
    polygon: NDArray[np.float64]
    """Two buffers for a piece, rows x, y, d [m] and the side's owner; (2, corners, 4)."""
    sums: NDArray[np.void]
    """`OVERLAP_SUMS` of each direction, (24,)."""
    volumes: NDArray[np.float64]
    """Contribution of each pair of facets to the `volume` of each direction [m^3], (pairs, 6)."""
    rates: NDArray[np.float64]
    """Derivative of the way out by the volume of each pair's piece [1/m^2], (pairs,)."""


def overlap_region(facets: int) -> OverlapRegion:
    """Allocate memory for the overlap regions of bodies with `facets` facets in all."""
    return OverlapRegion(
        facets=facet_pairs(facets),
        polygon=np.zeros((2, _CORNERS, 4)),
        sums=np.zeros(MAX_DIRECTIONS, OVERLAP_SUMS),
        volumes=np.zeros((MAX_FACET_PAIRS, DIRECTIONS)),
        rates=np.zeros(MAX_FACET_PAIRS),
    )


@inner_kernel
def clip_polygon(polygon, source, count, plane, code):
    """Clip a polygon to where `k0 + k1 x + k2 y + k3 d <= 0`.

    Parameters
    ----------
    polygon : (2, corners, 4) array
        Rows of `polygon[source]` are x, y, d and the owner of the side to the next corner.
    count : int
        Number of its corners.
    plane : tuple of float
        k0, k1, k2, k3.
    code : float
        Owner of the new side.

    Returns
    -------
    int, int
        The buffer that the result is in, and its number of corners.
    """
    k0, k1, k2, k3 = plane
    p, q = polygon[source], polygon[1 - source]
    over = stack_array((_CORNERS,))
    least, most = np.inf, -np.inf
    for i in range(count):
        over[i] = k0 + k1 * p[i, 0] + k2 * p[i, 1] + k3 * p[i, 2]
        least, most = min(least, over[i]), max(most, over[i])
    if most <= 0.0:
        return source, count
    if least > 0.0:
        return source, np.int64(0)
    kept = np.int64(0)
    for i in range(count):
        j = i + 1 if i + 1 < count else 0
        here, there = over[i], over[j]
        if here <= 0.0:
            for k in range(4):
                q[kept, k] = p[i, k]
            kept += 1
        if (here <= 0.0) != (there <= 0.0):
            t = here / (here - there)
            for k in range(3):
                q[kept, k] = p[i, k] + t * (p[j, k] - p[i, k])
            # Where the border leaves the half plane the new side begins; else the old one goes on.
            q[kept, 3] = code if here <= 0.0 else p[i, 3]
            kept += 1
    return 1 - source, kept


@small_kernel
def _project(table: FacetTable, f, g, region):
    """Fill `region.polygon[0]` with facet f of A in the frame of facet g of B; return its corners.

    A corner's coordinates are x, y in g's plane and its overlap d.
    """
    polygon = region.polygon
    o, x, y, z = table.origin[g], table.axes[g, 0], table.axes[g, 1], table.axes[g, 2]
    count = table.sides[f]
    for c in range(count):
        # Seen along B's normal, the corners of A's facet are in reverse order.
        p = region.facets.corners[f, count - 1 - c]
        d0, d1, d2 = p[0] - o[0], p[1] - o[1], p[2] - o[2]
        polygon[0, c, 0] = d0 * x[0] + d1 * x[1] + d2 * x[2]
        polygon[0, c, 1] = d0 * y[0] + d1 * y[1] + d2 * y[2]
        polygon[0, c, 2] = -(d0 * z[0] + d1 * z[1] + d2 * z[2])
        polygon[0, c, 3] = OF_A
    return count


@small_kernel
def clip_pair(table: FacetTable, f, g, reach, beside, max_depth, region):
    """Project facet f of A onto facet g of B and clip it to their overlap.

    Returns the buffer of `region.polygon` with the piece, and its number of corners; its overlap is
    at least `-reach`. There are -1 corners if the facets are more than `beside` apart in g's
    plane, or their overlap is nowhere between `-reach` and `max_depth`. All in [m]. Facets that do
    not face each other have no piece.
    """
    polygon = region.polygon
    if facing_cosine(table, f, g, region.facets) < LEAST_COSINE:
        return np.int64(0), np.int64(0)
    count = _project(table, f, g, region)
    low_x = low_y = low_d = np.inf
    high_x = high_y = high_d = -np.inf
    for c in range(count):
        x, y, d = polygon[0, c, 0], polygon[0, c, 1], polygon[0, c, 2]
        low_x, low_y, low_d = min(low_x, x), min(low_y, y), min(low_d, d)
        high_x, high_y, high_d = max(high_x, x), max(high_y, y), max(high_d, d)
    half_x, half_y = table.half[g, 0], table.half[g, 1]
    gap = max(max(low_x, -high_x) - half_x, max(low_y, -high_y) - half_y)
    if gap > beside or low_d > max_depth or high_d < -reach:
        return np.int64(0), np.int64(-1)
    if gap > 0.0:
        return np.int64(0), np.int64(0)
    here = np.int64(0)
    if low_d < -reach:
        here, count = clip_polygon(polygon, here, count, (-reach, 0.0, 0.0, -1.0), CUT)
    rows = table.count_rows[g]
    for i in range(rows if rows > 0 else 4):
        if rows > 0:
            k0, k1, k2 = table.rows[g, i, 0], table.rows[g, i, 1], table.rows[g, i, 2]
        else:
            sign = 1.0 if i & 1 else -1.0
            k0 = -table.half[g, i >> 1]
            k1, k2 = (sign, 0.0) if i < 2 else (0.0, sign)
        # Most pieces are completely inside most sides.
        if k0 + max(k1 * low_x, k1 * high_x) + max(k2 * low_y, k2 * high_y) > 0.0:
            here, count = clip_polygon(polygon, here, count, (k0, k1, k2, 0.0), OF_B)
            if count == 0:
                break
    return here, count


@inner_kernel
def _product_integral(f, g, h):
    """Return 60 / area times the integral over a triangle of the product of linear functions.

    Each of the three is given by its values at the corners, a tuple of 3.
    """
    sf, sg, sh = f[0] + f[1] + f[2], g[0] + g[1] + g[2], h[0] + h[1] + h[2]
    fg, fh = f[0] * g[0] + f[1] * g[1] + f[2] * g[2], f[0] * h[0] + f[1] * h[1] + f[2] * h[2]
    gh = g[0] * h[0] + g[1] * h[1] + g[2] * h[2]
    fgh = f[0] * g[0] * h[0] + f[1] * g[1] * h[1] + f[2] * g[2] * h[2]
    return sf * sg * sh + sf * gh + sg * fh + sh * fg + 2.0 * fgh


@inner_kernel
def add_piece(table: FacetTable, g, piece, reach, share, region, sums):
    """Add a piece on facet g of B to the sums of one direction.

    Parameters
    ----------
    piece : tuple of int
        Buffer of `region.polygon`, number of corners: see `clip_pair`.
    reach : float
        Height of both textures [m]; the integrand's weight is w = d + reach.
    share : float
        Weight of the facet in the direction.
    region : OverlapRegion
    sums : OVERLAP_SUMS
        Added to.

    Returns
    -------
    float
        The volume added [m^3].
    """
    here, count = piece
    p, one = region.polygon[here], (1.0, 1.0, 1.0)
    o, x, y, z = table.origin[g], table.axes[g, 0], table.axes[g, 1], table.axes[g, 2]
    volume = m_x = m_y = m_xx = m_xy = m_yy = 0.0
    x0, y0, w0 = p[0, 0], p[0, 1], p[0, 2] + reach
    for i in range(1, count - 1):
        x1, y1, w1 = p[i, 0], p[i, 1], p[i, 2] + reach
        x2, y2, w2 = p[i + 1, 0], p[i + 1, 1], p[i + 1, 2] + reach
        size = 0.5 * ((x1 - x0) * (y2 - y0) - (y1 - y0) * (x2 - x0))
        part = size / 60.0
        on_x, on_y, w = (x0, x1, x2), (y0, y1, y2), (w0, w1, w2)
        volume += size * (w0 + w1 + w2) / 3.0
        m_x += part * _product_integral(w, on_x, one)
        m_y += part * _product_integral(w, on_y, one)
        m_xx += part * _product_integral(w, on_x, on_x)
        m_xy += part * _product_integral(w, on_x, on_y)
        m_yy += part * _product_integral(w, on_y, on_y)
    sums.volume += share * volume
    at = 0
    for i in range(3):
        sums.first_moment[i] += share * (volume * o[i] + m_x * x[i] + m_y * y[i])
        sums.normal[i] += share * volume * z[i]
        for k in range(i, 3):
            total = volume * o[i] * o[k] + m_xx * x[i] * x[k] + m_yy * y[i] * y[k]
            total += m_x * (o[i] * x[k] + x[i] * o[k]) + m_y * (o[i] * y[k] + y[i] * o[k])
            sums.second_moment[at] += share * (total + m_xy * (x[i] * y[k] + y[i] * x[k]))
            at += 1
    return share * volume


@inner_kernel
def piece_volume(piece, reach, region):
    """Return the integral of w = d + reach over a piece [m^3]; see `add_piece`."""
    here, count = piece
    p, volume = region.polygon[here], 0.0
    for i in range(1, count - 1):
        x1, y1, x2, y2 = (
            p[i, 0] - p[0, 0], p[i, 1] - p[0, 1], p[i + 1, 0] - p[0, 0], p[i + 1, 1] - p[0, 1],
        )  # fmt: skip
        total = p[0, 2] + p[i, 2] + p[i + 1, 2] + 3.0 * reach
        volume += (x1 * y2 - y1 * x2) * total / 6.0
    return volume


@inner_kernel
def deepest_corner(region, piece):
    """Return the largest overlap of a piece [m], and the corner where it is attained."""
    here, count = piece
    deepest, corner = -np.inf, 0
    for i in range(count):
        if region.polygon[here, i, 2] > deepest:
            deepest, corner = region.polygon[here, i, 2], i
    return deepest, corner


@inner_kernel
def clip_depth(region, piece, max_depth):
    """Clip a piece to overlaps of at most `max_depth` [m]; return buffer and number of corners."""
    return clip_polygon(region.polygon, piece[0], piece[1], (-max_depth, 0.0, 0.0, 1.0), DEEP)


@inner_kernel
def clip_piece(table: FacetTable, query, f, g, region):
    """Clip a pair of facets to the limits of a query; return buffer and number of corners.

    There are fewer than 3 corners where the facets do not overlap.
    """
    piece = clip_pair(table, f, g, query.raised, query.raised, query.limit, region)
    return clip_depth(region, piece, query.limit) if piece[1] >= 3 else piece


@inner_kernel
def corner_slope(table: FacetTable, f, g, piece, corner, region, m_out):
    """Fill m (3,) of a corner of a piece: a motion v of A changes the overlap there by -m . v.

    At a corner of A it is along B's normal, at one of B along A's, where two edges cross
    perpendicular to both. Where the overlap is clipped to the limit it is constant: m is 0.
    """
    here, count = piece
    p, z = region.polygon[here], table.axes[g, 2]
    before, after = (corner - 1 if corner > 0 else count - 1), (corner + 1) % count
    owner, last = p[corner, 3], p[before, 3]
    is_deep = owner == DEEP or last == DEEP
    for k in range(3):
        m_out[k] = 0.0 if is_deep else z[k]
    if is_deep or owner == CUT or last == CUT or (owner == OF_A and last == OF_A):
        return
    normal = region.facets.placed[f].normal
    if owner == OF_A or last == OF_A:
        one, two = (before, corner) if last == OF_A else (corner, after)
        e_x, e_y, e_d = p[two, 0] - p[one, 0], p[two, 1] - p[one, 1], p[two, 2] - p[one, 2]
        one, two = (before, corner) if last == OF_B else (corner, after)
        t_x, t_y = p[two, 0] - p[one, 0], p[two, 1] - p[one, 1]
        # The edge of A is (e_x, e_y, -e_d) and that of B (t_x, t_y, 0), along x, y and z.
        up = e_x * t_y - e_y * t_x
        if abs(up) > _PARALLEL * math.sqrt((e_x * e_x + e_y * e_y) * (t_x * t_x + t_y * t_y)):
            for k in range(3):
                on_x, on_y = table.axes[g, 0, k], table.axes[g, 1, k]
                m_out[k] += e_d * (t_y * on_x - t_x * on_y) / up
            return
    along = normal[0] * z[0] + normal[1] * z[1] + normal[2] * z[2]
    for k in range(3):
        m_out[k] = normal[k] / along
