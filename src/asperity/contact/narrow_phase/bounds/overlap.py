"""Upper bounds of the overlap over a box of chart X, which make the search's result a certificate.

Two bounds, of which the smaller counts.

*Of order zero.* The smooth bases are concave over one another, so tangent planes bound them; the
textures rise at most to the highest coefficient under the box.

*Of second order* (`second_order`): f is at most a quadratic round the middle of the box. Where
that is concave, so is f, and the tangent plane at its maximum within the charts' borders bounds
it (`closing`).
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.bounds.borders import HAIR, beside
from asperity.contact.narrow_phase.bounds.curvature import (
    SEEN,
    UNSEEN,
    less_base,
    point_bend,
    row_bend,
    second_order,
    shape_bend,
    third_order,
    with_third,
)
from asperity.contact.narrow_phase.bounds.texture import level_texture, roots_over, texture_over
from asperity.contact.narrow_phase.displaced_surface import parameters_under, root_at
from asperity.contact.narrow_phase.overlap import (
    ON_X,
    ON_Y,
    SLOPE_Y,
    F,
    X,
    over_level,
    overlap_at,
)
from asperity.contact.narrow_phase.surface_patch import (
    E_LEAST,
    EQ_LEAST,
    LEAST_ROOT,
    LEVEL,
    MAPPING,
    PLANAR,
    PZ,
    Q_LEAST,
    Q_MOST,
    QINV,
    RECTANGLE,
    SUMMIT,
    TEXTURE,
    C,
    E,
    O,
    Q,
)


@small_kernel
def _base(chart, x, y):
    """Return height, slopes by (x, y) of the smooth base; (x, y) is drawn into the ellipse."""
    if chart[C] > 0.0:
        out = x * (chart[E] * x + chart[E + 1] * y) + y * (chart[E + 1] * x + chart[E + 2] * y)
        most = 1.0 - 0.25 * chart[LEAST_ROOT] ** 2
        if out > most:
            scale = math.sqrt(most / out)
            x, y = x * scale, y * scale
    r, r_x, r_y, _, _, _ = root_at(chart, x, y)
    c = chart[C]
    z = chart[O + 2] + chart[PZ] * x + chart[PZ + 1] * y + c * r
    return z, chart[PZ] + c * r_x, chart[PZ + 1] + c * r_y, x, y


@small_kernel
def base_bound(cx, cy, ax, ay, x0, x1, y0, y1, shift):
    """Return an upper bound of the overlap of two smooth bases over a box, and Y's slope in it.

    The bound, -inf if there is no overlap, is that of two tangent planes; the slope over (u, v)
    is that of Y's. `(ax, ay)` is the place of their largest overlap, as far as known: the bound
    is sharp if the box contains it. `shift` is how far textures move points sideways [m].
    """
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    radius = math.sqrt(half_x * half_x + half_y * half_y)
    least_root = cx[LEAST_ROOT]
    _, most = roots_over(cx, x, y, radius)
    if cx[C] > 0.0 and most < least_root:
        return -np.inf, 0.0, 0.0
    # Where the box lies on Y.
    u, v = cx[O] + cx[Q] * x + cx[Q + 1] * y, cx[O + 1] + cx[Q + 2] * x + cx[Q + 3] * y
    bx, by = parameters_under(cy, u, v)
    moved = shift / cy[Q_LEAST]
    if cy[C] == 0.0:
        i, j, k, m = cy[QINV], cy[QINV + 1], cy[QINV + 2], cy[QINV + 3]
        reach_x = abs(i * cx[Q] + j * cx[Q + 2]) * half_x
        reach_x += abs(i * cx[Q + 1] + j * cx[Q + 3]) * half_y + moved
        reach_y = abs(k * cx[Q] + m * cx[Q + 2]) * half_x
        reach_y += abs(k * cx[Q + 1] + m * cx[Q + 3]) * half_y + moved
        if bx - reach_x > cy[RECTANGLE + 1] or bx + reach_x < cy[RECTANGLE]:
            return -np.inf, 0.0, 0.0
        if by - reach_y > cy[RECTANGLE + 3] or by + reach_y < cy[RECTANGLE + 2]:
            return -np.inf, 0.0, 0.0
    else:
        _, most = roots_over(cy, bx, by, radius * cx[Q_MOST] / cy[Q_LEAST] + moved)
        if most < cy[LEAST_ROOT]:
            return -np.inf, 0.0, 0.0
    tx, ty = min(max(ax, x0), x1), min(max(ay, y0), y1)
    z, z_x, z_y, px, py = _base(cx, tx, ty)
    total = z + z_x * (x - px) + z_y * (y - py)
    u, v = cx[O] + cx[Q] * tx + cx[Q + 1] * ty, cx[O + 1] + cx[Q + 2] * tx + cx[Q + 3] * ty
    qx, qy = parameters_under(cy, u, v)
    z, s_x, s_y, qx, qy = _base(cy, qx, qy)
    total += z + s_x * (bx - qx) + s_y * (by - qy)
    i, j, k, m = cy[QINV], cy[QINV + 1], cy[QINV + 2], cy[QINV + 3]
    g1, g2 = i * s_x + k * s_y, j * s_x + m * s_y
    z_x += g1 * cx[Q] + g2 * cx[Q + 2]
    z_y += g1 * cx[Q + 1] + g2 * cx[Q + 3]
    return total + abs(z_x) * half_x + abs(z_y) * half_y, g1, g2


@small_kernel
def _level_bound(textures, cx, cy, x0, x1, y0, y1, bound, enough, at):
    """Do the rest of `node_bound` for a textured plate under a smooth tool, the common case."""
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    high, _, kappa, _ = level_texture(textures, cx, x, y, half_x, half_y)
    bound += high
    if bound <= enough:
        return bound, UNSEEN, bound, 0.0
    over_level(textures, cx, cy, x, y, at)
    if at[F] == -np.inf:
        return bound, UNSEEN, bound, 0.0
    radius = math.sqrt(half_x * half_x + half_y * half_y)
    reach = radius * cx[Q_MOST] / cy[Q_LEAST]
    least, most = roots_over(cy, at[ON_X], at[ON_Y], reach)
    if cy[C] > 0.0 and least < 0.5 * cy[LEAST_ROOT]:
        return bound, SEEN, bound, 0.0
    m11, m12, m22 = kappa, 0.0, kappa
    if cy[C] > 0.0:
        q = (cx[Q], cx[Q + 1], cx[Q + 2], cx[Q + 3])
        m11, m12, m22 = less_base(cy, m11, m12, m22, most, q)
    loose = 0.5 * radius * radius * row_bend(cy, least)
    return second_order(m11, m12, m22, half_x, half_y, bound, loose, at)


@inner_kernel
def ball_bound(textures, cx, cy, ax, ay, box, enough, at):
    """Do `node_bound` for a smooth ball over a level textured plate, in a quarter of the time.

    `(ax, ay)` is where the ball is lowest, so its nearest place of the box has its lowest point.
    """
    x0, x1, y0, y1 = box
    dx, dy = max(x0 - ax, ax - x1, 0.0), max(y0 - ay, ay - y1, 0.0)
    left = 1.0 - cy[E] * (dx * dx + dy * dy)
    if left < cy[LEAST_ROOT] * cy[LEAST_ROOT]:
        return -np.inf, UNSEEN, 0.0, 0.0
    bound = cx[O + 2] + cy[O + 2] + cy[C] * math.sqrt(left)
    return _level_bound(textures, cx, cy, x0, x1, y0, y1, bound, enough, at)


@inner_kernel
def _general_bound(textures, cx, cy, box, bound, g1, g2, enough, work, at):
    """Do the rest of `node_bound` for any two charts; `(g1, g2)` is Y's slope in the box."""
    x0, x1, y0, y1 = box
    high, slope_x, bend_x, size_bend, wu, wv, wz, change, w1, w2, least, most = texture_over(
        textures, cx, x0, x1, y0, y1
    )
    side = min(math.sqrt(wu * wu + wv * wv) + change, 1.0)
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    radius = math.sqrt(half_x * half_x + half_y * half_y)
    size_x = textures.maps[int(cx[TEXTURE])].max_abs_height if cx[TEXTURE] >= 0.0 else 0.0
    size_y = textures.maps[int(cy[TEXTURE])].max_abs_height if cy[TEXTURE] >= 0.0 else 0.0
    # How fast the place in (u, v) moves, at most and at least, along a unit direction of X.
    drift = slope_x * side + size_x * w1
    fastest, slowest = cx[Q_MOST] + drift, max(cx[Q_LEAST] - drift, 0.0)
    shift_x = size_x * side
    level_y = cy[LEVEL] == 1.0 or cy[TEXTURE] < 0.0
    # The part of Y under the box.
    u, v = cx[O] + cx[Q] * x + cx[Q + 1] * y, cx[O + 1] + cx[Q + 2] * x + cx[Q + 3] * y
    bx, by = parameters_under(cy, u, v)
    reach = (radius * cx[Q_MOST] + shift_x + (0.0 if level_y else size_y)) / cy[Q_LEAST]
    high_y = slope_y = bend_y = size_bend_y = yu = yv = side_y = change_y = w1_y = w2_y = 0.0
    yz = 1.0
    if cy[TEXTURE] < 0.0:
        least_y, most_y = roots_over(cy, bx, by, reach)
    else:
        reach_x = reach_y = reach
        if level_y and shift_x == 0.0:
            i, j, k, m = cy[QINV], cy[QINV + 1], cy[QINV + 2], cy[QINV + 3]
            reach_x = abs(i * cx[Q] + j * cx[Q + 2]) * half_x
            reach_x += abs(i * cx[Q + 1] + j * cx[Q + 3]) * half_y
            reach_y = abs(k * cx[Q] + m * cx[Q + 2]) * half_x
            reach_y += abs(k * cx[Q + 1] + m * cx[Q + 3]) * half_y
        (
            high_y,
            slope_y,
            bend_y,
            size_bend_y,
            yu,
            yv,
            yz,
            change_y,
            w1_y,
            w2_y,
            least_y,
            most_y,
        ) = texture_over(textures, cy, bx - reach_x, bx + reach_x, by - reach_y, by + reach_y)
        side_y = min(math.sqrt(yu * yu + yv * yv) + change_y, 1.0)
    steepness = math.sqrt(1.0 + g1 * g1 + g2 * g2)
    if cx[TEXTURE] >= 0.0:
        # A point of X rises by t (w + its sideways part times Y's slope).
        along, spread = wz + g1 * wu + g2 * wv, steepness * change
        rise = high * (along + spread if high > 0.0 else max(along - spread, 0.0))
        bound += max(rise, size_x * (spread - along))
    if cy[TEXTURE] >= 0.0:
        # Y stays below its tangent plane, moved along its normal.
        bound += high_y * (steepness if high_y > 0.0 else max(1.0 - change_y, 0.0))
    if cx[SUMMIT] < np.inf and cy[SUMMIT] < np.inf:
        # No point is higher than that of the base which it was, and its texture's highest.
        top = cx[O + 2] + cx[PZ] * x + cx[PZ + 1] * y
        top += abs(cx[PZ]) * half_x + abs(cx[PZ + 1]) * half_y
        bound = min(bound, min(top, cx[SUMMIT]) + cy[SUMMIT] + max(high, 0.0) + max(high_y, 0.0))
    if bound <= enough:
        return bound, UNSEEN, bound, 0.0
    overlap_at(textures, cx, cy, x, y, work, at)
    # What Y's texture moves sideways is known only where there is a point.
    astray = 0.0 if level_y else (size_y if at[F] == -np.inf else 3.0 * size_y)
    if at[X] == at[X] and beside(cy, at[ON_X], at[ON_Y], (radius * fastest + astray) / cy[Q_LEAST]):
        return -np.inf, UNSEEN, 0.0, 0.0
    if at[F] == -np.inf:
        # Y's surface hangs over there, as seen along n: it is not rendered.
        return (bound if radius > HAIR else -np.inf), UNSEEN, bound, 0.0
    if cy[TEXTURE] >= 0.0 and not level_y:
        # The place under the middle is known now: a narrower part of Y will do.
        closest = cy[Q_LEAST] - (slope_y * side_y + size_y * w1_y)
        if closest > 0.0:
            bx, by = at[ON_X], at[ON_Y]
            reach_x = min(reach_x, radius * fastest / closest)
            (
                high_y,
                slope_y,
                bend_y,
                size_bend_y,
                yu,
                yv,
                yz,
                change_y,
                w1_y,
                w2_y,
                least_y,
                most_y,
            ) = texture_over(textures, cy, bx - reach_x, bx + reach_x, by - reach_x, by + reach_x)
            side_y = min(math.sqrt(yu * yu + yv * yv) + change_y, 1.0)
    if (cx[C] > 0.0 and least < 0.5 * cx[LEAST_ROOT]) or (
        cy[C] > 0.0 and least_y < 0.5 * cy[LEAST_ROOT]
    ):
        return (bound if radius > HAIR else at[F]), SEEN, bound, 0.0
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
        turn_y = (
            point_bend(textures, cy, least_y, slope_y, size_bend_y, w1_y, w2_y, 1.0)
            * radius
            * fastest
        )
        turn_y *= (1.0 + math.sqrt(g1 * g1 + g2 * g2)) / (closest * closest)
    steepness = math.sqrt(1.0 + g1 * g1 + g2 * g2) + turn_y
    if cx[TEXTURE] >= 0.0:
        facing, spread = wz + g1 * wu + g2 * wv, steepness * change + turn_y * side
        kappa = shape_bend(
            textures, cx, bend_x, size_bend, slope_x, w1, w2, facing, spread, steepness
        )
    m11 = m12 = m22 = kappa
    m12 = 0.0
    if cx[C] > 0.0:
        c = cx[C] / most
        m11, m12, m22 = m11 - c * cx[E], m12 - c * cx[E + 1], m22 - c * cx[E + 2]
    if cy[TEXTURE] < 0.0:
        if cy[C] > 0.0:
            c = cy[C] / most_y
            if shift_x == 0.0:
                q = (cx[Q], cx[Q + 1], cx[Q + 2], cx[Q + 3])
                m11, m12, m22 = less_base(cy, m11, m12, m22, most_y, q)
            else:
                less = c * cy[EQ_LEAST] * slowest * slowest
                m11, m22 = m11 - less, m22 - less
    else:
        facing, spread = yz - g1 * yu - g2 * yv, steepness * change_y + turn_y * side_y
        bend = shape_bend(
            textures, cy, bend_y, size_bend_y, slope_y, w1_y, w2_y, facing, spread, steepness
        )
        if cy[C] > 0.0:
            bend -= cy[C] / most_y * cy[E_LEAST]
        ratio = fastest / closest if bend > 0.0 else slowest / widest
        bend *= ratio * ratio
        m11, m22 = m11 + bend, m22 + bend
    # How much the borders, taken as straight lines, may be off.
    loose = row_bend(cx, least) + row_bend(cy, least_y)
    if side > 0.0:
        bend = point_bend(textures, cx, least, slope_x, size_bend, w1, w2, side)
        loose += bend / cy[Q_LEAST]
    if side_y > 0.0:
        ratio = fastest / closest
        loose += (
            point_bend(textures, cy, least_y, slope_y, size_bend_y, w1_y, w2_y, side_y)
            * ratio
            * ratio
        )
    loose *= 0.5 * radius * radius
    found = second_order(m11, m12, m22, half_x, half_y, bound, loose, at)
    if cx[C] > 0.0 or cy[C] > 0.0 or closest == 0.0:
        return found
    third = radius * third_order(
        textures, cx, cy, (size_x, slope_x, size_bend, w1, w2),
        (size_y, slope_y, size_bend_y, w1_y, w2_y), side, side_y, fastest, closest,
    )  # fmt: skip
    return with_third(found, third, half_x, half_y, bound, loose, at)


@inner_kernel
def node_bound(textures, cx, cy, ax, ay, box, shift, enough, work, at):
    """Return an upper bound of the overlap over a box, and what `sharpest_bound` needs.

    Returns
    -------
    tuple
        The bound; whether the middle was looked at, and how f was bounded: UNSEEN, SEEN, BOUNDED
        to the second order, or CONCAVE; the bound without f's rise along the tangent plane; how
        much borders may be off.

    Once the bound falls to `enough` it is not sharpened. Where the middle was looked at, `at`
    (28,) is filled as by `overlap_at`; it may lie beyond a border.
    """
    x0, x1, y0, y1 = box
    bound, g1, g2 = base_bound(cx, cy, ax, ay, x0, x1, y0, y1, shift)
    if bound == -np.inf:
        return bound, UNSEEN, bound, 0.0
    if cx[LEVEL] == 1.0 and cx[MAPPING] == PLANAR and cx[TEXTURE] >= 0.0 and cy[TEXTURE] < 0.0:
        return _level_bound(textures, cx, cy, x0, x1, y0, y1, bound, enough, at)
    return _general_bound(textures, cx, cy, box, bound, g1, g2, enough, work, at)
