"""Upper bounds of the overlap of two planes: of a whole pair, and of the quarters of a box.

From a look or two at the highest points of either texture, and their smooth overlap, which is
linear. The sieve asks for some two hundred pairs and a thousand quarters in a tick.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity._core.stack import stack_array
from asperity.contact.narrow_phase.bounds.texture import on_texture, plane_normal, sideways
from asperity.contact.narrow_phase.bounds.triplanar import mixes, triplanar_top
from asperity.contact.narrow_phase.branch_and_bound import quick_bound
from asperity.contact.narrow_phase.flat_on_flat import plane_overlap
from asperity.contact.narrow_phase.overlap import POLYGON
from asperity.contact.narrow_phase.penetration import LOOK_BOX
from asperity.contact.narrow_phase.surface_patch import (
    B0,
    B1,
    B2,
    LEAST_W,
    MAPPING,
    PLANAR,
    PZ,
    Q_LEAST,
    QINV,
    RECTANGLE,
    RISE,
    ROWS,
    SUMMIT,
    TEXTURE,
    TOP,
    UNIT,
    V0,
    V1,
    V2,
    C,
    O,
    Q,
)
from asperity.texture.highest import WHOLE, texture_top, top_over, windows_for

_LEANS = 0.1
"""Where textures move points sideways by more than this part of a box, it is asked where to."""


@small_kernel
def _cap(textures, chart):
    """Return the highest point of a chart's texture all over the chart."""
    if chart[TEXTURE] < 0.0:
        return 0.0
    return min(chart[TOP], textures.maps[int(chart[TEXTURE])].max_abs_height)


@small_kernel
def _highest(textures, chart, x, y, half_x, half_y):
    """Return the highest point of a chart's texture over a box of its parameters."""
    known = _cap(textures, chart)
    if chart[TEXTURE] < 0.0 or chart[MAPPING] != PLANAR:
        return known
    u0, u1, v0, v1 = on_texture(chart, x, y, half_x, half_y)
    return min(known, texture_top(textures, int(chart[TEXTURE]), u0, u1, v0, v1))


@inner_kernel
def _highest_of_any(textures, chart, x, y, half_x, half_y):
    """Do `_highest` for a triplanar map too.

    It is no part of what calls it: searches between flat maps would take 4 % longer.
    """
    if mixes(chart):
        top = triplanar_top(textures, chart, x, y, half_x, half_y)
        return min(_cap(textures, chart), top)
    return _highest(textures, chart, x, y, half_x, half_y)


@small_kernel
def between_planes(cx, cy):
    """Return what bounds of the overlap of two plane charts take from the charts.

    Y's parameters over X's, `b0 + b1 x + b2 y` and `c0 + c1 x + c2 y`; the smooth overlap by x,
    by y, at (0, 0); how much higher a unit of X's texture, and of Y's, lifts it.
    """
    i, j, k, m = cy[QINV], cy[QINV + 1], cy[QINV + 2], cy[QINV + 3]
    du, dv = cx[O] - cy[O], cx[O + 1] - cy[O + 1]
    b0, b1, b2 = i * du + j * dv, i * cx[Q] + j * cx[Q + 2], i * cx[Q + 1] + j * cx[Q + 3]
    c0, c1, c2 = k * du + m * dv, k * cx[Q] + m * cx[Q + 2], k * cx[Q + 1] + m * cx[Q + 3]
    z_x = cx[PZ] + cy[PZ] * b1 + cy[PZ + 1] * c1
    z_y = cx[PZ + 1] + cy[PZ] * b2 + cy[PZ + 1] * c2
    z_0 = cx[O + 2] + cy[O + 2] + cy[PZ] * b0 + cy[PZ + 1] * c0
    g1, g2 = i * cy[PZ] + k * cy[PZ + 1], j * cy[PZ] + m * cy[PZ + 1]
    lift_x, lift_y = _lift(cx, g1, g2), _lift(cy, -g1, -g2)
    return b0, b1, b2, c0, c1, c2, z_x, z_y, z_0, lift_x, lift_y


