"""The footprint of a contact: what of two smooth bodies overlaps, summed over facing facets.

A facet of A that faces a facet of B is projected onto B's along B's normal and clipped to where
the two overlap by more than `-reach` (nearer than the textures reach) and less than the deepest
overlap that a contact may have. The sums over all such pieces do not depend on how the bodies
were cut into facets, and change continuously with the pose: everything about a contact that is
not its depth comes from them.

The pieces are summed for up to six directions of B's frame, into which a facet's normal counts
by `FacetTable.shares`: opposite walls of a hole are contacts of their own.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, small_kernel
from asperity._core.stack import stack_array
from asperity.contact.broad_phase.facet_bvh import BINS, FacetTable
from asperity.contact.broad_phase.facet_pairs import MAX_FACINGS, Facing, facing_space
from asperity.contact.narrow_phase.surface_patch import FLATTEST

_CORNERS = 24

# Sums of one direction; one row of numbers.
AREA, MASS, MEAN, SPREAD, NORMAL = 0, 1, 2, 5, 11  # weighted by how deep, (1, 1, 3, 6, 3)
EDGE_A, EDGE_B = 14, 17  # outward normals of the border, times its length: A's edges, and B's
DEEPEST, WHERE = 20, 21  # smooth overlap [m], and on B where it is (1, 3)
SUMS_SIZE = 24

_ON = 1e-6  # a place this far beyond a facet is still on it [m]
_ASTRAY = math.cos(math.radians(20.0))

# Codes of a piece's sides.
_CUT, _OF_A, _OF_B = 0.0, 1.0, 2.0


class FootprintSpace(NamedTuple):
    """What the footprint writes to, allocated once."""

    facing: Facing
    polygon: NDArray[np.float64]
    sums: NDArray[np.float64]
    """(6, 24)"""
    limit: NDArray[np.float64]
    """Deepest overlap of each direction [m], (6,)."""
    masses: NDArray[np.float64]
    """What each facing pair adds to each direction's MASS, (n, 6)."""


def footprint_space(facets: int) -> FootprintSpace:
    """Return room for the footprints of bodies with so many facets in all."""
    return FootprintSpace(
        facing_space(facets),
        np.zeros((2, _CORNERS, 4)),
        np.zeros((BINS, SUMS_SIZE)),
        np.zeros(BINS),
        np.zeros((MAX_FACINGS, BINS)),
    )


@inner_kernel
def _clip(polygon, source, count, k0, k1, k2, k3, code):
    """Cut a polygon to where `k0 + k1 x + k2 y + k3 d <= 0`.

    Rows of `polygon[source]` are x, y, d and the code of the side to the next corner. Returns
    which half the result is in, and how many corners are left.
    """
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
            # Leaving, the cut begins here; entering, the old side goes on.
            q[kept, 3] = code if here <= 0.0 else p[i, 3]
            kept += 1
    return 1 - source, kept


