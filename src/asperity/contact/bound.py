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
    ROWS,
    SUMMIT,
    TEXTURE,
    UV_MOST,
    C,
    E,
    O,
    Q,
)
from asperity.contact.climb import climb, step_within
from asperity.contact.overlap import (
    BORDERS,
    F_X,
    F_XX,
    F_XY,
    F_Y,
    F_YY,
    LINES,
    ON_X,
    ON_Y,
    OVERLAP_SIZE,
    POLYGON,
    SLOPE_Y,
    F,
    X,
    Y,
    borders_at,
    over_level,
    overlap_at,
    steepest_rise,
)
from asperity.contact.surface import parameters_under, root_at
from asperity.contact.texture_bound import level_texture, roots_over, texture_over

_HAIR = 1e-6  # boxes on an overhang are not divided below this [m]
_NO_RISE = 1e-13  # not worth a look at the borders [m]
_QUICK_STEPS = 2
UNSEEN, SEEN, BOUNDED, CONCAVE = 0, 1, 2, 3


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
    bend = bend_t * max(most if bend_t >= 0.0 else least, 0.0)
    if least < 0.0:
        # Seen from behind: there the texture's hollows bend outwards.
        bend = max(bend, 0.0) - least * size_bend
    size = textures.scales[int(chart[TEXTURE]), 2]
    return bend + (2.0 * slope_t * w1 + size * w2) * steepness


@small_kernel
def _point_bend(textures, chart, least, slope, size_bend, w1, w2, side):
    """Return a bound of |p''|, the bend of a chart's surface as its parameters are walked over.

    `side` is how much of the normal is looked at: 1, or its part in (u, v).
    """
    bend = _row_bend(chart, least)
    if chart[TEXTURE] >= 0.0:
        bend += size_bend * side + 2.0 * slope * w1
        bend += textures.scales[int(chart[TEXTURE]), 2] * w2
    return bend


@inner_kernel
def beyond_rows(chart, x, y, half_x, half_y):
    """Return whether a box round (x, y) lies beyond one of a chart's rows."""
    if chart[ROWS] == 0.0:
        return False
    radius = math.sqrt(half_x * half_x + half_y * half_y)
    least, _ = roots_over(chart, x, y, radius)
    if least <= 0.02:
        return False
    r, r_x, r_y, _, _, _ = root_at(chart, x, y)
    # How much a root in a row may be off from its tangent.
    bend = 0.5 * radius * radius * chart[E_MOST] / (least * least * least)
    for i in range(int(chart[ROWS])):
        row = ROWS + 1 + 6 * i
        k3, k4 = chart[row + 3], chart[row + 4]
        g = chart[row] + chart[row + 1] * x + chart[row + 2] * y + k3 * r + k4 * (x * x + y * y)
        g -= abs(chart[row + 1] + k3 * r_x + 2.0 * k4 * x) * half_x
        g -= abs(chart[row + 2] + k3 * r_y + 2.0 * k4 * y) * half_y
        if g > abs(k3) * bend:
            return True
    return False


@small_kernel
def _beside(cy, at, reach, unknown):
    """Return whether nothing of Y lies within `reach` of the place in (u, v) that `at` has.

    `unknown` is how far Y's texture moves points sideways, where the point is not known.
    """
    reach = (reach + (unknown if at[F] == -np.inf else 3.0 * unknown)) / cy[Q_LEAST]
    x, y = at[ON_X], at[ON_Y]
    if cy[C] > 0.0:
        _, most = roots_over(cy, x, y, reach)
        if most < cy[LEAST_ROOT]:
            return True
        return beyond_rows(cy, x, y, reach, reach)
    if beyond_rows(cy, x, y, reach, reach):
        return True
    out_x = max(cy[RECTANGLE] - x, x - cy[RECTANGLE + 1])
    out_y = max(cy[RECTANGLE + 2] - y, y - cy[RECTANGLE + 3])
    return max(out_x, out_y) > reach


@small_kernel
def _less_base(chart, m11, m12, m22, most, q):
    """Return M less the curvature of Y's smooth base; `q` are the sides of X's map to (u, v)."""
    c = chart[C] / most
    e11, e12, e22 = c * chart[EQ], c * chart[EQ + 1], c * chart[EQ + 2]
    a, b, d, e = q
    m11 -= a * (e11 * a + e12 * d) + d * (e12 * a + e22 * d)
    m12 -= a * (e11 * b + e12 * e) + d * (e12 * b + e22 * e)
    m22 -= b * (e11 * b + e12 * e) + e * (e12 * b + e22 * e)
    return m11, m12, m22


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
        m11, m12, m22 = _less_base(cy, m11, m12, m22, most, q)
    loose = 0.5 * radius * radius * _row_bend(cy, least)
    return _second_order(m11, m12, m22, half_x, half_y, bound, loose, at)


@small_kernel
def _rise(slope, bend, half):
    """Return the largest of `slope d + bend d^2 / 2` over |d| <= half; `slope` is 0 or more."""
    if slope < -bend * half:
        return -0.5 * slope * slope / bend
    return slope * half + 0.5 * bend * half * half