@small_kernel
def _lift(chart, g1, g2):
    """Return how much higher a plane is over a place, moved by 1 along its normal, at most."""
    lift = chart[V0 + 2] + g1 * chart[V0] + g2 * chart[V0 + 1]
    if chart[UNIT] == 1.0:
        return lift
    # Before w is made a unit vector it is linear.
    x = chart[V1 + 2] + g1 * chart[V1] + g2 * chart[V1 + 1]
    y = chart[V2 + 2] + g1 * chart[V2] + g2 * chart[V2 + 1]
    lift += abs(x) * chart[RECTANGLE + 1] + abs(y) * chart[RECTANGLE + 3]
    return min(max(lift, 0.0) / chart[LEAST_W], math.sqrt(1.0 + g1 * g1 + g2 * g2))


@small_kernel
def _lifting(chart, high):
    """Return by how much of a texture's highest point a plane may be lifted."""
    # Where normals turn, how much a unit lifts is known for what is above the base only.
    return high if chart[UNIT] == 1.0 else max(high, 0.0)


@small_kernel
def on_other(flat, x, y, half_x, half_y, moved):
    """Return middle and half sides, by Y's parameters, of what may lie under a box of X's."""
    b0, b1, b2, c0, c1, c2, _, _, _, _, _ = flat
    return (
        b0 + b1 * x + b2 * y,
        c0 + c1 * x + c2 * y,
        abs(b1) * half_x + abs(b2) * half_y + moved,
        abs(c1) * half_x + abs(c2) * half_y + moved,
    )


@small_kernel
def beyond(chart, first, x, y, half_x, half_y):
    """Return whether a box round (x, y) lies beyond one of a plane chart's rows from `first` on."""
    for n in range(first, int(chart[ROWS])):
        row = ROWS + 1 + 6 * n
        k1, k2, k4 = chart[row + 1], chart[row + 2], chart[row + 4]
        g = chart[row] + k1 * x + k2 * y
        if k4 != 0.0:
            g += k4 * (x * x + y * y)
            k1, k2 = k1 + 2.0 * k4 * x, k2 + 2.0 * k4 * y
        if g > abs(k1) * half_x + abs(k2) * half_y:
            return True
    return False


@small_kernel
def _spread(textures, chart, half_x, half_y):
    """Return how far a box spreads to either side on a planar map, and what windows cover it."""
    k = int(chart[TEXTURE])
    if k < 0 or chart[MAPPING] != PLANAR:
        return 0.0, 0.0, WHOLE
    ru = abs(chart[B1]) * half_x + abs(chart[B2]) * half_y
    rv = abs(chart[B1 + 1]) * half_x + abs(chart[B2 + 1]) * half_y
    return ru, rv, windows_for(textures, k, 2.0 * ru, 2.0 * rv)


@small_kernel
def _top_over(textures, chart, cap, spread, x, y):
    """Return the highest point of a chart's texture over a box of known size round (x, y)."""
    ru, rv, chosen = spread
    if chosen.side == 0:
        return cap
    u = chart[B0] + chart[B1] * x + chart[B2] * y
    v = chart[B0 + 1] + chart[B1 + 1] * x + chart[B2 + 1] * y
    return min(cap, top_over(textures, int(chart[TEXTURE]), chosen, u - ru, v - rv))


