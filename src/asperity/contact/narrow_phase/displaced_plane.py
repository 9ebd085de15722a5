"""Points of a textured plane chart: `surface` for charts without curvature, several times faster.

With v(x, y) = V0 + V1 x + V2 y the normal before it is made a unit vector, p = base + t v / |v|.
By a = v.V1 / v.v and b = v.V2 / v.v,

    |v| (t v / |v|)_x = (t_x - a t) v + t V1,

and so on: all derivatives are sums of v, V1 and V2, and there is one root and one division.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.surface_patch import (
    B0,
    B1,
    B2,
    MAPPING,
    PLANAR,
    PZ,
    QINV,
    TEXTURE,
    V0,
    V1,
    V2,
    O,
    Q,
)
from asperity.texture.packed import texture_slope

P, P_X, P_Y, P_XX, P_XY, P_YY = 0, 3, 6, 9, 12, 15
"""Where `surface_at` leaves a point and its derivatives."""
POINT_SIZE = 18
_STEPS = 12
_LAST = 5e-8
"""A place this near is found by one more of Newton's steps, to about a picometre [m]."""


@small_kernel
def lift_plane(chart, x, y, height, out):
    """Fill a plane chart's point at (x, y) and its derivatives, from those of its texture."""
    t, t_x, t_y, t_xx, t_xy, t_yy = height
    u0, u1, u2 = chart[V1], chart[V1 + 1], chart[V1 + 2]
    w0, w1, w2 = chart[V2], chart[V2 + 1], chart[V2 + 2]
    v0 = chart[V0] + u0 * x + w0 * y
    v1 = chart[V0 + 1] + u1 * x + w1 * y
    v2 = chart[V0 + 2] + u2 * x + w2 * y
    over = 1.0 / (v0 * v0 + v1 * v1 + v2 * v2)
    a = (v0 * u0 + v1 * u1 + v2 * u2) * over
    b = (v0 * w0 + v1 * w1 + v2 * w2) * over
    c_xx = (u0 * u0 + u1 * u1 + u2 * u2) * over - 3.0 * a * a
    c_xy = (u0 * w0 + u1 * w1 + u2 * w2) * over - 3.0 * a * b
    c_yy = (w0 * w0 + w1 * w1 + w2 * w2) * over - 3.0 * b * b
    s = math.sqrt(over)
    t = t * s
    along_x, along_y = t_x * s - a * t, t_y * s - b * t
    bent_xx = (t_xx - 2.0 * a * t_x) * s - t * c_xx
    bent_xy = (t_xy - b * t_x - a * t_y) * s - t * c_xy
    bent_yy = (t_yy - 2.0 * b * t_y) * s - t * c_yy
    for i in range(3):
        v, u, w = (v0, v1, v2)[i], (u0, u1, u2)[i], (w0, w1, w2)[i]
        at = chart[O + i]
        q_x, q_y = (
            (chart[Q], chart[Q + 1]) if i == 0
            else ((chart[Q + 2], chart[Q + 3]) if i == 1 else (chart[PZ], chart[PZ + 1]))
        )  # fmt: skip
        out[P + i] = at + q_x * x + q_y * y + t * v
        out[P_X + i] = q_x + along_x * v + t * u
        out[P_Y + i] = q_y + along_y * v + t * w
        out[P_XX + i] = bent_xx * v + 2.0 * along_x * u
        out[P_XY + i] = bent_xy * v + along_y * u + along_x * w
        out[P_YY + i] = bent_yy * v + 2.0 * along_y * w


@inner_kernel
def place_on_plane(textures, chart, u, v):
    """Return where on a plane chart with a planar map its textured surface lies over (u, v).

    As (x, y), by Newton's method, nearly always to a picometre; nan if it fails.
    """
    k = int(chart[TEXTURE])
    du, dv = u - chart[O], v - chart[O + 1]
    x, y = chart[QINV] * du + chart[QINV + 1] * dv, chart[QINV + 2] * du + chart[QINV + 3] * dv
    if chart[MAPPING] != PLANAR:
        return x, y
    u0, u1, u2 = chart[V1], chart[V1 + 1], chart[V1 + 2]
    w0, w1, w2 = chart[V2], chart[V2 + 1], chart[V2 + 2]
    q11, q12, q21, q22 = chart[Q], chart[Q + 1], chart[Q + 2], chart[Q + 3]
    m11, m12, m21, m22 = chart[B1], chart[B2], chart[B1 + 1], chart[B2 + 1]
    for _ in range(_STEPS):
        t, h_u, h_v = texture_slope(
            textures, k, chart[B0] + m11 * x + m12 * y, chart[B0 + 1] + m21 * x + m22 * y
        )
        v0 = chart[V0] + u0 * x + w0 * y
        v1 = chart[V0 + 1] + u1 * x + w1 * y
        v2 = chart[V0 + 2] + u2 * x + w2 * y
        over = 1.0 / (v0 * v0 + v1 * v1 + v2 * v2)
        s = math.sqrt(over)
        t *= s
        along_x = (h_u * m11 + h_v * m21) * s - (v0 * u0 + v1 * u1 + v2 * u2) * over * t
        along_y = (h_u * m12 + h_v * m22) * s - (v0 * w0 + v1 * w1 + v2 * w2) * over * t
        off_u = du - q11 * x - q12 * y - t * v0
        off_v = dv - q21 * x - q22 * y - t * v1
        a, b = q11 + along_x * v0 + t * u0, q12 + along_y * v0 + t * w0
        c, d = q21 + along_x * v1 + t * u1, q22 + along_y * v1 + t * w1
        det = a * d - b * c
        error = abs(off_u) + abs(off_v)
        if det == 0.0 or not error < 1e3:
            return np.nan, np.nan
        turned = 1.0 / det
        x += (d * off_u - b * off_v) * turned
        y += (a * off_v - c * off_u) * turned
        if error < _LAST:
            break
    return x, y
