"""Upper bounds of the overlap of two planes: of a whole pair, and of the quarters of a box.

They take one or two look-ups of the highest points of either texture, and the overlap of the
smooth bases, which is linear. A best-first search bounds some two hundred pairs and a thousand
quarters in a tick.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity._core.stack import stack_array
from asperity.contact.narrow_phase.bounds.planes import lifts_within, planes_of, under_box
from asperity.contact.narrow_phase.bounds.smooth_bases import order_zero_bound
from asperity.contact.narrow_phase.bounds.triplanar import is_triplanar, plane_triplanar_top
from asperity.contact.narrow_phase.flat_on_flat import plane_overlap
from asperity.contact.narrow_phase.outermost import highest_over, may_fold
from asperity.contact.narrow_phase.patch_pair import pair_shift, window_of
from asperity.contact.narrow_phase.plane_boxes import (
    beyond_straight_borders,
    lateral_shift,
    on_texture,
    plane_normal,
)
from asperity.contact.narrow_phase.surface_patch import PLANAR, entries
from asperity.texture.highest import WHOLE, texture_top, top_over, windows_for

_MIN_LATERAL = 0.1
"""Lateral displacement, over the size of a box, above which `_lateral_bound` is used."""


@small_kernel
def _patch_top(textures, patch):
    """Return the highest texture on a patch [m]."""
    if patch.texture < 0:
        return 0.0
    return min(patch.texture_top, textures.maps[patch.texture].highest)


@small_kernel
def _planar_top(textures, patch, x, y, half_x, half_y):
    """Return a bound of the texture over a box of a patch's parameters, for a planar map [m]."""
    known = _patch_top(textures, patch)
    if patch.texture < 0 or patch.mapping != PLANAR:
        return known
    u0, u1, v0, v1 = on_texture(patch, x, y, half_x, half_y)
    return min(known, texture_top(textures, patch.texture, u0, u1, v0, v1))


@inner_kernel
def _mapped_top(textures, patch, x, y, half_x, half_y):
    """Return `_planar_top`, for a triplanar map too.

    It is not inlined: searches between planar maps would take 4 % longer.
    """
    if is_triplanar(patch):
        top = plane_triplanar_top(textures, patch, x, y, half_x, half_y)
        return min(_patch_top(textures, patch), top)
    return _planar_top(textures, patch, x, y, half_x, half_y)


@small_kernel
def lifting_height(patch, high):
    """Return the height to multiply by a lift: where normals vary, at least 0."""
    return high if patch.is_unit else max(high, 0.0)


@small_kernel
def _box_on_map(textures, patch, half_x, half_y):
    """Return the half sides of a box on a planar map, and the table windows that cover it."""
    k = patch.texture
    if k < 0 or patch.mapping != PLANAR:
        return 0.0, 0.0, WHOLE
    ru = abs(patch.texture_from_x[0]) * half_x + abs(patch.texture_from_y[0]) * half_y
    rv = abs(patch.texture_from_x[1]) * half_x + abs(patch.texture_from_y[1]) * half_y
    return ru, rv, windows_for(textures, k, 2.0 * ru, 2.0 * rv)


@small_kernel
def _top_over(textures, patch, cap, spread, x, y):
    """Return the highest texture over a box around (x, y) with this `_box_on_map` [m]."""
    ru, rv, chosen = spread
    if chosen[3] == 0:
        return cap
    u = patch.texture_origin[0] + patch.texture_from_x[0] * x + patch.texture_from_y[0] * y
    v = patch.texture_origin[1] + patch.texture_from_x[1] * x + patch.texture_from_y[1] * y
    return min(cap, top_over(textures, patch.texture, chosen, u - ru, v - rv))


