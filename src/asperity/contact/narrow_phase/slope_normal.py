"""The normal m = n - s_u u - s_v v at a deepest point, along which the force acts.

At a deepest point on an edge the slopes of the two surfaces differ. On an edge of A, which moves
with A, B's slope is used; on an edge of B, A's. For edge on edge m is perpendicular to both. Under
a load, slopes are those of the lowered surfaces (`compliance`).
"""

from __future__ import annotations

import math

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.displaced_surface import surface_at
from asperity.contact.narrow_phase.newton_ascent import FEASIBLE
from asperity.contact.narrow_phase.overlap import limits_at
from asperity.contact.narrow_phase.patch_pair import searches_a
from asperity.contact.narrow_phase.surface_patch import entries

ON_EDGE = 10.0 * FEASIBLE
"""Distance from an edge up to which a point is on it [m]."""
_CORNER = 1e-3
"""Sine of the angle between two edges above which they form a corner."""
_LEVEL = 1e-4
"""Difference of the slopes at a deepest point inside a facet, which is no more than rounding."""
_PARALLEL = 1e-6
"""Sine of the angle between edges below which they count as parallel."""


@inner_kernel
def _edge_of(limits, count, owner):
    """Return whether a point is on an edge of a body, and the normal to it."""
    for i in range(count):
        if limits[i].owner == owner and limits[i].g > -ON_EDGE:
            return True, limits[i].g_x, limits[i].g_y
    return False, 0.0, 0.0


@inner_kernel
def _is_corner(limits, count, owner, across_x, across_y):
    """Return whether a point is on another edge of a body than that with this normal."""
    is_corner, size = False, math.hypot(across_x, across_y)
    for i in range(count):
        limit = limits[i]
        if limit.owner == owner and limit.g > -ON_EDGE:
            turn = abs(limit.g_x * across_y - limit.g_y * across_x)
            is_corner = is_corner or turn > _CORNER * size * math.hypot(limit.g_x, limit.g_y)
    return is_corner


@inner_kernel
def _edge_of_rectangle(patch, x, y):
    """Return whether (x, y) is on a side of a patch's rectangle that is an edge, and its normal."""
    for axis in range(2 if patch.rectangle_is_edge else 0):
        place = x if axis == 0 else y
        low, high = patch.rectangle[2 * axis], patch.rectangle[2 * axis + 1]
        if place < low + ON_EDGE or place > high - ON_EDGE:
            sign = 1.0 if place > high - ON_EDGE else -1.0
            return True, (sign if axis == 0 else 0.0), (sign if axis == 1 else 0.0)
    return False, 0.0, 0.0


@small_kernel
def _outward_normal(edge, u, v):
    """Return the unit normal of an edge in (u, v), on the side of the vector (u, v)."""
    size = math.sqrt(edge[0] * edge[0] + edge[1] * edge[1])
    if edge[1] * u - edge[0] * v < 0.0:
        size = -size
    return edge[1] / size, -edge[0] / size


@small_kernel
def _across_and_along(point, across_x, across_y, sign):
    """Return a surface's tangent (u, v) across an edge, and the edge in (u, v, n).

    `point` is a POINT on it, (across_x, across_y) the edge's normal in the parameters.
    """
    p_x, p_y = point.p_x, point.p_y
    across = (across_x * p_x[0] + across_y * p_y[0], across_x * p_x[1] + across_y * p_y[1])
    edge = (
        across_x * p_y[0] - across_y * p_x[0],
        across_x * p_y[1] - across_y * p_x[1],
        sign * (across_x * p_y[2] - across_y * p_x[2]),
    )
    return across, edge


