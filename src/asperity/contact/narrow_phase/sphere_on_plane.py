"""Fast path for a smooth sphere over a level textured plane, the most common contact."""

from __future__ import annotations

import math

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.smooth_base import parameters_at
from asperity.contact.narrow_phase.surface_patch import PLANAR
from asperity.texture.packed import texture_at

_STEPS = 8
_CLOSE = 1e-7
"""Step length below which `newton_ascent` takes over [m]."""


@small_kernel
def is_sphere_on_plane(patch, other):
    """Return whether `patch` is a level textured plane and `other` a smooth sphere."""
    return (
        patch.is_level
        and patch.mapping == PLANAR
        and patch.texture >= 0
        and patch.stiffness_map < 0
        and other.texture < 0
        and other.bulge > 0.0
        and other.slope[0] == other.slope[1] == 0.0
        and abs(other.ellipse[0] - other.ellipse[2]) <= 1e-12 * other.ellipse[0]
        and abs(other.ellipse[1]) <= 1e-12 * other.ellipse[0]
        and abs(patch.lateral_min - 1.0) + abs(patch.lateral_max - 1.0) < 1e-12
    )


@small_kernel
def _overlap(textures, patch, other, ax, ay, x, y):
    """Return the overlap at (x, y) up to a constant, and its five derivatives.

    (ax, ay) are the plane's parameters at the sphere's centre.
    """
    at, by_x, by_y = patch.texture_origin, patch.texture_from_x, patch.texture_from_y
    a, b, c, d = by_x[0], by_y[0], by_x[1], by_y[1]
    t, t_u, t_v, t_uu, t_uv, t_vv = texture_at(
        textures, patch.texture, at[0] + a * x + b * y, at[1] + c * x + d * y
    )
    dx, dy, e = x - ax, y - ay, other.ellipse[0]
    root = math.sqrt(max(1.0 - e * (dx * dx + dy * dy), 1e-6))
    slope = other.bulge * e / root
    bend = slope * e / (root * root)
    return (
        t + other.bulge * root,
        t_u * a + t_v * c - slope * dx,
        t_u * b + t_v * d - slope * dy,
        t_uu * a * a + 2.0 * t_uv * a * c + t_vv * c * c - slope - bend * dx * dx,
        t_uu * a * b + t_uv * (a * d + b * c) + t_vv * c * d - bend * dx * dy,
        t_uu * b * b + 2.0 * t_uv * b * d + t_vv * d * d - slope - bend * dy * dy,
    )


@inner_kernel
def ascend_sphere(textures, patch, other, box, x, y, stride):
    """Return a point nearer to the local maximum uphill of (x, y), by plain Newton steps.

    They end at the sides of the box, where the overlap is not concave, or without a gain;
    `newton_ascent`, whose steps cost ten times as much, continues from there.
    """
    x0, x1, y0, y1 = box
    ax, ay = parameters_at(patch, other.origin[0], other.origin[1])
    f, f_x, f_y, f_xx, f_xy, f_yy = _overlap(textures, patch, other, ax, ay, x, y)
    for _ in range(_STEPS):
        det = f_xx * f_yy - f_xy * f_xy
        if not (f_xx < 0.0 and det > 0.0):
            break
        step_x = (f_xy * f_y - f_yy * f_x) / det
        step_y = (f_xy * f_x - f_xx * f_y) / det
        size = max(abs(step_x), abs(step_y))
        if size > stride:
            step_x, step_y = step_x * stride / size, step_y * stride / size
        new_x, new_y = x + step_x, y + step_y
        if not (x0 < new_x < x1 and y0 < new_y < y1):
            break
        g, g_x, g_y, g_xx, g_xy, g_yy = _overlap(textures, patch, other, ax, ay, new_x, new_y)
        if not g > f:
            break
        x, y, f, f_x, f_y, f_xx, f_xy, f_yy = new_x, new_y, g, g_x, g_y, g_xx, g_xy, g_yy
        if size < _CLOSE:
            break
    return x, y
