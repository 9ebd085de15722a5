r"""Upper bounds of the overlap over a box of chart X, which make the search's result a certificate.

Two bounds, of which the smaller counts.

*Of order zero.* The smooth bases are concave over one another, so tangent planes bound them; the
textures rise at most to the highest coefficient under the box.

*Of second order.* Along a unit direction of X's parameters, with `G = (slope of Y, 1)`,

    f'' = G.base'' + t'' (G.w) + 2 t' (G.w') + t (G.w'') + K[q', q'],

K the curvature of Y's height over (u, v), for which the same expression holds with Y's own
parameters and `(-slope, 1)`. The bases' parts are concave and kept as matrices; every texture's
t, t', t'' are bounded by its pyramid, w' and w'' by the base's curvature. The sum is a matrix M
with `f <= f(c) + f'(c) d + d^T M d / 2` all over the box; where M is negative definite, f is
concave, and the tangent plane at its maximum within the charts' borders bounds it.
"""

from __future__ import annotations

import math

import numpy as np

from asperity.compiled import inner_kernel, small_kernel
from asperity.contact.chart import (
    B0,
    B1,
    B2,
    B3,
    CYLINDRICAL,
    E_LEAST,
    E_MOST,
    EQ,
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
    ROUND,
    STRETCH,
    TEXTURE,
    UNIT,
    UV_LEAST,
    UV_MOST,
    UV_ROOT,
    V0,
    V1,
    V2,
    V3,
    W0,
    C,
    E,
    O,
    Q,
)
from asperity.contact.climb import climb
from asperity.contact.overlap import (
    BORDER_SIZE,
    F_X,
    F_Y,
    MAX_BORDERS,
    ON_X,
    ON_Y,
    OVERLAP_SIZE,
    SLOPE_Y,
    F,
    X,
    Y,
    borders_at,
    overlap_at,
    steepest_rise,
)
from asperity.contact.surface import parameters_under, root_at
from asperity.texture.packed import texture_bounds

# Of the triplanar weights: sums of the sizes of their first and second derivatives by the unit
# normal, largest over the sphere.
_WEIGHTS_1, _WEIGHTS_2 = 4.2, 14.0
NOWHERE = (-np.inf, 0.0, 0.0, -np.inf, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0)


@small_kernel
def _roots_over(chart, x, y, radius):
    """Return the least and the largest root within `radius` of (x, y); the least may be -1."""
    if chart[C] == 0.0:
        return 1.0, 1.0
    square = x * (chart[E] * x + chart[E + 1] * y) + y * (chart[E + 1] * x + chart[E + 2] * y)
    out, reach = math.sqrt(max(square, 0.0)), math.sqrt(chart[E_MOST]) * radius
    near, far = max(out - reach, 0.0), out + reach
    most = math.sqrt(1.0 - near * near) if near < 1.0 else -1.0
    return (math.sqrt(1.0 - far * far) if far < 1.0 else -1.0), most