@inner_kernel
def _fill_slope_normal(textures, patch, other, is_a, at, search, out):
    """Fill m = (-s_u, -s_v, 1) in the contact frame at a point; return whether it is certain.

    `is_a` is true if `patch` is A's. m is uncertain where two edges are parallel and both surfaces
    end on the same side: then the slopes depend on the facets beyond the edges.
    """
    limits, point = search.limits, search.surface
    count = limits_at(patch, other, at, limits)
    on_edge, across_x, across_y = _edge_of_rectangle(patch, at.x, at.y)
    if not on_edge:
        on_edge, across_x, across_y = _edge_of(limits, count, 1)
    on_other_edge, over_x, over_y = _edge_of(limits, count, 2)
    is_corner = _is_corner(limits, count, 1, across_x, across_y)
    is_other_corner = _is_corner(limits, count, 2, over_x, over_y)
    sign, other_sign = (-1.0, 1.0) if is_a else (1.0, -1.0)
    out[2] = 1.0
    if on_edge and on_other_edge and (is_corner or is_other_corner):
        # A corner slides on the other body, even on an edge of it: that body's slope is used.
        is_certain = is_corner != is_other_corner
        from_other = is_corner if is_certain else is_a
    elif on_edge and on_other_edge:
        # Both edges in (u, v, n); m is perpendicular to them.
        surface_at(textures, patch, at.x, at.y, point)
        if search.load > 0.0:
            # The edge is that of the lowered surface.
            point.p_x[2] = at.slope[0] * point.p_x[0] + at.slope[1] * point.p_x[1]
            point.p_y[2] = at.slope[0] * point.p_y[0] + at.slope[1] * point.p_y[1]
        across, e = _across_and_along(point, across_x, across_y, sign)
        j11, j12, j21, j22 = entries(at.jacobian)
        det = j11 * j22 - j12 * j21
        g_a, g_b = (over_x * j22 - over_y * j21) / det, (over_y * j11 - over_x * j12) / det
        surface_at(textures, other, at.other_x, at.other_y, point)
        over, f = _across_and_along(point, g_a, g_b, other_sign)
        up = e[0] * f[1] - e[1] * f[0]
        size = math.sqrt((e[0] ** 2 + e[1] ** 2) * (f[0] ** 2 + f[1] ** 2))
        if abs(up) > _PARALLEL * size:
            out[0] = (e[1] * f[2] - e[2] * f[1]) / up
            out[1] = (e[2] * f[0] - e[0] * f[2]) / up
            return True
        out_u, out_v = _outward_normal(e, across[0], across[1])
        over_u, over_v = _outward_normal(f, over[0], over[1])
        fall = at.slope[0] * out_u + at.slope[1] * out_v
        other_fall = at.other_slope[0] * over_u + at.other_slope[1] * over_v
        is_certain = out_u * over_u + out_v * over_v < 0.0
        # Beyond its edge each surface falls faster than before it; the steeper one is used.
        from_other = other_fall < fall if is_certain else is_a
    else:
        # An edge of one body slides on the other, whose slope is used.
        from_other = on_edge if on_edge != on_other_edge else is_a
        # Where facets of one plane meet at a corner of the body, only some of them have an edge.
        off_u = other_sign * at.other_slope[0] - sign * at.slope[0]
        off_v = other_sign * at.other_slope[1] - sign * at.slope[1]
        is_certain = on_edge != on_other_edge or abs(off_u) + abs(off_v) < _LEVEL
    if from_other:
        out[0], out[1] = -other_sign * at.other_slope[0], -other_sign * at.other_slope[1]
    else:
        out[0], out[1] = -sign * at.slope[0], -sign * at.slope[1]
    return is_certain


@inner_kernel
def slope_normal_of_tie(textures, stride, tie, memory, out):
    """Fill m of a tie; return whether it is certain, and whether A's patch was searched."""
    number = tie.pair
    a, b = memory.patches_a[number // stride], memory.patches_b[number % stride]
    is_a = searches_a(a, b)
    patch, other = (a, b) if is_a else (b, a)
    search = memory.search[0]
    return _fill_slope_normal(textures, patch, other, is_a, tie, search, out), is_a
