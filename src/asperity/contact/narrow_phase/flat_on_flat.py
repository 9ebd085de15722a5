"""Two smooth plane charts: their overlap is linear, and its maximum is in a corner.

Flat on flat, all of a polygon is equally deep, or one of its sides. Then the middle stands for
it, with its area, or its length, as weight.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel
from asperity._core.stack import stack_array
from asperity.contact.narrow_phase.overlap import POLYGON, F, overlap_at
from asperity.contact.narrow_phase.surface_patch import (
    CORNERS,
    PZ,
    Q_LEAST,
    QINV,
    RECTANGLE,
    ROWS,
    TEXTURE,
    C,
    O,
    Q,
)

_ROOM = 36  # a polygon of this many corners at most, and as many being made
_ON = 1e-15
"""A place this far beyond a side is still on it: where two edges meet rounding would decide [m]."""
_THIN = 1e-9
"""What a line's length is worth as an area, over its length [m]."""


@inner_kernel
def is_straight(chart):
    """Return whether a chart is plane and smooth with straight sides, unlike a cylinder's end."""
    if chart[C] > 0.0 or chart[TEXTURE] >= 0.0:
        return False
    bent = False
    for i in range(int(chart[ROWS])):
        bent = bent or chart[ROWS + 5 + 6 * i] != 0.0
    return not bent


@inner_kernel
def _clipped(polygon, size, a, b, r):
    """Cut a polygon (rows x, y) to `a x + b y <= r`; return how many corners are left."""
    over = stack_array((_ROOM,))
    least, most = np.inf, -np.inf
    for j in range(size):
        over[j] = a * polygon[j, 0] + b * polygon[j, 1] - r
        least, most = min(least, over[j]), max(most, over[j])
    if most <= 0.0:
        return size
    if least > 0.0:
        return np.int64(0)
    kept = np.int64(0)
    for j in range(size):
        k = j + 1 if j + 1 < size else 0
        d0, d1 = over[j], over[k]
        if d0 <= 0.0:
            polygon[kept + _ROOM, 0], polygon[kept + _ROOM, 1] = polygon[j, 0], polygon[j, 1]
            kept += 1
        if (d0 < 0.0 and d1 > 0.0) or (d0 > 0.0 and d1 < 0.0):
            t = d0 / (d0 - d1)
            polygon[kept + _ROOM, 0] = polygon[j, 0] + t * (polygon[k, 0] - polygon[j, 0])
            polygon[kept + _ROOM, 1] = polygon[j, 1] + t * (polygon[k, 1] - polygon[j, 1])
            kept += 1
    for j in range(kept):
        polygon[j, 0], polygon[j, 1] = polygon[j + _ROOM, 0], polygon[j + _ROOM, 1]
    return kept