@small_kernel
def _second_order(m11, m12, m22, half_x, half_y, bound, loose, at):
    """Return the sharper of `bound` and that of f'' <= M; see `node_bound`."""
    square = max(m11, 0.0) * half_x * half_x + max(m22, 0.0) * half_y * half_y
    second = at[F] + 0.5 * square + abs(m12) * half_x * half_y
    rise = _rise(abs(at[F_X]), m11, half_x) + _rise(abs(at[F_Y]), m22, half_y)
    bound = min(bound, at[F] + rise + abs(m12) * half_x * half_y)
    concave = m11 < 0.0 and m11 * m22 - m12 * m12 > 0.0
    return bound, (CONCAVE if concave else BOUNDED), second, loose


@small_kernel
def _towards_maximum(at, x0, x1, y0, y1):
    """Return a place of a box nearer to the maximum that a concave function has there.

    One step of Newton's method; held by a side, along it.
    """
    x, y = at[X], at[Y]
    g_x, g_y, h_xx, h_xy, h_yy = at[F_X], at[F_Y], at[F_XX], at[F_XY], at[F_YY]
    det = h_xx * h_yy - h_xy * h_xy
    new_x, new_y = x + (h_xy * g_y - h_yy * g_x) / det, y + (h_xy * g_x - h_xx * g_y) / det
    if x0 <= new_x <= x1 and y0 <= new_y <= y1:
        return new_x, new_y
    held_x, held_y = min(max(new_x, x0), x1), min(max(new_y, y0), y1)
    if held_x != new_x:
        along = y - (g_y + h_xy * (held_x - x)) / h_yy
        if y0 <= along <= y1 or held_y == new_y:
            return held_x, min(max(along, y0), y1)
    along = x - (g_x + h_xy * (held_y - y)) / h_xx
    return min(max(along, x0), x1), held_y


@inner_kernel
def _held_step(cx, cy, at, x, y, box, stride, work):
    """Return a place of a box nearer to the maximum within the borders, if there is any of it."""
    borders, lines = work[BORDERS:LINES], work[LINES:POLYGON]
    count = borders_at(cx, cy, at, borders)
    dx, dy, found = step_within(at, x, y, box, stride, borders, count, lines)
    x0, x1, y0, y1 = box
    return min(max(x + dx, x0), x1), min(max(y + dy, y0), y1), found


@inner_kernel
def sharpest_bound(
    textures, cx, cy, box, kind, bound, second, loose, enough, best, mine, work, at
):  # fmt: skip
    """Return `node_bound`'s bound within the charts' borders, and whether `at` lies within them.

    Where f is concave it is that of the tangent plane at the maximum, which is climbed to unless
    the one at a place near it shows that the bound is below `enough`.
    """
    x0, x1, y0, y1 = box
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    there = True
    if kind == CONCAVE:
        loose *= 4.0  # seen from anywhere in the box, not from its middle
        if mine and x0 <= best[X] <= x1 and y0 <= best[Y] <= y1:
            # Climbed to before, and the only maximum of a concave box.
            for i in range(OVERLAP_SIZE):
                at[i] = best[i]
        else:
            stride = max(x1 - x0, y1 - y0)
            for _ in range(_QUICK_STEPS):
                if not at[F_XX] * at[F_YY] > at[F_XY] * at[F_XY]:
                    break
                # Too deep to be closed as it is: it may lie beyond a border, as may the maximum.
                borders = at[F] > enough
                if borders:
                    high = at[F] + _rise_from(
                        cx, cy, at, x0 - x, x1 - x, y0 - y, y1 - y, loose, work
                    )
                    if high <= enough:
                        return min(bound, high), False
                    x, y, found = _held_step(cx, cy, at, x, y, box, stride, work)
                    if not found:
                        break
                else:
                    x, y = _towards_maximum(at, x0, x1, y0, y1)
                overlap_at(textures, cx, cy, x, y, work, at)
                if at[F] == -np.inf:
                    break
                if not borders:
                    g_x, g_y = at[F_X], at[F_Y]
                    high = at[F] + max(g_x * (x0 - x), g_x * (x1 - x))
                    high += max(g_y * (y0 - y), g_y * (y1 - y))
                elif at[F] <= enough:
                    high = at[F] + _rise_from(
                        cx, cy, at, x0 - x, x1 - x, y0 - y, y1 - y, loose, work
                    )
                if high <= enough:
                    return min(bound, high), False
            there = climb(textures, cx, cy, box, x, y, stride, work, at)
            if at[F] == -np.inf:
                return bound, False
        x, y, second = at[X], at[Y], at[F]
    within = second + _rise_from(cx, cy, at, x0 - x, x1 - x, y0 - y, y1 - y, loose, work)
    return min(bound, within), there


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
    if at[X] == at[X] and _beside(cy, at, radius * fastest, 0.0 if level_y else size_y):
        return -np.inf, UNSEEN, 0.0, 0.0
    if at[F] == -np.inf:
        # Y's surface hangs over there, as seen along n: it is not rendered.
        return (bound if radius > _HAIR else -np.inf), UNSEEN, bound, 0.0
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
        return (bound if radius > _HAIR else at[F]), SEEN, bound, 0.0
    # f'' <= d^T M d.
    kappa = 0.0
    drift_y = slope_y * side_y + size_y * w1_y
    closest, widest = max(cy[Q_LEAST] - drift_y, 0.0), cy[Q_MOST] + drift_y
    g1, g2 = at[SLOPE_Y], at[SLOPE_Y + 1]
    # How much Y's slope changes over the box.
    turn_y = 0.0
    if side > 0.0 or side_y > 0.0:
        if closest == 0.0:
            return (bound if radius > _HAIR else at[F]), SEEN, bound, 0.0
        turn_y = (
            _point_bend(textures, cy, least_y, slope_y, size_bend_y, w1_y, w2_y, 1.0)
            * radius
            * fastest
        )
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
                q = (cx[Q], cx[Q + 1], cx[Q + 2], cx[Q + 3])
                m11, m12, m22 = _less_base(cy, m11, m12, m22, most_y, q)
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
    # How much the borders, taken as straight lines, may be off.
    loose = _row_bend(cx, least) + _row_bend(cy, least_y)
    if side > 0.0:
        bend = _point_bend(textures, cx, least, slope_x, size_bend, w1, w2, side)
        loose += bend / cy[Q_LEAST]
    if side_y > 0.0:
        ratio = fastest / closest
        loose += (
            _point_bend(textures, cy, least_y, slope_y, size_bend_y, w1_y, w2_y, side_y)
            * ratio
            * ratio
        )
    loose *= 0.5 * radius * radius
    found = _second_order(m11, m12, m22, half_x, half_y, bound, loose, at)
    if cx[C] > 0.0 or cy[C] > 0.0 or not level_y:
        return found
    # The bend at the middle, and how much it changes: sharper on ridges, and in small boxes.
    third = radius * _third(
        textures, cx, cy, size_x, slope_x, size_bend, w1, w2, side, size_bend_y, slope_y, fastest
    )
    bent_x, bent_y = at[F_XX] + third, at[F_YY] + third
    other = _second_order(bent_x, at[F_XY], bent_y, half_x, half_y, bound, loose, at)
    least = min(found[0], other[0])
    if other[1] > found[1] or (other[1] == found[1] and other[2] < found[2]):
        return least, other[1], other[2], other[3]
    return least, found[1], found[2], found[3]