@inner_kernel
def quarter_bounds(textures, cx, cy, flat, box, moved, enough, bounds_out):
    """Fill upper bounds of the overlap of two plane charts over the quarters of a box, (4,).

    -inf where they do not meet, and for quarters that there are not: a box twice as long as it is
    wide is halved. `moved`: how far their textures move points sideways at most, in Y's parameters
    [m]. Quarters are of one size: what follows from that is reckoned once. Of those whose bound is
    above `enough` it is seen whether they lie beyond borders.
    """
    x0, x1, y0, y1 = box
    cut_x, cut_y = 2.0 * (x1 - x0) > y1 - y0, 2.0 * (y1 - y0) > x1 - x0
    half_x, half_y = (0.25 if cut_x else 0.5) * (x1 - x0), (0.25 if cut_y else 0.5) * (y1 - y0)
    b0, b1, b2, c0, c1, c2, z_x, z_y, z_0, _, _ = flat
    _, _, reach_x, reach_y = on_other(flat, 0.0, 0.0, half_x, half_y, moved)
    rise = z_0 + abs(z_x) * half_x + abs(z_y) * half_y
    rise_x = cx[O + 2] + abs(cx[PZ]) * half_x + abs(cx[PZ + 1]) * half_y
    rise_y = cy[O + 2] + abs(cy[PZ]) * reach_x + abs(cy[PZ + 1]) * reach_y
    cap_x, cap_y = _cap(textures, cx), _cap(textures, cy)
    spread_x = _spread(textures, cx, half_x, half_y)
    spread_y = _spread(textures, cy, reach_x, reach_y)
    highs = stack_array((8,))
    for child in range(4):
        bounds_out[child] = -np.inf
        if (child & 1 and not cut_x) or (child & 2 and not cut_y):
            continue
        x, y = x0 + (3.0 if child & 1 else 1.0) * half_x, y0 + (3.0 if child & 2 else 1.0) * half_y
        bx, by = b0 + b1 * x + b2 * y, c0 + c1 * x + c2 * y
        high_x = _top_over(textures, cx, cap_x, spread_x, x, y)
        high_y = _top_over(textures, cy, cap_y, spread_y, bx, by)
        highs[child], highs[4 + child] = high_x, high_y
        top = min(rise_x + cx[PZ] * x + cx[PZ + 1] * y, cx[SUMMIT])
        top += min(rise_y + cy[PZ] * bx + cy[PZ + 1] * by, cy[SUMMIT])
        bound = _lifted(cx, cy, flat, rise + z_x * x + z_y * y, top, high_x, high_y)
        apart = (
            (bx - reach_x > cy[RECTANGLE + 1]) | (bx + reach_x < cy[RECTANGLE])
            | (by - reach_y > cy[RECTANGLE + 3]) | (by + reach_y < cy[RECTANGLE + 2])
        )  # fmt: skip
        bounds_out[child] = -np.inf if apart else bound
    leans = moved > _LEANS * max(reach_x, reach_y) and cy[TEXTURE] >= 0.0
    mixed = mixes(cx) or mixes(cy)
    for child in range(4 if mixed else 0):
        if bounds_out[child] > enough:
            x = x0 + (3.0 if child & 1 else 1.0) * half_x
            y = y0 + (3.0 if child & 2 else 1.0) * half_y
            on_y = (b0 + b1 * x + b2 * y, c0 + c1 * x + c2 * y, reach_x, reach_y)
            bounds_out[child] = _mixed_bound(
                textures, cx, cy, flat, (x, y, half_x, half_y), on_y, bounds_out[child],
                rise + z_x * x + z_y * y, child, highs,
            )  # fmt: skip
    for child in range(4):
        if bounds_out[child] > enough:
            x = x0 + (3.0 if child & 1 else 1.0) * half_x
            y = y0 + (3.0 if child & 2 else 1.0) * half_y
            bx, by = b0 + b1 * x + b2 * y, c0 + c1 * x + c2 * y
            if beyond(cx, 0, x, y, half_x, half_y) or beyond(cy, 0, bx, by, reach_x, reach_y):
                bounds_out[child] = -np.inf
            elif leans:
                bound = _leaning_bound(
                    textures, cx, cy, flat, (x, y, half_x, half_y), (bx, by, reach_x, reach_y),
                    moved, rise + z_x * x + z_y * y, highs[child], highs[4 + child], enough,
                )  # fmt: skip
                bounds_out[child] = min(bounds_out[child], bound)


