"""Tighten the second-order bound of a box by the limits of both patches."""

from __future__ import annotations

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity._core.records import copy_record
from asperity.contact.narrow_phase.bounds.curvature import CONCAVE
from asperity.contact.narrow_phase.bounds.limits import rise_within
from asperity.contact.narrow_phase.newton_ascent import constrained_step, newton_ascent
from asperity.contact.narrow_phase.overlap import limits_at, overlap_at

_QUICK_STEPS = 2


@small_kernel
def _newton_step(at, box):
    """Return a point of a box nearer to a concave function's maximum in it.

    It is one Newton step; if that leaves the box, the step along its side.
    """
    x0, x1, y0, y1 = box
    x, y = at.x, at.y
    g_x, g_y, h_xx, h_xy, h_yy = at.f_x, at.f_y, at.f_xx, at.f_xy, at.f_yy
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
def _constrained_newton_step(patch, other, x, y, box, search):
    """Return a point of a box nearer to the maximum within the limits, and whether there is one."""
    x0, x1, y0, y1 = box
    count = limits_at(patch, other, search.at, search.limits)
    stride = max(x1 - x0, y1 - y0)
    dx, dy, found = constrained_step(search.at, x, y, box, stride, count, search)
    return min(max(x + dx, x0), x1), min(max(y + dy, y0), y1), found


@small_kernel
def _shift(box, x, y):
    """Return a box relative to (x, y)."""
    x0, x1, y0, y1 = box
    return x0 - x, x1 - x, y0 - y, y1 - y


@inner_kernel
def tighten_bound(textures, pair, box, found, threshold, search):
    """Return a tighter bound than `found`, a `BoxBound`, and whether `search.at` is within limits.

    If f is concave, the bound is that of the tangent plane at the maximum. Newton's method ends
    early if the tangent plane at a point on the way gives a bound below `threshold`.
    """
    patch, other, at, best = pair.patch, pair.other, search.at, search.best
    bound, level, slack = found.value, found.level, found.slack
    x0, x1, y0, y1 = box
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    is_inside = True
    if found.kind == CONCAVE:
        slack *= 4.0  # from any point of the box, not only its centre
        if best.pair == pair.number and x0 <= best.x <= x1 and y0 <= best.y <= y1:
            # If the box contains the incumbent, that is its only maximum.
            copy_record(at, best)
        else:
            for _ in range(_QUICK_STEPS):
                if not at.f_xx * at.f_yy > at.f_xy * at.f_xy:
                    break
                # A point too deep to be pruned, and the maximum, may be beyond a limit.
                use_limits = at.f > threshold
                if use_limits:
                    high = at.f + rise_within(patch, other, at, _shift(box, x, y), slack, search)
                    if high <= threshold:
                        return min(bound, high), False
                    x, y, exists = _constrained_newton_step(patch, other, x, y, box, search)
                    if not exists:
                        break
                else:
                    x, y = _newton_step(at, box)
                overlap_at(textures, patch, other, x, y, search, at)
                if at.f == -np.inf:
                    break
                if not use_limits:
                    g_x, g_y = at.f_x, at.f_y
                    high = at.f + max(g_x * (x0 - x), g_x * (x1 - x))
                    high += max(g_y * (y0 - y), g_y * (y1 - y))
                elif at.f <= threshold:
                    high = at.f + rise_within(patch, other, at, _shift(box, x, y), slack, search)
                if high <= threshold:
                    return min(bound, high), False
            stride = max(x1 - x0, y1 - y0)
            is_inside = newton_ascent(textures, patch, other, box, x, y, stride, search)
            if at.f == -np.inf:
                return bound, False
        x, y, level = at.x, at.y, at.f
    within = level + rise_within(patch, other, at, _shift(box, x, y), slack, search)
    return min(bound, within), is_inside
