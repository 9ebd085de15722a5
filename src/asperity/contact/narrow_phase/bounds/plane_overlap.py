"""Upper bounds of the overlap of two plane charts over a small box: `bound` without curvature.

The sieve has bounded the overlap to order zero before it asks for this, so the middle of the box
is looked at right away, and only slopes and bends of the textures are looked up.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.bounds.borders import HAIR, beside
from asperity.contact.narrow_phase.bounds.curvature import (
    SEEN,
    UNSEEN,
    point_bend,
    second_order,
    shape_bend,
    third_order,
    with_third,
)
from asperity.contact.narrow_phase.bounds.texture import (
    plane_normal,
    sideways,
    slopes_on_plane,
    slopes_on_three,
)
from asperity.contact.narrow_phase.displaced_surface import parameters_under
from asperity.contact.narrow_phase.overlap import ON_X, ON_Y, POINT, SLOPE_Y, F, overlap_at
from asperity.contact.narrow_phase.surface_patch import (
    LEVEL,
    MAPPING,
    PLANAR,
    Q_LEAST,
    Q_MOST,
    QINV,
    TEXTURE,
    UV_MOST,
    Q,
)


@small_kernel
def _slopes_over(textures, chart, x, y, half_x, half_y, w1, w2):
    """Return the largest slope, the largest bend and its size, of a texture over a box."""
    if chart[MAPPING] == PLANAR:
        return slopes_on_plane(textures, chart, x, y, half_x, half_y)
    return slopes_on_three(textures, chart, x, y, half_x, half_y, w1, w2)


@small_kernel
def _largest_slope(textures, chart, x, y, half_x, half_y, w1, w2):
    """Return what no slope over a box is above: of the whole texture where no table is needed."""
    if chart[MAPPING] == PLANAR:
        return textures.maps[int(chart[TEXTURE])].max_slope * chart[UV_MOST]
    return slopes_on_three(textures, chart, x, y, half_x, half_y, w1, w2)[0]


@inner_kernel
def plane_bound(textures, cx, cy, box, bound, enough, work, at):
    """Do `node_bound` for two plane charts, of which `bound` is known."""
    x0, x1, y0, y1 = box
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    radius = math.sqrt(half_x * half_x + half_y * half_y)
    rough_x, rough_y = cx[TEXTURE] >= 0.0, cy[TEXTURE] >= 0.0
    level_y = cy[LEVEL] == 1.0 or not rough_y
    size_x = textures.maps[int(cx[TEXTURE])].max_abs_height if rough_x else 0.0
    size_y = textures.maps[int(cy[TEXTURE])].max_abs_height if rough_y else 0.0
    slope_x = bend_x = size_bend = wu = wv = change = w1 = w2 = side = 0.0
    wz = 1.0
    if rough_x:
        wu, wv, wz, change, w1, w2 = plane_normal(cx, x, y, radius)
        slope_x, bend_x, size_bend = _slopes_over(textures, cx, x, y, half_x, half_y, w1, w2)
        side = min(math.sqrt(wu * wu + wv * wv) + change, 1.0)
    # How fast the place in (u, v) moves, at most and at least, along a unit direction of X.
    drift = slope_x * side + size_x * w1
    fastest, slowest = cx[Q_MOST] + drift, max(cx[Q_LEAST] - drift, 0.0)
    overlap_at(textures, cx, cy, x, y, work, at)
    # The middle's place on Y's base, round which are those of all points over the box.
    base_x, base_y = at[ON_X], at[ON_Y]
    if not level_y and at[F] > -np.inf:
        base_x, base_y = parameters_under(cy, at[POINT], at[POINT + 1])
    if beside(cy, base_x, base_y, (radius * fastest + sideways(textures, cy)) / cy[Q_LEAST]):
        return -np.inf, UNSEEN, 0.0, 0.0
    if at[F] == -np.inf:
        # Y's surface hangs over there, as seen along n: it is not rendered.
        return (bound if radius > HAIR else -np.inf), UNSEEN, bound, 0.0
    slope_y = bend_y = size_bend_y = yu = yv = side_y = change_y = w1_y = w2_y = 0.0
    yz = 1.0
    if rough_y:
        i, j, k, m = cy[QINV], cy[QINV + 1], cy[QINV + 2], cy[QINV + 3]
        astray = drift * radius / cy[Q_LEAST]
        bx, by = base_x, base_y
        reach_x = abs(i * cx[Q] + j * cx[Q + 2]) * half_x
        reach_x += abs(i * cx[Q + 1] + j * cx[Q + 3]) * half_y + astray
        reach_y = abs(k * cx[Q] + m * cx[Q + 2]) * half_x
        reach_y += abs(k * cx[Q + 1] + m * cx[Q + 3]) * half_y + astray
        if not level_y:
            # Y's own texture moves its points too. With the slopes of where they may be at most
            # that is a narrower part.
            reach_x, reach_y = reach_x + size_y / cy[Q_LEAST], reach_y + size_y / cy[Q_LEAST]
            far = math.sqrt(reach_x * reach_x + reach_y * reach_y)
            yu, yv, yz, change_y, w1_y, w2_y = plane_normal(cy, bx, by, far)
            side_y = min(math.sqrt(yu * yu + yv * yv) + change_y, 1.0)
            slope_y = _largest_slope(textures, cy, bx, by, reach_x, reach_y, w1_y, w2_y)
            closest = cy[Q_LEAST] - (slope_y * side_y + size_y * w1_y)
            narrow = radius * fastest / closest if closest > 0.0 else np.inf
            if narrow < far:
                bx, by, reach_x, reach_y = at[ON_X], at[ON_Y], narrow, narrow
        yu, yv, yz, change_y, w1_y, w2_y = plane_normal(
            cy, bx, by, math.sqrt(reach_x * reach_x + reach_y * reach_y)
        )
        side_y = min(math.sqrt(yu * yu + yv * yv) + change_y, 1.0)
        slope_y, bend_y, size_bend_y = _slopes_over(
            textures, cy, bx, by, reach_x, reach_y, w1_y, w2_y
        )
    # f'' <= d^T M d.
    kappa = 0.0
    drift_y = slope_y * side_y + size_y * w1_y
    closest, widest = max(cy[Q_LEAST] - drift_y, 0.0), cy[Q_MOST] + drift_y
    g1, g2 = at[SLOPE_Y], at[SLOPE_Y + 1]
    # How much Y's slope changes over the box.
    turn_y = 0.0
    if side > 0.0 or side_y > 0.0:
        if closest == 0.0:
            return (bound if radius > HAIR else at[F]), SEEN, bound, 0.0
        turn_y = point_bend(textures, cy, 1.0, slope_y, size_bend_y, w1_y, w2_y, 1.0)
        turn_y *= radius * fastest * (1.0 + math.sqrt(g1 * g1 + g2 * g2)) / (closest * closest)
    steepness = math.sqrt(1.0 + g1 * g1 + g2 * g2) + turn_y
    if rough_x:
        facing, spread = wz + g1 * wu + g2 * wv, steepness * change + turn_y * side
        kappa = shape_bend(
            textures, cx, bend_x, size_bend, slope_x, w1, w2, facing, spread, steepness
        )
    if rough_y:
        facing, spread = yz - g1 * yu - g2 * yv, steepness * change_y + turn_y * side_y
        bend = shape_bend(
            textures, cy, bend_y, size_bend_y, slope_y, w1_y, w2_y, facing, spread, steepness
        )
        ratio = fastest / closest if bend > 0.0 else slowest / widest
        kappa += bend * ratio * ratio
    # How much the borders, taken as straight lines, may be off.
    loose = 0.0
    if side > 0.0:
        loose += point_bend(textures, cx, 1.0, slope_x, size_bend, w1, w2, side) / cy[Q_LEAST]
    if side_y > 0.0:
        ratio = fastest / closest
        loose += (
            point_bend(textures, cy, 1.0, slope_y, size_bend_y, w1_y, w2_y, side_y) * ratio * ratio
        )
    loose *= 0.5 * radius * radius
    found = second_order(kappa, 0.0, kappa, half_x, half_y, bound, loose, at)
    if closest == 0.0:
        return found
    third = radius * third_order(
        textures, cx, cy, (size_x, slope_x, size_bend, w1, w2),
        (size_y, slope_y, size_bend_y, w1_y, w2_y), side, side_y, fastest, closest,
    )  # fmt: skip
    return with_third(found, third, half_x, half_y, bound, loose, at)
