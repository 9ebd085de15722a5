"""A smooth ball over a level textured plate: the common case, for which much is simpler."""

from __future__ import annotations

import math

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.displaced_surface import parameters_under
from asperity.contact.narrow_phase.surface_patch import (
    B0,
    B1,
    B2,
    LEVEL,
    MAPPING,
    PLANAR,
    PZ,
    Q_LEAST,
    Q_MOST,
    TEXTURE,
    C,
    E,
    O,
)
from asperity.texture.packed import texture_at

_STEPS = 8
_CLOSE = 1e-7  # what is left is for a step or two of the careful climb [m]


@small_kernel
def is_ball_over_plate(cx, cy):
    """Return whether X is a level textured plate and Y a smooth ball: the common case."""
    return (
        cx[LEVEL] == 1.0
        and cx[MAPPING] == PLANAR
        and cx[TEXTURE] >= 0.0
        and cy[TEXTURE] < 0.0
        and cy[C] > 0.0
        and cy[PZ] == cy[PZ + 1] == 0.0
        and abs(cy[E] - cy[E + 2]) <= 1e-12 * cy[E]
        and abs(cy[E + 1]) <= 1e-12 * cy[E]
        and abs(cx[Q_LEAST] - 1.0) + abs(cx[Q_MOST] - 1.0) < 1e-12
    )


@small_kernel
def _overlap(textures, cx, cy, ax, ay, x, y):
    """Return the overlap at (x, y) but for a constant, and its five derivatives."""
    t, t_u, t_v, t_uu, t_uv, t_vv = texture_at(
        textures, int(cx[TEXTURE]), cx[B0] + cx[B1] * x + cx[B2] * y,
        cx[B0 + 1] + cx[B1 + 1] * x + cx[B2 + 1] * y,
    )  # fmt: skip
    a, b, c, d = cx[B1], cx[B2], cx[B1 + 1], cx[B2 + 1]
    dx, dy, e = x - ax, y - ay, cy[E]
    root = math.sqrt(max(1.0 - e * (dx * dx + dy * dy), 1e-6))
    slope = cy[C] * e / root
    bend = slope * e / (root * root)
    return (
        t + cy[C] * root,
        t_u * a + t_v * c - slope * dx,
        t_u * b + t_v * d - slope * dy,
        t_uu * a * a + 2.0 * t_uv * a * c + t_vv * c * c - slope - bend * dx * dx,
        t_uu * a * b + t_uv * (a * d + b * c) + t_vv * c * d - bend * dx * dy,
        t_uu * b * b + 2.0 * t_uv * b * d + t_vv * d * d - slope - bend * dy * dy,
    )


@inner_kernel
def rolled_uphill(textures, cx, cy, box, x, y, stride):
    """Return a place near the local maximum uphill of (x, y), as far as Newton's steps go.

    They stop at the sides of the box, where the overlap is not concave, and where one does not
    gain: `climb` goes on from there. A step costs a tenth of one of `climb`.
    """
    x0, x1, y0, y1 = box
    ax, ay = parameters_under(cx, cy[O], cy[O + 1])
    f, f_x, f_y, f_xx, f_xy, f_yy = _overlap(textures, cx, cy, ax, ay, x, y)
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
        g, g_x, g_y, g_xx, g_xy, g_yy = _overlap(textures, cx, cy, ax, ay, new_x, new_y)
        if not g > f:
            break
        x, y, f, f_x, f_y, f_xx, f_xy, f_yy = new_x, new_y, g, g_x, g_y, g_xx, g_xy, g_yy
        if size < _CLOSE:
            break
    return x, y