@small_kernel
def _third(textures, cx, cy, a, s, b, w1, w2, side, b_y, s_y, fastest):
    """Return a bound of the third derivative of f for two plane charts, Y's level or smooth.

    `a`, `s`, `b`: sizes of X's height, slope and bend; `s_y`, `b_y`: of Y's; by each one's own
    parameters. The product rule for t w, the chain rule for Y's height over X's place.
    """
    t = t_y = 0.0
    if cx[TEXTURE] >= 0.0:
        t = textures.scales[int(cx[TEXTURE]), 7] * cx[UV_MOST] ** 3
    if cy[TEXTURE] >= 0.0:
        t_y = textures.scales[int(cy[TEXTURE]), 7] * cy[UV_MOST] ** 3
    w3 = 5.0 * w1 * w2  # of v / |v| with v linear: 15 w1^3, and w2 is 3 w1^2
    more = 3.0 * b * w1 + 3.0 * s * w2 + a * w3
    turn = b * side + 2.0 * s * w1 + a * w2  # how much X's place bends in (u, v)
    over = 1.0 / cy[Q_LEAST]
    flat = math.sqrt(cy[PZ] ** 2 + cy[PZ + 1] ** 2)
    return (
        t + more + (s_y + flat) * over * (t * side + more)
        + 3.0 * b_y * over * over * fastest * turn + t_y * (over * fastest) ** 3
    )  # fmt: skip


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


@inner_kernel
def _rise_from(cx, cy, at, x0, x1, y0, y1, loose, work):
    """Return the largest rise along the tangent plane at `at` over a box within the borders."""
    g_x, g_y = at[F_X], at[F_Y]
    rise = max(g_x * x0, g_x * x1) + max(g_y * y0, g_y * y1)
    if rise <= _NO_RISE:
        return rise
    borders = work[BORDERS:LINES]
    count = borders_at(cx, cy, at, borders)
    near = False
    for i in range(count):
        # Borders seen through a texture's shift are no straight lines either.
        borders[i, 0] -= loose if borders[i, 3] < 4.0 else 0.0
        a, b = borders[i, 1], borders[i, 2]
        reach = max(a * x0, a * x1) + max(b * y0, b * y1)
        near = near or reach > -borders[i, 0] + (loose if borders[i, 3] >= 4.0 else 0.0)
    if not near:
        return rise
    return steepest_rise(g_x, g_y, x0, x1, y0, y1, borders, count, loose, work[POLYGON:])