@inner_kernel
def texture_over(textures, chart, x0, x1, y0, y1):
    """Return bounds of a chart's texture and normal over a box of its parameters.

    Returns
    -------
    tuple of 12 floats
        Highest t; size of t'; largest t'' and its size; w along u, v and z at the middle, and how much it
        changes over the box; sizes of w' and w''; least and most root. Derivatives are along
        unit directions of the chart's parameters. Roots are -1 outside the ellipse.
    """
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    radius = math.sqrt(half_x * half_x + half_y * half_y)
    least, most = _roots_over(chart, x, y, radius)
    if most <= 0.0:
        return -np.inf, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0, -1.0
    textured = chart[TEXTURE] >= 0.0
    if not textured:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, least, most
    k = int(chart[TEXTURE])
    mapping = chart[MAPPING]
    curved = chart[C] > 0.0
    low = max(least, 0.5 * chart[LEAST_ROOT])
    if chart[LEVEL] == 1.0 and mapping == PLANAR:
        ru = abs(chart[B1]) * half_x + abs(chart[B2]) * half_y
        rv = abs(chart[B1 + 1]) * half_x + abs(chart[B2 + 1]) * half_y
        u = chart[B0] + chart[B1] * x + chart[B2] * y
        v = chart[B0 + 1] + chart[B1 + 1] * x + chart[B2 + 1] * y
        high, slope, bend = texture_bounds(textures, k, u - ru, u + ru, v - rv, v + rv)
        bend *= chart[UV_MOST] ** 2 if bend > 0.0 else chart[UV_LEAST] ** 2
        size_bend = textures.scales[k, 4] * chart[UV_MOST] ** 2
        slope *= chart[UV_MOST]
        return high, slope, bend, size_bend, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0
    # The root's first and second derivative, and the normal's.
    r1 = r2 = w1 = w2 = 0.0
    if curved:
        r1 = math.sqrt(chart[E_MOST] * max(1.0 - low * low, 0.0)) / low
        r2 = chart[E_MOST] / (low * low * low)
        w1 = chart[STRETCH] * math.sqrt(chart[E_MOST]) / low
        w2 = chart[STRETCH] * r2
        if chart[UNIT] == 0.0:
            w2 += 3.0 * w1 * w1
    # A place to take the normal at; its change over the box is bounded.
    scale = 1.0
    if curved and least < 0.0:
        out = x * (chart[E] * x + chart[E + 1] * y) + y * (chart[E + 1] * x + chart[E + 2] * y)
        scale = min(1.0, math.sqrt((1.0 - low * low) / max(out, 1e-300)))
    wx, wy = x * scale, y * scale
    root = root_at(chart, wx, wy)[0]
    side_u = chart[V0] + chart[V1] * wx + chart[V2] * wy + chart[V3] * root
    side_v = chart[V0 + 1] + chart[V1 + 1] * wx + chart[V2 + 1] * wy + chart[V3 + 1] * root
    up = chart[V0 + 2] + chart[V1 + 2] * wx + chart[V2 + 2] * wy + chart[V3 + 2] * root
    size = math.sqrt(side_u * side_u + side_v * side_v + up * up)
    change = w1 * (radius + (1.0 - scale) * math.sqrt(x * x + y * y))
    side_u, side_v, up = side_u / size, side_v / size, up / size
    if mapping == CYLINDRICAL:
        R, sense = chart[ROUND], chart[ROUND + 2]
        a0 = R * math.asin(min(max(y0 / R, -1.0), 1.0))
        a1 = R * math.asin(min(max(y1 / R, -1.0), 1.0))
        if sense < 0.0:
            a0, a1 = -a1, -a0
        low_root = max(least, 0.0)
        lean0, lean1 = chart[ROUND + 4] * low_root, chart[ROUND + 4] * most
        v = chart[ROUND + 3]
        high, slope, bend = texture_bounds(
            textures, k, chart[ROUND + 1] + a0, chart[ROUND + 1] + a1,
            v + x0 + min(lean0, lean1), v + x1 + max(lean0, lean1),
        )  # fmt: skip
        reach = 1.0 + chart[UV_ROOT] * r1
        speed = math.sqrt(1.0 / (low * low) + reach * reach)
        turn = chart[UV_ROOT] * r2 + math.sqrt(max(1.0 - low * low, 0.0)) / (R * low * low * low)
        slowest = 0.0
    else:
        high, slope, bend = -np.inf, 0.0, -np.inf
        middle = 0.5 * (most + max(least, 0.0))
        half_root = 0.5 * (most - max(least, 0.0))
        for i in range(3 if mapping != PLANAR else 1):
            one, two = (0, 1) if mapping == PLANAR else ((i + 1) % 3, (i + 2) % 3)
            if mapping != PLANAR and not curved and chart[W0 + i] ** 4 < 1e-12:
                continue
            u = chart[B0 + one] + chart[B1 + one] * x + chart[B2 + one] * y
            u += chart[B3 + one] * middle
            v = chart[B0 + two] + chart[B1 + two] * x + chart[B2 + two] * y
            v += chart[B3 + two] * middle
            ru = abs(chart[B1 + one]) * half_x + abs(chart[B2 + one]) * half_y
            ru += abs(chart[B3 + one]) * half_root
            rv = abs(chart[B1 + two]) * half_x + abs(chart[B2 + two]) * half_y
            rv += abs(chart[B3 + two]) * half_root
            h, s, b = texture_bounds(textures, k, u - ru, u + ru, v - rv, v + rv)
            high, slope, bend = max(high, h), max(slope, s), max(bend, b)
        speed = chart[UV_MOST] + chart[UV_ROOT] * r1
        turn = chart[UV_ROOT] * r2
        slowest = max(chart[UV_LEAST] - chart[UV_ROOT] * r1, 0.0)
    bend = bend * (speed * speed if bend > 0.0 else slowest * slowest) + slope * turn
    size_bend = textures.scales[k, 4] * speed * speed + slope * turn
    slope *= speed
    if mapping != PLANAR and mapping != CYLINDRICAL and curved:
        size = textures.scales[k, 2]
        mixing = 2.0 * _WEIGHTS_1 * w1 * slope
        mixing += (_WEIGHTS_2 * w1 * w1 + _WEIGHTS_1 * w2) * size
        bend += mixing
        size_bend += mixing
        slope += _WEIGHTS_1 * w1 * size
    return high, slope, bend, size_bend, side_u, side_v, up, change, w1, w2, least, most


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
    is that of Y's. `(ax, ay)` is the place of their largest overlap, as far as known: the bound is sharp if the
    box contains it. `shift` is how far textures move points sideways [m].
    """
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    radius = math.sqrt(half_x * half_x + half_y * half_y)
    least_root = cx[LEAST_ROOT]
    _, most = _roots_over(cx, x, y, radius)
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
        _, most = _roots_over(cy, bx, by, radius * cx[Q_MOST] / cy[Q_LEAST] + moved)
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
def _row_bend(chart, least):
    """Return how much a border that is not convex bends within a box."""
    if chart[C] == 0.0:
        return 0.0
    low = max(least, 0.5 * chart[LEAST_ROOT])
    return chart[C] * chart[E_MOST] / (low * low * low)


@small_kernel
def _shape_bend(
    textures, chart, bend_t, size_bend, slope_t, w1, w2, facing, spread, steepness
):  # fmt: skip
    """Return the part of f'' that a texture makes.

    `facing` is G.w at the middle, and `spread` how much it changes over the box.
    """
    most, least = facing + spread, facing - spread
    if bend_t >= 0.0:
        bend = bend_t * max(most, 0.0)
    else:
        bend = bend_t * max(least, 0.0)
    if least < 0.0:
        # Seen from behind: there the texture's hollows bend outwards.
        bend = max(bend, 0.0) - least * size_bend
    size = textures.scales[int(chart[TEXTURE]), 2]
    return bend + (2.0 * slope_t * w1 + size * w2) * steepness


@small_kernel
def _point_bend(textures, chart, least, slope, size_bend, w1, w2):
    """Return a bound of |p''|, the bend of a chart's surface as its parameters are walked over."""
    bend = _row_bend(chart, least)
    if chart[TEXTURE] >= 0.0:
        bend += size_bend + 2.0 * slope * w1
        bend += textures.scales[int(chart[TEXTURE]), 2] * w2
    return bend


