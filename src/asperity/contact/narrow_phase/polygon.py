"""Clip convex polygons, kept in scratch memory, by half planes."""

from __future__ import annotations

import numpy as np

from asperity._core.kernels import inner_kernel
from asperity._core.stack import stack_array
from asperity.contact.narrow_phase.records import MAX_SIDES


@inner_kernel
def clip(polygon, size, a, b, r):
    """Clip a polygon (rows x, y) to `a x + b y <= r`; return the number of remaining corners.

    The first `size` rows of `polygon` (2 MAX_SIDES, 2) are the corners.
    """
    over = stack_array((MAX_SIDES,))
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
            new = kept + MAX_SIDES
            polygon[new, 0], polygon[new, 1] = polygon[j, 0], polygon[j, 1]
            kept += 1
        if (d0 < 0.0 and d1 > 0.0) or (d0 > 0.0 and d1 < 0.0):
            t, new = d0 / (d0 - d1), kept + MAX_SIDES
            polygon[new, 0] = polygon[j, 0] + t * (polygon[k, 0] - polygon[j, 0])
            polygon[new, 1] = polygon[j, 1] + t * (polygon[k, 1] - polygon[j, 1])
            kept += 1
    for j in range(kept):
        new = j + MAX_SIDES
        polygon[j, 0], polygon[j, 1] = polygon[new, 0], polygon[new, 1]
    return kept


@inner_kernel
def steepest_rise(g_x, g_y, box, limits, count, slack, polygon):
    """Return the largest `g_x dx + g_y dy` over a box within limits linearised at a point.

    `box` (x0, x1, y0, y1) is relative to that point; -inf if no part of it is within the limits.
    Concave limits are relaxed by `slack` [m]. `polygon` is scratch memory.
    """
    x0, x1, y0, y1 = box
    for i in range(4):
        polygon[i, 0] = x0 if i in (0, 3) else x1
        polygon[i, 1] = y0 if i < 2 else y1
    size = np.int64(4)
    for i in range(count):
        limit = limits[i]
        a, b = limit.g_x, limit.g_y
        r = -limit.g + (slack if limit.is_concave else 0.0)
        most = max(a * x0, a * x1) + max(b * y0, b * y1)
        if most <= r:
            continue
        size = clip(polygon, size, a, b, r)
        if size == 0:
            return -np.inf
    best = -np.inf
    for j in range(size):
        best = max(best, g_x * polygon[j, 0] + g_y * polygon[j, 1])
    return best