@inner_kernel
def quarter_bounds(textures, patch, other, planes, box, threshold, bounds_out):
    """Fill upper bounds of the overlap of two plane patches over the quarters of a box, (4,) [m].

    -inf without a common part, and for quarters that do not exist: a box twice as long as wide is
    halved. Quarters have the same size, so what depends on it is computed once. Those with a bound
    above `threshold` are tested against the borders of both patches.
    """
    x0, x1, y0, y1 = box
    cut_x, cut_y = 2.0 * (x1 - x0) > y1 - y0, 2.0 * (y1 - y0) > x1 - x0
    half_x, half_y = (0.25 if cut_x else 0.5) * (x1 - x0), (0.25 if cut_y else 0.5) * (y1 - y0)
    _, _, reach_x, reach_y = under_box(planes, (0.0, 0.0, half_x, half_y))
    z_x, z_y, slope, other_slope = planes.z_x, planes.z_y, patch.slope, other.slope
    rise = planes.z_0 + abs(z_x) * half_x + abs(z_y) * half_y
    rise_x = patch.origin[2] + abs(slope[0]) * half_x + abs(slope[1]) * half_y
    rise_y = other.origin[2] + abs(other_slope[0]) * reach_x + abs(other_slope[1]) * reach_y
    cap_x, cap_y = _patch_top(textures, patch), _patch_top(textures, other)
    spread_x = _box_on_map(textures, patch, half_x, half_y)
    spread_y = _box_on_map(textures, other, reach_x, reach_y)
    sides = other.rectangle
    highs = stack_array((8,))
    for child in range(4):
        bounds_out[child] = -np.inf
        if (child & 1 and not cut_x) or (child & 2 and not cut_y):
            continue
        x, y = x0 + (3.0 if child & 1 else 1.0) * half_x, y0 + (3.0 if child & 2 else 1.0) * half_y
        bx = planes.b0 + planes.b1 * x + planes.b2 * y
        by = planes.c0 + planes.c1 * x + planes.c2 * y
        high_x = _top_over(textures, patch, cap_x, spread_x, x, y)
        high_y = _top_over(textures, other, cap_y, spread_y, bx, by)
        highs[child], highs[4 + child] = high_x, high_y
        top = min(rise_x + slope[0] * x + slope[1] * y, patch.base_top)
        top += min(rise_y + other_slope[0] * bx + other_slope[1] * by, other.base_top)
        bound = _combined(patch, other, planes, rise + z_x * x + z_y * y, top, high_x, high_y)
        apart = (
            (bx - reach_x > sides[1]) | (bx + reach_x < sides[0])
            | (by - reach_y > sides[3]) | (by + reach_y < sides[2])
        )  # fmt: skip
        bounds_out[child] = -np.inf if apart else bound
    is_lateral = planes.shift > _MIN_LATERAL * max(reach_x, reach_y)
    is_lateral = is_lateral and planes.valley == -np.inf and planes.other_valley == -np.inf
    mixed, folds = is_triplanar(patch) or is_triplanar(other), may_fold(textures, other)
    # The other texture's part of the lateral displacement by both.
    inside = planes.shift - lateral_shift(textures, patch) / other.lateral_min
    inside = max(inside, 0.0)
    for child in range(4 if mixed else 0):
        if bounds_out[child] > threshold:
            x = x0 + (3.0 if child & 1 else 1.0) * half_x
            y = y0 + (3.0 if child & 2 else 1.0) * half_y
            quarter = (x, y, half_x, half_y)
            under, smooth = under_box(planes, quarter), rise + z_x * x + z_y * y
            highs[child] = _mapped_top(textures, patch, *quarter)
            highs[4 + child] = _mapped_top(textures, other, *under)
            bound = _combined(patch, other, planes, smooth, np.inf, highs[child], highs[4 + child])
            bounds_out[child] = min(bounds_out[child], bound)
    for child in range(4):
        if bounds_out[child] > threshold:
            x = x0 + (3.0 if child & 1 else 1.0) * half_x
            y = y0 + (3.0 if child & 2 else 1.0) * half_y
            quarter = (x, y, half_x, half_y)
            under = under_box(planes, quarter)
            if beyond_straight_borders(patch, 0, *quarter) or beyond_straight_borders(
                other, 0, *under
            ):
                bounds_out[child] = -np.inf
                continue
            smooth = rise + z_x * x + z_y * y
            if is_lateral:
                bound = _lateral_bound(
                    textures, patch, other, planes, quarter, under,
                    (smooth, highs[child], highs[4 + child]), threshold,
                )  # fmt: skip
                bounds_out[child] = min(bounds_out[child], bound)
            if folds and bounds_out[child] > threshold:
                under = (under[0], under[1], under[2] - inside, under[3] - inside)
                high_y = highest_over(textures, other, under)
                bound = -np.inf
                if high_y > -np.inf:
                    bound = _combined(patch, other, planes, smooth, np.inf, highs[child], high_y)
                bounds_out[child] = min(bounds_out[child], bound)


