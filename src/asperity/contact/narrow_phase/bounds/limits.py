"""Bounds by the limits of two patches: boxes beyond them, and the rise within them."""

from __future__ import annotations

from asperity._core.kernels import inner_kernel
from asperity.contact.narrow_phase.overlap import limits_at
from asperity.contact.narrow_phase.polygon import steepest_rise

_NO_RISE = 1e-13
"""Rise below which the limits are ignored [m]."""


@inner_kernel
def rise_within(patch, other, at, box, slack, search):
    """Return the largest rise along the tangent plane at `at` over a box within the limits.

    `box` (x0, x1, y0, y1) is relative to the point; limits are within `slack` of their tangents
    [m].
    """
    x0, x1, y0, y1 = box
    g_x, g_y = at.f_x, at.f_y
    rise = max(g_x * x0, g_x * x1) + max(g_y * y0, g_y * y1)
    if rise <= _NO_RISE:
        return rise
    limits = search.limits
    count = limits_at(patch, other, at, limits)
    is_near = False
    for i in range(count):
        limit = limits[i]
        # A convex limit is curved too where a texture moves points laterally.
        limit.g -= 0.0 if limit.is_concave else slack
        a, b = limit.g_x, limit.g_y
        reach = max(a * x0, a * x1) + max(b * y0, b * y1)
        is_near = is_near or reach > -limit.g + (slack if limit.is_concave else 0.0)
    if not is_near:
        return rise
    return steepest_rise(g_x, g_y, box, limits, count, slack, search.polygon)