@inner_kernel
def _mixed_bound(textures, cx, cy, flat, on_x, on_y, bound, smooth, child, highs_out):
    """Return an upper bound over a quarter of a box, where `bound` knows of all of a texture only.

    Fills how high the textures are there.
    """
    highs_out[child] = high_x = _highest_of_any(textures, cx, *on_x)
    highs_out[4 + child] = high_y = _highest_of_any(textures, cy, *on_y)
    return min(bound, _lifted(cx, cy, flat, smooth, np.inf, high_x, high_y))


@small_kernel
def _heights_that_count(chart, need, lift):
    """Return the height from which on a texture reaches `need` with what it is lifted by."""
    # As for `_lifting`.
    return need / lift if lift > 0.0 and (chart[UNIT] == 1.0 or need > 0.0) else -np.inf


@small_kernel
def _moved_by(textures, chart, low, high, x, y, radius):
    """Return where a texture from `low` to `high` moves points to, along u and v, and how exactly.

    The box is round (x, y), no corner farther away than `radius`.
    """
    if chart[TEXTURE] < 0.0:
        return 0.0, 0.0, 0.0
    size = textures.maps[int(chart[TEXTURE])].max_abs_height
    low, high = max(low, -size), min(high, size)
    middle, half = 0.5 * (low + high), 0.5 * max(high - low, 0.0)
    w_u, w_v, _, change, _, _ = plane_normal(chart, x, y, radius)
    near = half * math.sqrt(w_u * w_u + w_v * w_v) + max(abs(low), abs(high)) * change
    return middle * w_u, middle * w_v, near


@inner_kernel
def _leaning_bound(
    textures, cx, cy, flat, on_x, on_y, moved, smooth, high_x, high_y, enough
):  # fmt: skip
    """Return an upper bound of what is deeper than `enough` over a box, or `enough`.

    Textures move points sideways, by their height. What is that deep is high, on both: so it is
    known more closely where on Y it lies, and what is high elsewhere on Y does not count.
    """
    lift_x, lift_y = flat[9], flat[10]
    up_x, up_y = lift_x * _lifting(cx, high_x), lift_y * _lifting(cy, high_y)
    low_x = _heights_that_count(cx, enough - smooth - up_y, lift_x)
    low_y = _heights_that_count(cy, enough - smooth - up_x, lift_y)
    if low_x > high_x or low_y > high_y:
        return enough
    x, y, half_x, half_y = on_x
    bx, by, reach_x, reach_y = on_y
    radius = math.sqrt(half_x * half_x + half_y * half_y)
    far = math.sqrt(reach_x * reach_x + reach_y * reach_y)
    x_u, x_v, near_x = _moved_by(textures, cx, low_x, high_x, x, y, radius)
    y_u, y_v, near_y = _moved_by(textures, cy, low_y, high_y, bx, by, far)
    less = moved - (near_x + near_y) / cy[Q_LEAST]
    if less <= 0.0:
        return np.inf
    d_u, d_v = x_u - y_u, x_v - y_v
    bx += cy[QINV] * d_u + cy[QINV + 1] * d_v
    by += cy[QINV + 2] * d_u + cy[QINV + 3] * d_v
    reach_x, reach_y = reach_x - less, reach_y - less
    if beyond(cy, 0, bx, by, reach_x, reach_y):
        return enough
    if mixes(cy):
        high_y = _highest_of_any(textures, cy, bx, by, reach_x, reach_y)
    else:
        high_y = _highest(textures, cy, bx, by, reach_x, reach_y)
    up_y = lift_y * _lifting(cy, high_y)
    return max(smooth + up_x + up_y, enough)