@small_kernel
def _least_height(patch, need, lift):
    """Return the minimum texture height at which the overlap can still reach `need` [m]."""
    # As for `lifting_height`.
    return need / lift if lift > 0.0 and (patch.is_unit or need > 0.0) else -np.inf


@small_kernel
def _displacement(textures, patch, low, high, box):
    """Return the lateral displacement of a box's points at heights from `low` to `high`.

    It has the means along u and v, and a bound of the distance from these [m]. `box` has centre and
    half sides.
    """
    if patch.texture < 0:
        return 0.0, 0.0, 0.0
    x, y, half_x, half_y = box
    radius = math.sqrt(half_x * half_x + half_y * half_y)
    size = textures.maps[patch.texture].max_abs_surface
    low, high = max(low, -size), min(high, size)
    middle, half = 0.5 * (low + high), 0.5 * max(high - low, 0.0)
    w_u, w_v, _, change, _, _ = plane_normal(patch, x, y, radius)
    near = half * math.sqrt(w_u * w_u + w_v * w_v) + max(abs(low), abs(high)) * change
    return middle * w_u, middle * w_v, near


@inner_kernel
def _lateral_bound(textures, patch, other, planes, box, under, heights, threshold):
    """Return an upper bound of overlaps deeper than `threshold` over a box, or `threshold`.

    Textures move points laterally in proportion to their height. At such overlaps both textures are
    high, which narrows the part of the other patch under the box, and excludes its high points
    elsewhere. `heights` has a bound of the overlap of the bases and the largest heights of both
    textures; `under` is the part of the other patch under the box.
    """
    smooth, high_x, high_y = heights
    up_x = planes.lift * lifting_height(patch, high_x)
    up_y = planes.other_lift * lifting_height(other, high_y)
    low_x = _least_height(patch, threshold - smooth - up_y, planes.lift)
    low_y = _least_height(other, threshold - smooth - up_x, planes.other_lift)
    if low_x > high_x or low_y > high_y:
        return threshold
    bx, by, reach_x, reach_y = under
    x_u, x_v, near_x = _displacement(textures, patch, low_x, high_x, box)
    y_u, y_v, near_y = _displacement(textures, other, low_y, high_y, under)
    margin = planes.shift - (near_x + near_y) / other.lateral_min
    if margin <= 0.0:
        return np.inf
    d_u, d_v = x_u - y_u, x_v - y_v
    i, j, k, m = entries(other.lateral_inverse)
    bx += i * d_u + j * d_v
    by += k * d_u + m * d_v
    reach_x, reach_y = reach_x - margin, reach_y - margin
    if beyond_straight_borders(other, 0, bx, by, reach_x, reach_y):
        return threshold
    if is_triplanar(other):
        high_y = _mapped_top(textures, other, bx, by, reach_x, reach_y)
    else:
        high_y = _planar_top(textures, other, bx, by, reach_x, reach_y)
    up_y = planes.other_lift * lifting_height(other, high_y)
    return max(smooth + up_x + up_y, threshold)


@small_kernel
def _combined(patch, other, planes, smooth, top, high_x, high_y):
    """Return the tighter of two bounds for textures with given largest heights.

    `smooth` bounds the overlap of the bases, `top` the sum of their largest heights.
    """
    high_x = lifting_height(patch, high_x)
    high_y = lifting_height(other, high_y)
    # No point is higher than the sum of the base's top and the highest texture.
    top = _sum_of_tops(patch, other, top, high_x, high_y)
    up_x, up_y = planes.lift * high_x, planes.other_lift * high_y
    return min(smooth + max(up_x, planes.valley) + max(up_y, planes.other_valley), top)


