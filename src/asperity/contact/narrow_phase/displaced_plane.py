"""Displaced points of plane patches, several times faster than the general `surface_at`.

The normal before normalisation is linear, v(x, y) = V0 + V1 x + V2 y, and p = base + t v / |v|.
With a = v.V1 / v.v and b = v.V2 / v.v,

    |v| (t v / |v|)_x = (t_x - a t) v + t V1,

and so on: all derivatives are sums of v, V1 and V2, with one square root and one division.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.surface_patch import entries
from asperity.texture.packed import texture_slope

_STEPS = 12
_LAST = 5e-8
"""Residual below which one more Newton step is accurate to about a picometre [m]."""


@small_kernel
def lift_plane(patch, x, y, height, out):
    """Fill a `POINT` of a plane patch at (x, y) from its texture's height and derivatives there."""
    t, t_x, t_y, t_xx, t_xy, t_yy = height
    normal, from_x, from_y = patch.normal, patch.normal_from_x, patch.normal_from_y
    u0, u1, u2 = from_x[0], from_x[1], from_x[2]
    w0, w1, w2 = from_y[0], from_y[1], from_y[2]
    v0 = normal[0] + u0 * x + w0 * y
    v1 = normal[1] + u1 * x + w1 * y
    v2 = normal[2] + u2 * x + w2 * y
    over = 1.0 / (v0 * v0 + v1 * v1 + v2 * v2)
    a = (v0 * u0 + v1 * u1 + v2 * u2) * over
    b = (v0 * w0 + v1 * w1 + v2 * w2) * over
    c_xx = (u0 * u0 + u1 * u1 + u2 * u2) * over - 3.0 * a * a
    c_xy = (u0 * w0 + u1 * w1 + u2 * w2) * over - 3.0 * a * b
    c_yy = (w0 * w0 + w1 * w1 + w2 * w2) * over - 3.0 * b * b
    s = math.sqrt(over)
    t = t * s
    along_x, along_y = t_x * s - a * t, t_y * s - b * t
    q11, q12, q21, q22 = entries(patch.lateral)
    bent_xx = (t_xx - 2.0 * a * t_x) * s - t * c_xx
    bent_xy = (t_xy - b * t_x - a * t_y) * s - t * c_xy
    bent_yy = (t_yy - 2.0 * b * t_y) * s - t * c_yy
    for i in range(3):
        v, u, w = (v0, v1, v2)[i], (u0, u1, u2)[i], (w0, w1, w2)[i]
        at = patch.origin[i]
        q_x, q_y = ((q11, q12), (q21, q22), (patch.slope[0], patch.slope[1]))[i]
        out.p[i] = at + q_x * x + q_y * y + t * v
        out.p_x[i] = q_x + along_x * v + t * u
        out.p_y[i] = q_y + along_y * v + t * w
        out.p_xx[i] = bent_xx * v + 2.0 * along_x * u
        out.p_xy[i] = bent_xy * v + along_y * u + along_x * w
        out.p_yy[i] = bent_yy * v + 2.0 * along_y * w


@inner_kernel
def place_on_plane(textures, patch, u, v, x, y):
    """Return the parameters of a displaced plane's point at (u, v), for a planar map.

    Newton's method from (x, y), almost always to a picometre; nan if it fails.
    """
    k = patch.texture
    du, dv = u - patch.origin[0], v - patch.origin[1]
    normal, from_x, from_y = patch.normal, patch.normal_from_x, patch.normal_from_y
    u0, u1, u2 = from_x[0], from_x[1], from_x[2]
    w0, w1, w2 = from_y[0], from_y[1], from_y[2]
    q11, q12, q21, q22 = entries(patch.lateral)
    start, map_x, map_y = patch.texture_origin, patch.texture_from_x, patch.texture_from_y
    m11, m12, m21, m22 = map_x[0], map_y[0], map_x[1], map_y[1]
    for _ in range(_STEPS):
        t, h_u, h_v = texture_slope(
            textures, k, start[0] + m11 * x + m12 * y, start[1] + m21 * x + m22 * y
        )
        v0 = normal[0] + u0 * x + w0 * y
        v1 = normal[1] + u1 * x + w1 * y
        v2 = normal[2] + u2 * x + w2 * y
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