@small_kernel
def _beside(cy, at, reach, unknown):
    """Return whether nothing of Y lies within `reach` of the place in (u, v) that `at` has.

    `unknown` is how far Y's texture moves points sideways, where the point is not known.
    """
    reach = (reach + (unknown if at[F] == -np.inf else 3.0 * unknown)) / cy[Q_LEAST]
    x, y = at[ON_X], at[ON_Y]
    if cy[C] > 0.0:
        _, most = _roots_over(cy, x, y, reach)
        return most < cy[LEAST_ROOT]
    out_x = max(cy[RECTANGLE] - x, x - cy[RECTANGLE + 1])
    out_y = max(cy[RECTANGLE + 2] - y, y - cy[RECTANGLE + 3])
    return max(out_x, out_y) > reach


@inner_kernel
def node_bound(textures, cx, cy, ax, ay, box, shift, enough, best, mine, work, at):
    """Return (upper bound of the overlap over a box, whether `at` holds a place within it).

    `best` (22,) is the deepest place so far, `mine` whether it is on this pair of charts.
    Once the bound falls to `enough` it is not sharpened. Where a place was looked at, `at` (22,)
    is filled as by `overlap_at`, and the place is within the borders.
    """
    x0, x1, y0, y1 = box
    bound, g1, g2 = base_bound(cx, cy, ax, ay, x0, x1, y0, y1, shift)
    if bound == -np.inf:
        return bound, False
    high, slope_x, bend_x, size_bend, wu, wv, wz, change, w1, w2, least, most = texture_over(
        textures, cx, x0, x1, y0, y1
    )
    side = min(math.sqrt(wu * wu + wv * wv) + change, 1.0)
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    radius = math.sqrt(half_x * half_x + half_y * half_y)
    size_x = textures.scales[int(cx[TEXTURE]), 2] if cx[TEXTURE] >= 0.0 else 0.0
    size_y = textures.scales[int(cy[TEXTURE]), 2] if cy[TEXTURE] >= 0.0 else 0.0
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
        least_y, most_y = _roots_over(cy, bx, by, reach)
    else:
        reach_x = reach_y = reach
        if level_y and shift_x == 0.0:
            i, j, k, m = cy[QINV], cy[QINV + 1], cy[QINV + 2], cy[QINV + 3]
            reach_x = abs(i * cx[Q] + j * cx[Q + 2]) * half_x
            reach_x += abs(i * cx[Q + 1] + j * cx[Q + 3]) * half_y
            reach_y = abs(k * cx[Q] + m * cx[Q + 2]) * half_x
            reach_y += abs(k * cx[Q + 1] + m * cx[Q + 3]) * half_y
        (
            high_y, slope_y, bend_y, size_bend_y, yu, yv, yz, change_y, w1_y, w2_y, least_y, most_y
        ) = texture_over(
            textures, cy, bx - reach_x, bx + reach_x, by - reach_y, by + reach_y
        )
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
    if bound <= enough:
        return bound, False
    overlap_at(textures, cx, cy, x, y, work, at)
    if at[X] == at[X] and _beside(cy, at, radius * fastest, 0.0 if level_y else size_y):
        return -np.inf, False
    if at[F] == -np.inf:
        return bound, False
    if cy[TEXTURE] >= 0.0 and not level_y:
        # The place under the middle is known now: a narrower part of Y will do.
        closest = cy[Q_LEAST] - (slope_y * side_y + size_y * w1_y)
        if closest > 0.0:
            bx, by = at[ON_X], at[ON_Y]
            reach_x = min(reach_x, radius * fastest / closest)
            (
                high_y, slope_y, bend_y, size_bend_y,
                yu, yv, yz, change_y, w1_y, w2_y, least_y, most_y,
            ) = texture_over(
                textures, cy, bx - reach_x, bx + reach_x, by - reach_x, by + reach_x
            )
            side_y = min(math.sqrt(yu * yu + yv * yv) + change_y, 1.0)
    if (cx[C] > 0.0 and least < 0.5 * cx[LEAST_ROOT]) or (
        cy[C] > 0.0 and least_y < 0.5 * cy[LEAST_ROOT]
    ):
        return bound, _inside(cx, cy, at)
    # f'' <= d^T M d.
    kappa = 0.0
    drift_y = slope_y * side_y + size_y * w1_y
    closest, widest = max(cy[Q_LEAST] - drift_y, 0.0), cy[Q_MOST] + drift_y
    g1, g2 = at[SLOPE_Y], at[SLOPE_Y + 1]
    # How much Y's slope changes over the box.
    turn_y = 0.0
    if side > 0.0 or side_y > 0.0:
        if closest == 0.0:
            return bound, _inside(cx, cy, at)
        turn_y = _point_bend(textures, cy, least_y, slope_y, size_bend_y, w1_y, w2_y) * radius * fastest
        turn_y *= (1.0 + math.sqrt(g1 * g1 + g2 * g2)) / (closest * closest)
    steepness = math.sqrt(1.0 + g1 * g1 + g2 * g2) + turn_y
    if cx[TEXTURE] >= 0.0:
        facing, spread = wz + g1 * wu + g2 * wv, steepness * change + turn_y * side
        kappa = _shape_bend(
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
                e11, e12, e22 = c * cy[EQ], c * cy[EQ + 1], c * cy[EQ + 2]
                a, b, d, e = cx[Q], cx[Q + 1], cx[Q + 2], cx[Q + 3]
                m11 -= a * (e11 * a + e12 * d) + d * (e12 * a + e22 * d)
                m12 -= a * (e11 * b + e12 * e) + d * (e12 * b + e22 * e)
                m22 -= b * (e11 * b + e12 * e) + e * (e12 * b + e22 * e)
            else:
                less = c * cy[EQ_LEAST] * slowest * slowest
                m11, m22 = m11 - less, m22 - less
    else:
        facing, spread = yz - g1 * yu - g2 * yv, steepness * change_y + turn_y * side_y
        bend = _shape_bend(
            textures, cy, bend_y, size_bend_y, slope_y, w1_y, w2_y, facing, spread, steepness
        )
        if cy[C] > 0.0:
            bend -= cy[C] / most_y * cy[E_LEAST]
        ratio = fastest / closest if bend > 0.0 else slowest / widest
        bend *= ratio * ratio
        m11, m22 = m11 + bend, m22 + bend
    f, f_x, f_y = at[F], at[F_X], at[F_Y]
    square = max(m11 * half_x * half_x + m22 * half_y * half_y, 0.0)
    if m11 < 0.0 or m22 < 0.0:
        square = max(m11, 0.0) * half_x * half_x + max(m22, 0.0) * half_y * half_y
    second = f + 0.5 * square + abs(m12) * half_x * half_y
    linear = abs(f_x) * half_x + abs(f_y) * half_y
    bound = min(bound, second + linear)
    if bound <= enough:
        return bound, _inside(cx, cy, at)
    # How much the borders, taken as straight lines, may be off.
    loose = _row_bend(cx, least) + _row_bend(cy, least_y)
    if side > 0.0:
        loose += _point_bend(textures, cx, least, slope_x, size_bend, w1, w2) / cy[Q_LEAST]
    if side_y > 0.0:
        ratio = fastest / closest
        loose += _point_bend(textures, cy, least_y, slope_y, size_bend_y, w1_y, w2_y) * ratio * ratio
    loose *= 0.5 * radius * radius
    if m11 < 0.0 and m11 * m22 - m12 * m12 > 0.0:
        if mine and x0 <= best[X] <= x1 and y0 <= best[Y] <= y1:
            # Climbed to before, and the only maximum of a concave box.
            for i in range(OVERLAP_SIZE):
                at[i] = best[i]
            there = True
        else:
            stride = 2.0 * max(half_x, half_y)
            there = climb(textures, cx, cy, box, x, y, stride, work, at)
            if at[F] == -np.inf:
                return bound, False
        x, y = at[X], at[Y]
        within = at[F] + _rise_from(cx, cy, at, x0 - x, x1 - x, y0 - y, y1 - y, loose)
        return min(bound, within), there
    within = second + _rise_from(cx, cy, at, -half_x, half_x, -half_y, half_y, loose)
    return min(bound, within), _inside(cx, cy, at)


@inner_kernel
def _rise_from(cx, cy, at, x0, x1, y0, y1, loose):
    """Return the largest rise along the tangent plane at `at` over a box within the borders."""
    borders = np.empty((MAX_BORDERS, BORDER_SIZE))
    count = borders_at(cx, cy, at, borders)
    for i in range(count):
        # Borders seen through a texture's shift are no straight lines either.
        borders[i, 0] -= loose if borders[i, 3] < 4.0 else 0.0
    return steepest_rise(at[F_X], at[F_Y], x0, x1, y0, y1, borders, count, loose)


@inner_kernel
def _inside(cx, cy, at):
    """Return whether a place lies within all borders."""
    borders = np.empty((MAX_BORDERS, BORDER_SIZE))
    for i in range(borders_at(cx, cy, at, borders)):
        if borders[i, 0] > 0.0:
            return False
    return True