@inner_kernel
def plane_overlap(cx, cy, slack, polygon):
    """Fill `polygon` with the part of X's parameters over which two plane charts overlap.

    Borders of Y, and the sides of X's rectangle, may be passed by `slack` [m]. Curved borders are
    left out. Returns how many corners there are, and the overlap of the smooth bases, which is
    linear: at (0, 0), by x, by y.
    """
    i, j, k, m = cy[QINV], cy[QINV + 1], cy[QINV + 2], cy[QINV + 3]
    du, dv = cx[O] - cy[O], cx[O + 1] - cy[O + 1]
    # Y's parameters over X's: b0 + b1 x + b2 y, c0 + c1 x + c2 y.
    b0, b1, b2 = i * du + j * dv, i * cx[Q] + j * cx[Q + 2], i * cx[Q + 1] + j * cx[Q + 3]
    c0, c1, c2 = k * du + m * dv, k * cx[Q] + m * cx[Q + 2], k * cx[Q + 1] + m * cx[Q + 3]
    at_zero = cx[O + 2] + cy[O + 2] + cy[PZ] * b0 + cy[PZ + 1] * c0
    g_x = cx[PZ] + cy[PZ] * b1 + cy[PZ + 1] * c1
    g_y = cx[PZ + 1] + cy[PZ] * b2 + cy[PZ + 1] * c2
    own = size = int(cx[CORNERS])
    mid_x, mid_y = (
        0.5 * (cx[RECTANGLE] + cx[RECTANGLE + 1]),
        0.5 * (cx[RECTANGLE + 2] + cx[RECTANGLE + 3]),
    )
    half_x, half_y = cx[RECTANGLE + 1] - mid_x, cx[RECTANGLE + 3] - mid_y
    for n in range(size):
        polygon[n, 0], polygon[n, 1] = cx[CORNERS + 1 + 2 * n], cx[CORNERS + 2 + 2 * n]
    if own == 0:
        size = 4
        for n in range(4):
            polygon[n, 0] = cx[RECTANGLE] if n in (0, 3) else cx[RECTANGLE + 1]
            polygon[n, 1] = cx[RECTANGLE + 2] if n < 2 else cx[RECTANGLE + 3]
    # The first rows of a facet are the sides between its corners.
    for n in range(own, int(cx[ROWS])):
        row = ROWS + 1 + 6 * n
        if cx[row + 4] == 0.0 and size > 0:
            size = _clipped(polygon, size, cx[row + 1], cx[row + 2], -cx[row])
    slack /= cy[Q_LEAST]
    # A facet within rows fills its rectangle from side to side: the rows will do.
    for n in range(4 if cy[CORNERS] == 0.0 else 0):
        sign = 1.0 if n & 1 else -1.0
        f0, f1, f2 = (b0, b1, b2) if n < 2 else (c0, c1, c2)
        r = sign * (cy[RECTANGLE + n] - f0) + slack
        far = sign * (f1 * mid_x + f2 * mid_y) + abs(f1) * half_x + abs(f2) * half_y
        if size > 0 and far > r:
            size = _clipped(polygon, size, sign * f1, sign * f2, r)
    for n in range(int(cy[ROWS])):
        row = ROWS + 1 + 6 * n
        k1, k2 = cy[row + 1], cy[row + 2]
        f1, f2, r = k1 * b1 + k2 * c1, k1 * b2 + k2 * c2, slack - cy[row] - k1 * b0 - k2 * c0
        far = f1 * mid_x + f2 * mid_y + abs(f1) * half_x + abs(f2) * half_y
        if cy[row + 4] == 0.0 and size > 0 and far > r:
            size = _clipped(polygon, size, f1, f2, r)
    return size, at_zero, g_x, g_y


@inner_kernel
def flat_best(textures, cx, cy, tie, work, at):
    """Fill `at` (28,) with the deepest place of two smooth plane charts.

    Returns
    -------
    tuple (bool, float)
        Whether there is such a place; the area that it stands for [m^2]. Corners that are less
        deep by at most `tie` [m] count as equally deep.
    """
    polygon = work[POLYGON:]
    size, at_zero, g_x, g_y = plane_overlap(cx, cy, _ON, polygon)
    if size == 0:
        return False, 0.0
    most = -np.inf
    for j in range(size):
        most = max(most, g_x * polygon[j, 0] + g_y * polygon[j, 1])
    # The corners that are as deep close ranks; they follow one another round the polygon.
    tied = 0
    for j in range(size):
        if g_x * polygon[j, 0] + g_y * polygon[j, 1] >= most - tie:
            polygon[tied, 0], polygon[tied, 1] = polygon[j, 0], polygon[j, 1]
            tied += 1
    area = c_x = c_y = 0.0
    length, first, last = 0.0, 0, 0
    for j in range(tied):
        k = j + 1 if j + 1 < tied else 0
        one, two = polygon[j, 0] - polygon[0, 0], polygon[j, 1] - polygon[0, 1]
        part = one * (polygon[k, 1] - polygon[0, 1]) - two * (polygon[k, 0] - polygon[0, 0])
        area += 0.5 * part
        c_x += part / 6.0 * (one + polygon[k, 0] - polygon[0, 0])
        c_y += part / 6.0 * (two + polygon[k, 1] - polygon[0, 1])
        for i in range(j):
            away = math.hypot(polygon[j, 0] - polygon[i, 0], polygon[j, 1] - polygon[i, 1])
            if away > length:
                length, first, last = away, i, j
    if abs(area) > 1e-6 * length * length and length > 0.0:
        x, y = polygon[0, 0] + c_x / area, polygon[0, 1] + c_y / area
        area = abs(area)
    else:
        # A corner, or the middle of a side.
        x = 0.5 * (polygon[first, 0] + polygon[last, 0])
        y = 0.5 * (polygon[first, 1] + polygon[last, 1])
        area = _THIN * length
    overlap_at(textures, cx, cy, x, y, work, at)
    return at[F] >= at_zero + most - 2.0 * tie, area