@small_kernel
def piece(table: FacetTable, f, g, reach, beside, near, space):
    """Project facet f of A onto facet g of B and clip it to their overlap.

    Returns which half of `space.polygon` it is in, and how many corners it has; the overlap d
    is above `-reach` in all of them. There are -1 corners if the two are farther apart than
    `beside` sideways, or overlap by more than `near`.
    """
    polygon = space.polygon
    o, x, y, z = table.origin[g], table.axes[g, 0], table.axes[g, 1], table.axes[g, 2]
    count = table.sides[f]
    for c in range(count):
        # Seen from B's side A's facet runs round the other way.
        p = space.facing.turned[f, count - 1 - c]
        d0, d1, d2 = p[0] - o[0], p[1] - o[1], p[2] - o[2]
        polygon[0, c, 0] = d0 * x[0] + d1 * x[1] + d2 * x[2]
        polygon[0, c, 1] = d0 * y[0] + d1 * y[1] + d2 * y[2]
        polygon[0, c, 2] = -(d0 * z[0] + d1 * z[1] + d2 * z[2])
        polygon[0, c, 3] = _OF_A
    low_x = low_y = low_d = np.inf
    high_x = high_y = high_d = -np.inf
    for c in range(count):
        x, y, d = polygon[0, c, 0], polygon[0, c, 1], polygon[0, c, 2]
        low_x, low_y, low_d = min(low_x, x), min(low_y, y), min(low_d, d)
        high_x, high_y, high_d = max(high_x, x), max(high_y, y), max(high_d, d)
    half_x, half_y = table.half[g, 0], table.half[g, 1]
    gap = max(max(low_x, -high_x) - half_x, max(low_y, -high_y) - half_y)
    if gap > beside or low_d > near or high_d < -reach:
        return np.int64(0), np.int64(-1)
    if gap > 0.0:
        return np.int64(0), np.int64(0)
    here = np.int64(0)
    if low_d < -reach:
        here, count = _clip(polygon, here, count, -reach, 0.0, 0.0, -1.0, _CUT)
    rows = table.count_rows[g]
    for i in range(rows if rows > 0 else 4):
        if rows > 0:
            k0, k1, k2 = table.rows[g, i, 0], table.rows[g, i, 1], table.rows[g, i, 2]
        else:
            sign = 1.0 if i & 1 else -1.0
            k0 = -table.half[g, i >> 1]
            k1, k2 = (sign, 0.0) if i < 2 else (0.0, sign)
        # Mostly all of it is on the right side of most sides.
        if k0 + max(k1 * low_x, k1 * high_x) + max(k2 * low_y, k2 * high_y) > 0.0:
            here, count = _clip(polygon, here, count, k0, k1, k2, 0.0, _OF_B)
            if count == 0:
                break
    return here, count


@inner_kernel
def _mix(f0, f1, f2, g0, g1, g2, h0, h1, h2):
    """Return 60 / area times the integral of a product of three linear functions of a triangle.

    They are given by their values in its corners.
    """
    sf, sg, sh = f0 + f1 + f2, g0 + g1 + g2, h0 + h1 + h2
    fg, fh = f0 * g0 + f1 * g1 + f2 * g2, f0 * h0 + f1 * h1 + f2 * h2
    gh = g0 * h0 + g1 * h1 + g2 * h2
    fgh = f0 * g0 * h0 + f1 * g1 * h1 + f2 * g2 * h2
    return sf * sg * sh + sf * gh + sg * fh + sh * fg + 2.0 * fgh


@inner_kernel
def add_piece(table: FacetTable, g, here, count, reach, share, space, sums):
    """Add a piece on facet g of B to the sums of one direction, counting `share` of it.

    Weights are `d + reach`: places count by how deep they are. Returns the weight added.
    """
    p = space.polygon[here]
    o, x, y, z = table.origin[g], table.axes[g, 0], table.axes[g, 1], table.axes[g, 2]
    area = mass = m_x = m_y = m_xx = m_xy = m_yy = 0.0
    x0, y0, g0 = p[0, 0], p[0, 1], p[0, 2] + reach
    for i in range(1, count - 1):
        x1, y1, g1 = p[i, 0], p[i, 1], p[i, 2] + reach
        x2, y2, g2 = p[i + 1, 0], p[i + 1, 1], p[i + 1, 2] + reach
        size = 0.5 * ((x1 - x0) * (y2 - y0) - (y1 - y0) * (x2 - x0))
        part = size / 60.0
        area += size
        mass += size * (g0 + g1 + g2) / 3.0
        m_x += part * _mix(g0, g1, g2, x0, x1, x2, 1.0, 1.0, 1.0)
        m_y += part * _mix(g0, g1, g2, y0, y1, y2, 1.0, 1.0, 1.0)
        m_xx += part * _mix(g0, g1, g2, x0, x1, x2, x0, x1, x2)
        m_xy += part * _mix(g0, g1, g2, x0, x1, x2, y0, y1, y2)
        m_yy += part * _mix(g0, g1, g2, y0, y1, y2, y0, y1, y2)
    sums[AREA] += share * area
    sums[MASS] += share * mass
    at = SPREAD
    for i in range(3):
        sums[MEAN + i] += share * (mass * o[i] + m_x * x[i] + m_y * y[i])
        sums[NORMAL + i] += share * mass * z[i]
        for k in range(i, 3):
            total = mass * o[i] * o[k] + m_xx * x[i] * x[k] + m_yy * y[i] * y[k]
            total += m_x * (o[i] * x[k] + x[i] * o[k]) + m_y * (o[i] * y[k] + y[i] * o[k])
            sums[at] += share * (total + m_xy * (x[i] * y[k] + y[i] * x[k]))
            at += 1
    for i in range(count):
        if p[i, 3] == _CUT:
            continue
        j = i + 1 if i + 1 < count else 0
        out_x, out_y = p[j, 1] - p[i, 1], p[i, 0] - p[j, 0]
        start = EDGE_A if p[i, 3] == _OF_A else EDGE_B
        for k in range(3):
            sums[start + k] += share * (out_x * x[k] + out_y * y[k])
    return share * mass