@small_kernel
def top_bound(textures, patch, other):
    """Return the sum of the largest heights of two patches, inf if it is unknown [m]."""
    high_x = lifting_height(patch, _patch_top(textures, patch))
    high_y = lifting_height(other, _patch_top(textures, other))
    return _sum_of_tops(patch, other, patch.base_top + other.base_top, high_x, high_y)


@small_kernel
def _sum_of_tops(patch, other, top, high_x, high_y):
    """Return the sum of the largest heights of two surfaces; `top` is that of their bases."""
    return top + _bound_rise(patch, high_x) + _bound_rise(other, high_y)


@small_kernel
def _bound_rise(patch, high):
    """Return an upper bound of a patch's rise above its base's top, from its largest height [m]."""
    if patch.bulge > 0.0:  # the normals of a sphere have unit length, and vary
        return max(high, 0.0)
    return high * (patch.normal[2] if patch.is_unit else patch.normal_rise)


@small_kernel
def _bound_over(textures, patch, other, planes, smooth, box, under):
    """Return an upper bound of the overlap over a box; `smooth` is that of the bases."""
    x, y, half_x, half_y = box
    bx, by, reach_x, reach_y = under
    slope, other_slope = patch.slope, other.slope
    top = patch.origin[2] + slope[0] * x + slope[1] * y
    top += abs(slope[0]) * half_x + abs(slope[1]) * half_y
    base = other.origin[2] + other_slope[0] * bx + other_slope[1] * by
    base += abs(other_slope[0]) * reach_x + abs(other_slope[1]) * reach_y
    top = min(top, patch.base_top) + min(base, other.base_top)
    high_x, high_y = _planar_top(textures, patch, *box), _planar_top(textures, other, *under)
    return _combined(patch, other, planes, smooth, top, high_x, high_y)


@inner_kernel
def bound_pair(textures, patch, other, search, candidate_out):
    """Fill an upper bound of the overlap of a candidate's patches, -inf without a common part.

    For planes, also fill the box of parameters over which they overlap, and the lifts.
    """
    candidate = candidate_out
    if patch.bulge > 0.0 or other.bulge > 0.0:
        candidate.bound = order_zero_bound(textures, patch, other)
        return
    candidate.bound = -np.inf
    polygon, shift = search.polygon, pair_shift(textures, patch, other)
    size = min(other.rectangle[1], other.rectangle[3]) * other.lateral_min
    if shift > _MIN_LATERAL * size and not (patch.is_unit and other.is_unit):
        # Where normals vary, the displacement in the window may be less than on the whole facet.
        x0, x1, y0, y1 = window_of(patch, other, shift)
        if not (x0 <= x1 and y0 <= y1):
            return
        whole = (0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (x1 - x0), 0.5 * (y1 - y0))
        shift = min(shift, lifts_within(textures, patch, other, whole).shift * other.lateral_min)
    count, at_zero, g_x, g_y = plane_overlap(patch, other, shift, polygon)
    if count == 0:
        return
    smooth = -np.inf
    x0, y0 = polygon[0, 0], polygon[0, 1]
    x1, y1 = x0, y0
    for j in range(count):
        x, y = polygon[j, 0], polygon[j, 1]
        smooth = max(smooth, at_zero + g_x * x + g_y * y)
        x0, x1, y0, y1 = min(x0, x), max(x1, x), min(y0, y), max(y1, y)
    sides = candidate.box
    sides[0], sides[1], sides[2], sides[3] = x0, x1, y0, y1
    box = (0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (x1 - x0), 0.5 * (y1 - y0))
    candidate.base_x, candidate.base_y = box[0], box[1]
    lifts = lifts_within(textures, patch, other, box)
    for n in range(5):
        candidate.lifts[n] = lifts[n]
    planes = planes_of(patch, other, lifts)
    under = under_box(planes, box)
    candidate.bound = _bound_over(textures, patch, other, planes, smooth, box, under)
    if is_triplanar(patch) or is_triplanar(other):
        high_x = _mapped_top(textures, patch, *box)
        high_y = _mapped_top(textures, other, *under)
        bound = _combined(patch, other, planes, smooth, np.inf, high_x, high_y)
        candidate.bound = min(candidate.bound, bound)