@small_kernel
def _lifted(cx, cy, flat, bound, top, high_x, high_y):
    """Return the sharper of two bounds, with textures that are so high."""
    high_x, high_y = _lifting(cx, high_x), _lifting(cy, high_y)
    # No point is higher than that of the base which it was, and its texture's highest.
    top = _summits(cx, cy, top, high_x, high_y)
    return min(bound + flat[9] * high_x + flat[10] * high_y, top)


@small_kernel
def summit_bound(textures, cx, cy):
    """Return an upper bound of the overlap of two charts from what is known of each of them.

    Infinite where that is nothing.
    """
    high_x, high_y = _lifting(cx, _cap(textures, cx)), _lifting(cy, _cap(textures, cy))
    return _summits(cx, cy, cx[SUMMIT] + cy[SUMMIT], high_x, high_y)


@small_kernel
def _summits(cx, cy, top, high_x, high_y):
    """Return how high points are whose bases are no higher than `top`."""
    top += high_x * (cx[V0 + 2] if cx[UNIT] == 1.0 else cx[RISE])
    return top + high_y * (cy[V0 + 2] if cy[UNIT] == 1.0 else cy[RISE])


@small_kernel
def _risen(textures, cx, cy, bound, on_x, on_y, flat):
    """Return a bound of the smooth overlap over a box, and what the textures add to it there.

    `on_x`, `on_y`: middle and half sides of the box on either chart.
    """
    x, y, half_x, half_y = on_x
    bx, by, reach_x, reach_y = on_y
    top = cx[O + 2] + cx[PZ] * x + cx[PZ + 1] * y
    top += abs(cx[PZ]) * half_x + abs(cx[PZ + 1]) * half_y
    base = cy[O + 2] + cy[PZ] * bx + cy[PZ + 1] * by
    base += abs(cy[PZ]) * reach_x + abs(cy[PZ + 1]) * reach_y
    top = min(top, cx[SUMMIT]) + min(base, cy[SUMMIT])
    high_x = _highest(textures, cx, x, y, half_x, half_y)
    high_y = _highest(textures, cy, bx, by, reach_x, reach_y)
    return _lifted(cx, cy, flat, bound, top, high_x, high_y)


@inner_kernel
def pair_bound(textures, cx, cy, work, look_out):
    """Fill an upper bound of the overlap of two charts, -inf if they do not meet.

    With it, for plane charts, the part of X's parameters over which they do: `LOOK_BOX`.
    """
    if cx[C] > 0.0 or cy[C] > 0.0:
        look_out[0] = quick_bound(textures, cx, cy)
        return
    look_out[0] = -np.inf
    shift = sideways(textures, cx) + sideways(textures, cy)
    polygon = work[POLYGON:]
    size, at_zero, g_x, g_y = plane_overlap(cx, cy, shift, polygon)
    if size == 0:
        return
    smooth = -np.inf
    x0, y0 = polygon[0, 0], polygon[0, 1]
    x1, y1 = x0, y0
    for j in range(size):
        x, y = polygon[j, 0], polygon[j, 1]
        smooth = max(smooth, at_zero + g_x * x + g_y * y)
        x0, x1, y0, y1 = min(x0, x), max(x1, x), min(y0, y), max(y1, y)
    look_out[LOOK_BOX], look_out[LOOK_BOX + 1] = x0, x1
    look_out[LOOK_BOX + 2], look_out[LOOK_BOX + 3] = y0, y1
    x, y, half_x, half_y = 0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    look_out[1], look_out[2] = x, y
    flat, moved = between_planes(cx, cy), shift / cy[Q_LEAST]
    on_y = on_other(flat, x, y, half_x, half_y, moved)
    on_x = (x, y, half_x, half_y)
    look_out[0] = _risen(textures, cx, cy, smooth, on_x, on_y, flat)
    if mixes(cx) or mixes(cy):
        look_out[0] = _mixed_bound(
            textures, cx, cy, flat, on_x, on_y, look_out[0], smooth, 0, stack_array((8,))
        )
