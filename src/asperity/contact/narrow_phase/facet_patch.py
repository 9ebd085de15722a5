"""A facet as a chart: see `chart` for what its numbers are."""

from __future__ import annotations

import math

from asperity._core.kernels import clear, inner_kernel
from asperity.contact.narrow_phase.surface_patch import (
    B0,
    BEND_1,
    BEND_2,
    CORNERS,
    COVERS,
    LEAST_ROOT,
    LEAST_W,
    LEVEL,
    MAPPING,
    PZ,
    Q_LEAST,
    Q_MOST,
    QINV,
    RECTANGLE,
    RECTANGLE_HARD,
    RISE,
    ROUND,
    ROWS,
    SIDE,
    STRETCH,
    SUMMIT,
    TEXTURE,
    TOP,
    TRIPLANAR,
    UNIT,
    UV_LEAST,
    UV_MOST,
    V0,
    V1,
    V2,
    W0,
    O,
    Q,
    singular,
)


@inner_kernel
def facet_chart(table, f, turn, shift, texture, mapping, origin, chart):
    """Fill `chart` (165,) with a facet.

    Parameters
    ----------
    table : FacetTable
    f : int
    turn : (3, 3) array
        From the body's frame to the contact frame, whose z is the direction it is seen along.
    shift : (3,) array
        Where the body's frame has its origin in the contact frame [m].
    texture : int
        -1 for none.
    mapping : float
        PLANAR or TRIPLANAR.
    origin : (3,) array
        Where the texture of a triplanar map begins [m].
    """
    clear(chart)
    for i in range(3):
        at = shift[i]
        x = y = w0 = w1 = w2 = 0.0
        for k in range(3):
            m = turn[i, k]
            at += m * table.origin[f, k]
            x += m * table.axes[f, 0, k]
            y += m * table.axes[f, 1, k]
            w0 += m * table.w[f, k]
            w1 += m * table.w[f, 3 + k]
            w2 += m * table.w[f, 6 + k]
        chart[O + i], chart[V0 + i], chart[V1 + i], chart[V2 + i] = at, w0, w1, w2
        if i < 2:
            chart[Q + 2 * i], chart[Q + 2 * i + 1] = x, y
        else:
            chart[PZ], chart[PZ + 1] = x, y
    a, b, c, d = chart[Q], chart[Q + 1], chart[Q + 2], chart[Q + 3]
    det = a * d - b * c
    chart[QINV], chart[QINV + 1] = d / det, -b / det
    chart[QINV + 2], chart[QINV + 3] = -c / det, a / det
    chart[Q_LEAST], chart[Q_MOST] = singular(a, b, c, d)
    chart[UNIT], chart[STRETCH], chart[LEAST_ROOT] = table.unit[f], 1.0, 0.5
    if table.unit[f] == 1.0 and abs(chart[V0]) < 1e-12 and abs(chart[V0 + 1]) < 1e-12:
        chart[LEVEL] = 1.0
    chart[BEND_1], chart[BEND_2] = table.bends[f, 0], table.bends[f, 1]
    half_x, half_y = table.half[f, 0], table.half[f, 1]
    chart[RECTANGLE], chart[RECTANGLE + 1] = -half_x, half_x
    chart[RECTANGLE + 2], chart[RECTANGLE + 3] = -half_y, half_y
    rows = table.count_rows[f]
    chart[RECTANGLE_HARD] = 1.0 if rows == 0 else 0.0
    chart[ROWS] = rows
    for i in range(rows):
        row = ROWS + 1 + 6 * i
        chart[row], chart[row + 1] = table.rows[f, i, 0], table.rows[f, i, 1]
        chart[row + 2], chart[row + 5] = table.rows[f, i, 2], table.rows[f, i, 3]
    chart[CORNERS] = rows
    summit = -math.inf
    u0 = v0 = math.inf
    u1 = v1 = -math.inf
    for i in range(table.sides[f]):
        x, y = table.corners[f, i, 0], table.corners[f, i, 1]
        chart[CORNERS + 1 + 2 * i], chart[CORNERS + 2 + 2 * i] = x, y
        u, v = chart[O] + a * x + b * y, chart[O + 1] + c * x + d * y
        u0, u1, v0, v1 = min(u0, u), max(u1, u), min(v0, v), max(v1, v)
        summit = max(summit, chart[PZ] * x + chart[PZ + 1] * y)
    chart[SUMMIT] = chart[O + 2] + summit
    chart[COVERS], chart[COVERS + 1], chart[COVERS + 2], chart[COVERS + 3] = u0, u1, v0, v1
    # Over the rectangle w, before it is made a unit vector, is largest in a corner: sideways, and
    # along z.
    side, rise = 0.0, 0.0
    for i in range(4):
        x, y = (half_x if i & 1 else -half_x), (half_y if i & 2 else -half_y)
        w_u = chart[V0] + chart[V1] * x + chart[V2] * y
        w_v = chart[V0 + 1] + chart[V1 + 1] * x + chart[V2 + 1] * y
        side = max(side, math.sqrt(w_u * w_u + w_v * w_v))
        rise = max(rise, chart[V0 + 2] + chart[V1 + 2] * x + chart[V2 + 2] * y)
    chart[LEAST_W] = table.least[f]
    chart[SIDE], chart[RISE] = min(side / table.least[f], 1.0), min(rise / table.least[f], 1.0)
    chart[TEXTURE], chart[MAPPING] = texture, mapping
    if texture < 0:
        return
    chart[TOP] = table.top[f]
    for k in range(9):
        chart[B0 + k] = table.place[f, k]
        chart[W0 + k] = table.w[f, k]
    chart[UV_LEAST], chart[UV_MOST] = table.spread[f, 0], table.spread[f, 1]
    if mapping == TRIPLANAR:
        chart[ROUND], chart[ROUND + 1] = origin[0], origin[1]