@inner_kernel
def deepest_of(space, here, count):
    """Return the largest overlap of a piece [m], and its corner."""
    most, corner = -np.inf, 0
    for i in range(count):
        if space.polygon[here, i, 2] > most:
            most, corner = space.polygon[here, i, 2], i
    return most, corner


@inner_kernel
def cut_deep(space, here, count, most):
    """Clip a piece to overlaps of at most `most`; return where it is, and its corners."""
    return _clip(space.polygon, here, count, -most, 0.0, 0.0, 1.0, _CUT)


@inner_kernel
def steady_normal(table: FacetTable, count, direction, space, n):
    """Turn a mean normal (3,) to the mean of those within 20 degrees of it, less towards the end.

    So a chamfer beside a wide face does not tilt the normal of the face. As less of the footprint
    is that near the mean, the more the mean itself counts: between two faces that are both astray
    it is all there is, and a tool that goes round the edge between them must not feel it come in.
    """
    x = y = z = near = total = 0.0
    for i in range(count):
        mass = space.masses[i, direction]
        if mass == 0.0:
            continue
        f = table.axes[space.facing.pairs[i, 1], 2]
        along = f[0] * n[0] + f[1] * n[1] + f[2] * n[2]
        total += mass
        mass *= max((along - _ASTRAY) / (1.0 - _ASTRAY), 0.0)
        near += mass
        x, y, z = x + mass * f[0], y + mass * f[1], z + mass * f[2]
    size = math.sqrt(x * x + y * y + z * z)
    if size > 0.0:
        share = near / total
        for k in range(3):
            n[k] = (1.0 - share) * n[k] + share * (x, y, z)[k] / size
        size = math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
        n[0], n[1], n[2] = n[0] / size, n[1] / size, n[2] / size


@inner_kernel
def sliver(sums):
    """Return how thick the footprint is between an edge of A and the edge of B that it leaves.

    Along a border that closes round a body's whole face outward normals cancel. What is left of
    A's edges and of B's, where the two oppose each other, is the width of a sliver that is about
    to slide off; its area over that width is its thickness [m], infinite if there is none.
    """
    opposed = 0.0
    for k in range(3):
        opposed -= sums[EDGE_A + k] * sums[EDGE_B + k]
    if opposed <= 0.0 or sums[AREA] <= 0.0:
        return np.inf
    return sums[AREA] / math.sqrt(opposed)


@inner_kernel
def way_out(table: FacetTable, count, direction, n, place, space):
    """Return how far a place (3,) within B is from B's surface along n [m]; infinite if unknown.

    All in B's frame; facets that face some of A and count for `direction` are the surface.
    """
    nearest = np.inf
    for i in range(count):
        g = space.facing.pairs[i, 1]
        if table.shares[g, direction] == 0.0:
            continue
        o, x, y, z = table.origin[g], table.axes[g, 0], table.axes[g, 1], table.axes[g, 2]
        along = n[0] * z[0] + n[1] * z[1] + n[2] * z[2]
        if along < FLATTEST:
            continue
        t = ((o[0] - place[0]) * z[0] + (o[1] - place[1]) * z[1] + (o[2] - place[2]) * z[2]) / along
        if t < -_ON or t >= nearest:
            continue
        a = b = 0.0
        for k in range(3):
            off = place[k] + t * n[k] - o[k]
            a, b = a + off * x[k], b + off * y[k]
        if abs(a) > table.half[g, 0] + _ON or abs(b) > table.half[g, 1] + _ON:
            continue
        out = -np.inf
        for r in range(table.count_rows[g]):
            row = table.rows[g, r]
            out = max(out, row[0] + row[1] * a + row[2] * b)
        if out <= _ON:
            nearest = t
    return nearest
