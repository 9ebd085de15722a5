"""The overlap of two charts, and where they end: the function that the search maximises.

The point `p(x, y)` of chart X is compared with the height of chart Y over the same place. Each
body's heights count along its own outward z, so the overlap is their plain sum

    f(x, y) = z_X(x, y) + H_Y(q_X(x, y)),      q the place in (u, v).

Where the two charts end are inequalities `g(x, y) <= 0`: the rows of both charts, the ellipse of
a curved one and the four sides of Y's rectangle. The sides of X's rectangle are the sides of the
box that is searched.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.displaced_surface import (
    P_X,
    P_XX,
    P_XY,
    P_Y,
    P_YY,
    P,
    height_at,
    height_on,
    over_base,
    root_at,
    surface_at,
)
from asperity.contact.narrow_phase.surface_patch import (
    E_MOST,
    LEAST_ROOT,
    LEVEL,
    QINV,
    RECTANGLE,
    RECTANGLE_HARD,
    ROWS,
    TEXTURE,
    C,
    E,
    O,
    Q,
)

F, F_X, F_Y, F_XX, F_XY, F_YY = 0, 1, 2, 3, 4, 5
X, Y, ON_X, ON_Y = 6, 7, 8, 9  # where: parameters on chart X, and on chart Y
TURN = 10  # derivatives of Y's parameters by X's: 11, 12, 21, 22
SLOPE_X, SLOPE_Y = 14, 16  # slopes over (u, v) of the two surfaces
POINT = 18  # the point of X; Y's has the same u and v
ABOVE = 21  # z of Y's point
BENT = 22  # second derivatives of Y's parameters by X's: of the one by 11, 12, 22, of the other
OVERLAP_SIZE = 28
MAX_BORDERS = 26
BORDER_SIZE = 7  # g, g_x, g_y, code, g_xx, g_xy, g_yy
"""Code: 0 artificial; 1 an edge of X; 2 an edge of Y; 4 added where g is not convex."""
WORK_SHAPE = (136, 28)
"""Room for all that a search notes on the way. Rows: two points, a trial, borders, lines and
polygons, from these on."""
TRIAL, BORDERS, LINES, POLYGON = 2, 3, 30, 62


@small_kernel
def over_level(textures, cx, cy, x, y, out):
    """Do `overlap_at` for a level chart X below a smooth Y: a probe on a plate, the common case."""
    u, v = cx[O] + cx[Q] * x + cx[Q + 1] * y, cx[O + 1] + cx[Q + 2] * x + cx[Q + 3] * y
    t = t_x = t_y = t_xx = t_xy = t_yy = 0.0
    z, g1, g2, k11, k12, k22 = over_base(cy, u, v)
    out[X], out[Y] = x, y
    if math.isnan(z):
        out[F] = -np.inf
        return
    if cx[TEXTURE] >= 0.0:
        t, t_x, t_y, t_xx, t_xy, t_yy = height_on(
            textures, cx, x, y, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        )
    a, b, c, d = cx[Q], cx[Q + 1], cx[Q + 2], cx[Q + 3]
    out[POINT], out[POINT + 1], out[POINT + 2] = u, v, cx[O + 2] + t
    out[F] = out[POINT + 2] + z
    out[F_X] = t_x + g1 * a + g2 * c
    out[F_Y] = t_y + g1 * b + g2 * d
    out[F_XX] = t_xx + a * (k11 * a + k12 * c) + c * (k12 * a + k22 * c)
    out[F_XY] = t_xy + a * (k11 * b + k12 * d) + c * (k12 * b + k22 * d)
    out[F_YY] = t_yy + b * (k11 * b + k12 * d) + d * (k12 * b + k22 * d)
    i, j, k, m = cy[QINV], cy[QINV + 1], cy[QINV + 2], cy[QINV + 3]
    du, dv = u - cy[O], v - cy[O + 1]
    out[ON_X], out[ON_Y] = i * du + j * dv, k * du + m * dv
    out[TURN], out[TURN + 1] = i * a + j * c, i * b + j * d
    out[TURN + 2], out[TURN + 3] = k * a + m * c, k * b + m * d
    i, j, k, m = cx[QINV], cx[QINV + 1], cx[QINV + 2], cx[QINV + 3]
    out[SLOPE_X], out[SLOPE_X + 1] = i * t_x + k * t_y, j * t_x + m * t_y
    out[SLOPE_Y], out[SLOPE_Y + 1] = g1, g2
    out[ABOVE] = z
    for i in range(BENT, OVERLAP_SIZE):
        out[i] = 0.0


@inner_kernel
def overlap_at(textures, cx, cy, x, y, work, out):
    """Fill `out` (28,) with the overlap of two charts at (x, y) of the first; see `F`, `F_X`, ...

    The overlap is -inf where one of the two has no such point. `work` (136, 28) is written to.
    """
    if cx[LEVEL] == 1.0 and cy[TEXTURE] < 0.0:
        over_level(textures, cx, cy, x, y, out)
        return
    point, below = work[0], work[1]
    surface_at(textures, cx, x, y, point)
    out[X], out[Y] = x, y
    u, v = point[P], point[P + 1]
    out[F] = -np.inf
    if not (u == u and v == v and point[P + 2] == point[P + 2]):
        return
    z, g1, g2, k11, k12, k22, bx, by = height_at(textures, cy, u, v, below)
    out[ON_X], out[ON_Y] = bx, by
    if z == -np.inf:
        return
    u_x, v_x, u_y, v_y = point[P_X], point[P_X + 1], point[P_Y], point[P_Y + 1]
    ku_x, kv_x = k11 * u_x + k12 * v_x, k12 * u_x + k22 * v_x
    ku_y, kv_y = k11 * u_y + k12 * v_y, k12 * u_y + k22 * v_y
    out[F] = point[P + 2] + z
    out[F_X] = point[P_X + 2] + g1 * u_x + g2 * v_x
    out[F_Y] = point[P_Y + 2] + g1 * u_y + g2 * v_y
    out[F_XX] = point[P_XX + 2] + g1 * point[P_XX] + g2 * point[P_XX + 1] + u_x * ku_x + v_x * kv_x
    out[F_XY] = point[P_XY + 2] + g1 * point[P_XY] + g2 * point[P_XY + 1] + u_x * ku_y + v_x * kv_y
    out[F_YY] = point[P_YY + 2] + g1 * point[P_YY] + g2 * point[P_YY + 1] + u_y * ku_y + v_y * kv_y
    i, j, k, m = cy[QINV], cy[QINV + 1], cy[QINV + 2], cy[QINV + 3]
    hidden = cy[TEXTURE] >= 0.0 and cy[LEVEL] == 0.0
    if hidden:
        a, b, c, d = below[P_X], below[P_Y], below[P_X + 1], below[P_Y + 1]
        det = a * d - b * c
        i, j, k, m = d / det, -b / det, -c / det, a / det
    x_x, x_y = i * u_x + j * v_x, i * u_y + j * v_y
    y_x, y_y = k * u_x + m * v_x, k * u_y + m * v_y
    out[TURN], out[TURN + 1], out[TURN + 2], out[TURN + 3] = x_x, x_y, y_x, y_y
    for n in range(3):
        # By 11, 12 and 22 of X's parameters: P_XX, P_XY and P_YY of both follow each other so.
        u_nn, v_nn = point[P_XX + 3 * n], point[P_XX + 3 * n + 1]
        if hidden:
            a, b = (x_x, x_x) if n == 0 else ((x_x, x_y) if n == 1 else (x_y, x_y))
            c, d = (y_x, y_x) if n == 0 else ((y_x, y_y) if n == 1 else (y_y, y_y))
            cross = a * d + b * c
            u_nn -= below[P_XX] * a * b + below[P_XY] * cross + below[P_YY] * c * d
            v_nn -= below[P_XX + 1] * a * b + below[P_XY + 1] * cross + below[P_YY + 1] * c * d
        out[BENT + n], out[BENT + 3 + n] = i * u_nn + j * v_nn, k * u_nn + m * v_nn
    det = u_x * v_y - u_y * v_x
    out[SLOPE_X] = (v_y * point[P_X + 2] - v_x * point[P_Y + 2]) / det
    out[SLOPE_X + 1] = (u_x * point[P_Y + 2] - u_y * point[P_X + 2]) / det
    out[SLOPE_Y], out[SLOPE_Y + 1] = g1, g2
    out[POINT], out[POINT + 1], out[POINT + 2] = u, v, point[P + 2]
    out[ABOVE] = z


@small_kernel
def _border(borders, count, g, g_a, g_b, g_aa, g_ab, g_bb, turn, at, code):
    """Add a border with its slope (g_a, g_b) and bend in its own parameters."""
    if turn:
        borders[count, 1] = g_a * at[TURN] + g_b * at[TURN + 2]
        borders[count, 2] = g_a * at[TURN + 1] + g_b * at[TURN + 3]
        i, j, k, m = at[TURN], at[TURN + 1], at[TURN + 2], at[TURN + 3]
        borders[count, 4] = i * (g_aa * i + g_ab * k) + k * (g_ab * i + g_bb * k)
        borders[count, 5] = i * (g_aa * j + g_ab * m) + k * (g_ab * j + g_bb * m)
        borders[count, 6] = j * (g_aa * j + g_ab * m) + m * (g_ab * j + g_bb * m)
        for n in range(3):
            borders[count, 4 + n] += g_a * at[BENT + n] + g_b * at[BENT + 3 + n]
    else:
        borders[count, 1], borders[count, 2] = g_a, g_b
        borders[count, 4], borders[count, 5], borders[count, 6] = g_aa, g_ab, g_bb
    borders[count, 0], borders[count, 3] = g, code
    return count + 1


@small_kernel
def _own_borders(chart, x, y, turn, at, hard, borders, count):
    """Add the ellipse and the rows of one chart."""
    if chart[C] > 0.0:
        scale = 0.5 / math.sqrt(chart[E_MOST])
        qx, qy = chart[E] * x + chart[E + 1] * y, chart[E + 1] * x + chart[E + 2] * y
        g = scale * (x * qx + y * qy - 1.0 + chart[LEAST_ROOT] ** 2)
        twice = 2.0 * scale
        count = _border(
            borders, count, g, twice * qx, twice * qy, twice * chart[E], twice * chart[E + 1],
            twice * chart[E + 2], turn, at, 0.0,
        )  # fmt: skip
    for i in range(int(chart[ROWS])):
        row = ROWS + 1 + 6 * i
        r, r_x, r_y, r_xx, r_xy, r_yy = root_at(chart, x, y)
        k3, k4 = chart[row + 3], chart[row + 4]
        g = chart[row] + chart[row + 1] * x + chart[row + 2] * y + k3 * r + k4 * (x * x + y * y)
        g_a = chart[row + 1] + k3 * r_x + 2.0 * k4 * x
        g_b = chart[row + 2] + k3 * r_y + 2.0 * k4 * y
        code = (hard if chart[row + 5] == 1.0 else 0.0) + (4.0 if k3 > 0.0 else 0.0)
        count = _border(
            borders, count, g, g_a, g_b, k3 * r_xx + 2.0 * k4, k3 * r_xy, k3 * r_yy + 2.0 * k4,
            turn, at, code,
        )  # fmt: skip
    return count


@inner_kernel
def borders_at(cx, cy, at, borders_out):
    """Fill value and slope of every border at a place of `overlap_at`; return how many."""
    count = _own_borders(cx, at[X], at[Y], False, at, 1.0, borders_out, np.int64(0))
    x, y = at[ON_X], at[ON_Y]
    if cy[C] == 0.0:
        code = 2.0 * cy[RECTANGLE_HARD]
        for side in range(4):
            sign = 1.0 if side & 1 else -1.0
            along = side >> 1
            place = x if along == 0 else y
            g = sign * (place - cy[RECTANGLE + side])
            g_a, g_b = (sign, 0.0) if along == 0 else (0.0, sign)
            count = _border(borders_out, count, g, g_a, g_b, 0.0, 0.0, 0.0, True, at, code)
    return _own_borders(cy, x, y, True, at, 2.0, borders_out, count)


@inner_kernel
def steepest_rise(g_x, g_y, x0, x1, y0, y1, borders, count, slack, polygon):
    """Return the largest `g_x dx + g_y dy` over a box within borders taken as straight lines.

    The box is given relative to the place of `borders`; -inf if nothing of it is within them.
    `slack` is what a border that is not convex may give way; `polygon` (48, 4) is written to.
    """
    for i in range(4):
        polygon[i, 0] = x0 if i in (0, 3) else x1
        polygon[i, 1] = y0 if i < 2 else y1
    size = 4
    for i in range(count):
        a, b = borders[i, 1], borders[i, 2]
        r = -borders[i, 0] + (slack if borders[i, 3] >= 4.0 else 0.0)
        most = max(a * x0, a * x1) + max(b * y0, b * y1)
        if most <= r:
            continue
        kept = 0
        for j in range(size):
            k = (j + 1) % size
            d0, d1 = (
                a * polygon[j, 0] + b * polygon[j, 1] - r,
                a * polygon[k, 0] + b * polygon[k, 1] - r,
            )
            if d0 <= 0.0:
                polygon[kept, 2], polygon[kept, 3] = polygon[j, 0], polygon[j, 1]
                kept += 1
            if (d0 < 0.0 and d1 > 0.0) or (d0 > 0.0 and d1 < 0.0):
                t = d0 / (d0 - d1)
                polygon[kept, 2] = polygon[j, 0] + t * (polygon[k, 0] - polygon[j, 0])
                polygon[kept, 3] = polygon[j, 1] + t * (polygon[k, 1] - polygon[j, 1])
                kept += 1
        size = kept
        if size == 0:
            return -np.inf
        for j in range(size):
            polygon[j, 0], polygon[j, 1] = polygon[j, 2], polygon[j, 3]
    best = -np.inf
    for j in range(size):
        best = max(best, g_x * polygon[j, 0] + g_y * polygon[j, 1])
    return best
