"""Upper bounds of the overlap of two plane patches over a small box.

The best-first search has an order-zero bound already, so f is evaluated at the centre of the box,
and only slopes and curvatures of the textures are looked up.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.bounds.borders import is_apart
from asperity.contact.narrow_phase.bounds.compliance import lowering_over
from asperity.contact.narrow_phase.bounds.curvature import (
    FINEST_OVERHANG,
    UNEVALUATED,
    box_bound,
    curvature_bound,
    drift_of,
)
from asperity.contact.narrow_phase.bounds.plane_pairs import lifting_height
from asperity.contact.narrow_phase.bounds.planes import bound_lift, bound_valley_rise
from asperity.contact.narrow_phase.bounds.sheets import largest_slope, nearby, over_box
from asperity.contact.narrow_phase.bounds.texture import smooth_bounds
from asperity.contact.narrow_phase.outermost import highest_over, may_fold
from asperity.contact.narrow_phase.overlap import overlap_at
from asperity.contact.narrow_phase.plane_boxes import lateral_shift, plane_normal, texture_size
from asperity.contact.narrow_phase.smooth_base import parameters_at, parameters_over
from asperity.contact.narrow_phase.surface_patch import entries


@small_kernel
def _narrow_part(textures, other, box, travel, at):
    """Return the part of the other plane under a box, including its own texture's displacement.

    `box` is the part without it. The part is narrower by the slopes over all points it may contain:
    the point under the centre is known, and others are within `travel` of it in (u, v).
    """
    x, y, reach_x, reach_y = box
    size = texture_size(textures, other)
    reach_x, reach_y = reach_x + size / other.lateral_min, reach_y + size / other.lateral_min
    far = math.sqrt(reach_x * reach_x + reach_y * reach_y)
    u, v, _, change, normal_slope, normal_bend = plane_normal(other, x, y, far)
    lateral = min(math.sqrt(u * u + v * v) + change, 1.0)
    slope = largest_slope(textures, other, (x, y, reach_x, reach_y), normal_slope, normal_bend)
    closest = other.lateral_min - (slope * lateral + size * normal_slope)
    narrow = travel / closest if closest > 0.0 else np.inf
    if narrow < far:
        return at.other_x, at.other_y, narrow, narrow
    return x, y, reach_x, reach_y


@inner_kernel
def _bound_below_highest(textures, patch, other, over, half, under, highest, search):
    """Return a bound of the overlap over a box where the other texture is not above `highest`.

    `over` bounds the first texture over the box, `half` are the half sides of that, and `under` is
    the part of the other patch's base under it, around that of the centre. `search.surface` is the
    point at the centre, so that the bound converges with the size of the box, in spite of the
    points' displacement.
    """
    half_x, half_y = half
    s_x, s_y = other.slope[0], other.slope[1]
    i, j, k, m = entries(other.lateral_inverse)
    g1, g2 = i * s_x + k * s_y, j * s_x + m * s_y
    bound = search.surface.p[2] + other.origin[2] + s_x * under[0] + s_y * under[1]
    _, b1, b2, _, c1, c2 = parameters_over(patch, other)
    bound += abs(patch.slope[0] + s_x * b1 + s_y * c1) * half_x
    bound += abs(patch.slope[1] + s_x * b2 + s_y * c2) * half_y
    if patch.texture >= 0:
        turned = texture_size(textures, patch) * over.normal_slope
        steepness = math.sqrt(1.0 + g1 * g1 + g2 * g2)
        bound += math.sqrt(half_x * half_x + half_y * half_y) * steepness * (over.slope + turned)
    lift, least, _ = bound_lift(other, under, -g1, -g2)
    rise = lift * lifting_height(other, highest)
    return bound + max(rise, bound_valley_rise(textures, other, least))


@inner_kernel
def plane_bound(textures, pair, box, bound, search):
    """Return the `general_bound` of two plane patches with the order-zero bound `bound`."""
    patch, other, at = pair.patch, pair.other, search.at
    x0, x1, y0, y1 = box
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    radius = math.sqrt(half_x * half_x + half_y * half_y)
    is_explicit = other.is_level or other.texture < 0
    over = over_other = smooth_bounds(0.0, 1.0, 1.0)
    if patch.texture >= 0:
        over = over_box(textures, patch, x, y, half_x, half_y)
    drift = drift_of(textures, patch, over)
    fastest = patch.lateral_max + drift
    overlap_at(textures, patch, other, x, y, search, at)
    # The centre's point on the other base; those of all points over the box are around it.
    base_x, base_y = at.other_x, at.other_y
    if not is_explicit:
        base_x, base_y = parameters_at(other, search.surface.p[0], search.surface.p[1])
    reach = (radius * fastest + lateral_shift(textures, other)) / other.lateral_min
    if is_apart(other, base_x, base_y, reach):
        return box_bound(-np.inf, UNEVALUATED, 0.0, 0.0)
    closest, highest, folds = 0.0, np.inf, may_fold(textures, other)
    under = (base_x, base_y, 0.0, 0.0)
    if other.texture >= 0:
        _, b1, b2, _, c1, c2 = parameters_over(patch, other)
        astray = drift * radius / other.lateral_min
        reach_x = abs(b1) * half_x + (abs(b2) * half_y + astray)
        reach_y = abs(c1) * half_x + (abs(c2) * half_y + astray)
        under = (base_x, base_y, reach_x, reach_y)
    if folds:
        highest = highest_over(textures, other, under)
        if highest == -np.inf:
            return box_bound(-np.inf, UNEVALUATED, 0.0, 0.0)
        if search.load == 0.0:
            below = _bound_below_highest(
                textures, patch, other, over, (half_x, half_y), under, highest, search
            )
            bound = min(bound, below)
    if at.f == -np.inf:
        # The other surface overhangs there along n: it has no height.
        left = bound if radius > FINEST_OVERHANG else -np.inf
        return box_bound(left, UNEVALUATED, bound, 0.0)
    if other.texture >= 0:
        if not is_explicit:
            under = _narrow_part(textures, other, under, radius * fastest, at)
        over_other = over_box(textures, other, *under)
        if folds and drift_of(textures, other, over_other) >= other.lateral_min:
            near, closest, far = nearby(textures, other, radius * fastest, highest, search)
            if closest > 0.0:
                over_other = near
                if is_apart(other, at.other_x, at.other_y, far):
                    return box_bound(-np.inf, UNEVALUATED, 0.0, 0.0)
    bend = lowering_over(textures, patch, other, box, search)[1] if search.load > 0.0 else 0.0
    half = (half_x, half_y, bend, closest)
    return curvature_bound(textures, patch, other, over, over_other, half, bound, at)
