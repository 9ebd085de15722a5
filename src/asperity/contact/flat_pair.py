"""Two smooth plane charts: their overlap is linear, and its maximum is in a corner.

Flat on flat, all of a polygon is equally deep, or one of its sides. Then the middle stands for
it, with its area, or its length, as weight.
"""

from __future__ import annotations

import math

import numpy as np

from asperity.compiled import lean_kernel
from asperity.contact.chart import ROWS, TEXTURE, C
from asperity.contact.overlap import (
    BORDERS,
    F_X,
    F_Y,
    LINES,
    POLYGON,
    F,
    borders_at,
    overlap_at,
)

_ROOM = 36  # a polygon of this many corners at most, and as many being made
_THIN = 1e-9
"""What a line's length is worth as an area, over its length [m]."""


@lean_kernel
def is_straight(chart):
    """Return whether a chart is plane and smooth with straight sides, unlike a cylinder's end."""
    if chart[C] > 0.0 or chart[TEXTURE] >= 0.0:
        return False
    bent = False
    for i in range(int(chart[ROWS])):
        bent = bent or chart[ROWS + 5 + 6 * i] != 0.0
    return not bent


@lean_kernel
def _clipped(polygon, size, a, b, r):
    """Cut a polygon (rows x, y, -, -) to `a x + b y <= r`; return how many corners are left."""
    kept = 0
    for j in range(size):
        k = j + 1 if j + 1 < size else 0
        d0 = a * polygon[j, 0] + b * polygon[j, 1] - r
        d1 = a * polygon[k, 0] + b * polygon[k, 1] - r
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


@lean_kernel
def flat_best(textures, cx, cy, window, tie, work, at):
    """Fill `at` (22,) with the deepest place of two smooth plane charts.

    Parameters
    ----------
    window : (x0, x1, y0, y1)
        The part of X's rectangle that counts.
    tie : float
        Corners that are less deep by at most this count as equally deep [m].

    Returns
    -------
    tuple (bool, float)
        Whether there is such a place; the area that it stands for [m^2].
    """
    x0, x1, y0, y1 = window
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    overlap_at(textures, cx, cy, x, y, work, at)
    if at[F] == -np.inf:
        return False, 0.0
    middle, g_x, g_y = at[F], at[F_X], at[F_Y]
    borders, polygon = work[BORDERS:LINES], work[POLYGON:]
    count = borders_at(cx, cy, at, borders)
    for i in range(4):
        polygon[i, 0] = (x0 if i in (0, 3) else x1) - x
        polygon[i, 1] = (y0 if i < 2 else y1) - y
    size = np.int64(4)
    for i in range(count):
        size = _clipped(polygon, size, borders[i, 1], borders[i, 2], -borders[i, 0])
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
        x += polygon[0, 0] + c_x / area
        y += polygon[0, 1] + c_y / area
        area = abs(area)
    else:
        # A corner, or the middle of a side.
        x += 0.5 * (polygon[first, 0] + polygon[last, 0])
        y += 0.5 * (polygon[first, 1] + polygon[last, 1])
        area = _THIN * length
    overlap_at(textures, cx, cy, x, y, work, at)
    return at[F] >= middle + most - 2.0 * tie, area
