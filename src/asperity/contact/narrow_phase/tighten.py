"""The sharpest bound of a box, for which its surroundings are climbed, or nearly so."""

from __future__ import annotations

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.bounds.borders import rise_within
from asperity.contact.narrow_phase.bounds.curvature import CONCAVE
from asperity.contact.narrow_phase.newton_ascent import climb, step_within
from asperity.contact.narrow_phase.overlap import (
    BORDERS,
    F_X,
    F_XX,
    F_XY,
    F_Y,
    F_YY,
    LINES,
    OVERLAP_SIZE,
    POLYGON,
    F,
    X,
    Y,
    borders_at,
    overlap_at,
)

_QUICK_STEPS = 2


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
                    high = at[F] + rise_within(
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
                    high = at[F] + rise_within(
                        cx, cy, at, x0 - x, x1 - x, y0 - y, y1 - y, loose, work
                    )
                if high <= enough:
                    return min(bound, high), False
            there = climb(textures, cx, cy, box, x, y, stride, work, at)
            if at[F] == -np.inf:
                return bound, False
        x, y, second = at[X], at[Y], at[F]
    within = second + rise_within(cx, cy, at, x0 - x, x1 - x, y0 - y, y1 - y, loose, work)
    return min(bound, within), there
