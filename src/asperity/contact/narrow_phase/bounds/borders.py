"""What the borders of two charts allow: whether a box lies beyond them, the rise within them."""

from __future__ import annotations

import math

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.bounds.texture import roots_over
from asperity.contact.narrow_phase.displaced_surface import root_at
from asperity.contact.narrow_phase.overlap import (
    BORDERS,
    F_X,
    F_Y,
    LINES,
    POLYGON,
    borders_at,
    steepest_rise,
)
from asperity.contact.narrow_phase.surface_patch import E_MOST, LEAST_ROOT, RECTANGLE, ROWS, C

HAIR = 1e-6
"""Boxes on an overhang are not divided below this [m]."""
_NO_RISE = 1e-13  # not worth a look at the borders [m]


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
def beside(chart, x, y, reach):
    """Return whether nothing of a chart lies within `reach` of (x, y), in its parameters."""
    if chart[C] > 0.0:
        _, most = roots_over(chart, x, y, reach)
        if most < chart[LEAST_ROOT]:
            return True
        return beyond_rows(chart, x, y, reach, reach)
    out_x = max(chart[RECTANGLE] - x, x - chart[RECTANGLE + 1])
    out_y = max(chart[RECTANGLE + 2] - y, y - chart[RECTANGLE + 3])
    return max(out_x, out_y) > reach or beyond_rows(chart, x, y, reach, reach)


@inner_kernel
def rise_within(cx, cy, at, x0, x1, y0, y1, loose, work):
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
