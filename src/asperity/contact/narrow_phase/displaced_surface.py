"""Points of a textured chart with their derivatives, and its height over a place.

Two ways to ask for the same surface. `surface_at` goes from the chart's parameters to a point;
it is what the search walks over. `height_at` goes from a place (u, v) of the contact frame to the
height there, with slope and curvature; it is what the other body's point is compared with. The
latter is in closed form unless the texture shifts points sideways; then the parameters of the
point are found by Newton's method.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.displaced_plane import (
    P_X,
    P_XX,
    P_XY,
    P_Y,
    P_YY,
    POINT_SIZE,
    P,
    lift_plane,
    place_on_plane,
)
from asperity.contact.narrow_phase.surface_patch import (
    B0,
    B1,
    B2,
    B3,
    CYLINDRICAL,
    LEAST_ROOT,
    LEVEL,
    MAPPING,
    PLANAR,
    PZ,
    QINV,
    ROUND,
    TEXTURE,
    UNIT,
    V0,
    V1,
    V2,
    V3,
    W0,
    W1,
    W2,
    W3,
    C,
    E,
    O,
    Q,
)
from asperity.texture.packed import texture_at

_NEWTON_STEPS = 20
_NEAR_ENOUGH = 1e-16
"""A place this near is found [m]."""
_NEARLY = 1e-12
"""From a place of a plane this near the height goes on straight: its slope changes by 1e-8 [m]."""


@small_kernel
def root_at(chart, x, y):
    """Return the root r and r_x, r_y, r_xx, r_xy, r_yy; r is nan beyond the chart's ellipse."""
    if chart[C] == 0.0:
        return 1.0, 0.0, 0.0, 0.0, 0.0, 0.0
    e11, e12, e22 = chart[E], chart[E + 1], chart[E + 2]
    qx, qy = e11 * x + e12 * y, e12 * x + e22 * y
    r = math.sqrt(1.0 - x * qx - y * qy)
    over = 1.0 / r
    r_x, r_y = -qx * over, -qy * over
    return (
        r, r_x, r_y,
        -(e11 + r_x * r_x) * over, -(e12 + r_x * r_y) * over, -(e22 + r_y * r_y) * over,
    )  # fmt: skip


@small_kernel
def _through(h, u_x, u_y, u_xx, u_xy, u_yy, v_x, v_y, v_xx, v_xy, v_yy):
    """Return t and its derivatives in (x, y) from those in (u, v), by the chain rule."""
    t, h_u, h_v, h_uu, h_uv, h_vv = h
    return (
        t,
        h_u * u_x + h_v * v_x,
        h_u * u_y + h_v * v_y,
        h_uu * u_x * u_x + 2.0 * h_uv * u_x * v_x + h_vv * v_x * v_x + h_u * u_xx + h_v * v_xx,
        h_uu * u_x * u_y + h_uv * (u_x * v_y + u_y * v_x) + h_vv * v_x * v_y
        + h_u * u_xy + h_v * v_xy,
        h_uu * u_y * u_y + 2.0 * h_uv * u_y * v_y + h_vv * v_y * v_y + h_u * u_yy + h_v * v_yy,
    )  # fmt: skip


@small_kernel
def _flat_map(textures, chart, i, j, u0, v0, x, y, root):
    """Return t and derivatives of the map by components i and j of the base point less a start."""
    r, r_x, r_y, r_xx, r_xy, r_yy = root
    a, b = chart[B3 + i], chart[B3 + j]
    u = chart[B0 + i] - u0 + chart[B1 + i] * x + chart[B2 + i] * y + a * r
    v = chart[B0 + j] - v0 + chart[B1 + j] * x + chart[B2 + j] * y + b * r
    return _through(
        texture_at(textures, int(chart[TEXTURE]), u, v),
        chart[B1 + i] + a * r_x, chart[B2 + i] + a * r_y, a * r_xx, a * r_xy, a * r_yy,
        chart[B1 + j] + b * r_x, chart[B2 + j] + b * r_y, b * r_xx, b * r_xy, b * r_yy,
    )  # fmt: skip


@inner_kernel
def _three_maps(textures, chart, x, y, root):
    """Triplanar: three flat maps, weighted by the fourth powers of the normal's components."""
    r, r_x, r_y, r_xx, r_xy, r_yy = root
    total = total_x = total_y = total_xx = total_xy = total_yy = 0.0
    t = t_x = t_y = t_xx = t_xy = t_yy = 0.0
    for k in range(3):
        w = chart[W0 + k] + chart[W1 + k] * x + chart[W2 + k] * y + chart[W3 + k] * r
        weight = w * w * w * w
        if weight < 1e-12:
            # Far below what could be felt; and a plane has exactly its own map.
            continue
        w_x, w_y = chart[W1 + k] + chart[W3 + k] * r_x, chart[W2 + k] + chart[W3 + k] * r_y
        slope, bend, c = 4.0 * w * w * w, 12.0 * w * w, chart[W3 + k]
        weight_x, weight_y = slope * w_x, slope * w_y
        weight_xx = bend * w_x * w_x + slope * c * r_xx
        weight_xy = bend * w_x * w_y + slope * c * r_xy
        weight_yy = bend * w_y * w_y + slope * c * r_yy
        h = _flat_map(
            textures, chart, (k + 1) % 3, (k + 2) % 3, chart[ROUND], chart[ROUND + 1], x, y, root
        )
        total += weight
        total_x += weight_x
        total_y += weight_y
        t += weight * h[0]
        t_x += weight * h[1] + weight_x * h[0]
        t_y += weight * h[2] + weight_y * h[0]
        total_xx += weight_xx
        total_xy += weight_xy
        total_yy += weight_yy
        t_xx += weight * h[3] + 2.0 * weight_x * h[1] + weight_xx * h[0]
        t_xy += weight * h[4] + weight_x * h[2] + weight_y * h[1] + weight_xy * h[0]
        t_yy += weight * h[5] + 2.0 * weight_y * h[2] + weight_yy * h[0]
    t /= total
    t_x, t_y = (t_x - t * total_x) / total, (t_y - t * total_y) / total
    t_xx = (t_xx - 2.0 * t_x * total_x - t * total_xx) / total
    t_xy = (t_xy - t_x * total_y - t_y * total_x - t * total_xy) / total
    t_yy = (t_yy - 2.0 * t_y * total_y - t * total_yy) / total
    return t, t_x, t_y, t_xx, t_xy, t_yy


@small_kernel
def height_on(textures, chart, x, y, root):
    """Return the texture's height t at a chart's (x, y), and t_x, t_y, t_xx, t_xy, t_yy."""
    mapping = chart[MAPPING]
    if mapping == PLANAR:
        return _flat_map(textures, chart, np.int64(0), np.int64(1), 0.0, 0.0, x, y, root)
    if mapping == CYLINDRICAL:
        r, _, r_y, _, _, r_yy = root
        radius, lean = chart[ROUND], chart[ROUND + 4]
        sense = chart[ROUND + 2] * chart[ROUND + 5]
        u = chart[ROUND + 1] + sense * radius * math.asin(min(max(y / radius, -1.0), 1.0))
        v = chart[ROUND + 3] + x + lean * r
        return _through(
            texture_at(textures, int(chart[TEXTURE]), u, v),
            0.0, sense / r, 0.0, 0.0, sense * y / (radius * radius * r * r * r),
            1.0, lean * r_y, 0.0, 0.0, lean * r_yy,
        )  # fmt: skip
    return _three_maps(textures, chart, x, y, root)


@inner_kernel
def surface_at(textures, chart, x, y, out):
    """Fill a chart's point at (x, y) and all derivatives up to the second; see `P`, `P_X`, ...

    The point is nan beyond the chart's ellipse.
    """
    root = root_at(chart, x, y)
    c = chart[C]
    if c == 0.0 and chart[TEXTURE] >= 0.0:
        lift_plane(chart, x, y, height_on(textures, chart, x, y, root), out)
        return
    r, r_x, r_y, r_xx, r_xy, r_yy = root
    out[P], out[P + 1] = (
        chart[O] + chart[Q] * x + chart[Q + 1] * y,
        chart[O + 1] + chart[Q + 2] * x + chart[Q + 3] * y,
    )
    out[P + 2] = chart[O + 2] + chart[PZ] * x + chart[PZ + 1] * y + c * r
    out[P_X], out[P_X + 1], out[P_X + 2] = chart[Q], chart[Q + 2], chart[PZ] + c * r_x
    out[P_Y], out[P_Y + 1], out[P_Y + 2] = chart[Q + 1], chart[Q + 3], chart[PZ + 1] + c * r_y
    for i in range(P_XX, POINT_SIZE):
        out[i] = 0.0
    out[P_XX + 2], out[P_XY + 2], out[P_YY + 2] = c * r_xx, c * r_xy, c * r_yy
    if chart[TEXTURE] < 0.0:
        return
    t, t_x, t_y, t_xx, t_xy, t_yy = height_on(textures, chart, x, y, root)
    size = 1.0
    if chart[UNIT] == 0.0:
        size = 0.0
        for i in range(3):
            w = chart[V0 + i] + chart[V1 + i] * x + chart[V2 + i] * y + chart[V3 + i] * r
            size += w * w
        size = math.sqrt(size)
    # Of the normal's length, the slope and the curvature along x and y.
    s_x = s_y = s_xx = s_xy = s_yy = 0.0
    if chart[UNIT] == 0.0:
        for i in range(3):
            v = chart[V0 + i] + chart[V1 + i] * x + chart[V2 + i] * y + chart[V3 + i] * r
            v_x, v_y = chart[V1 + i] + chart[V3 + i] * r_x, chart[V2 + i] + chart[V3 + i] * r_y
            s_x += v * v_x / size
            s_y += v * v_y / size
            s_xx += (v_x * v_x + v * chart[V3 + i] * r_xx) / size
            s_xy += (v_x * v_y + v * chart[V3 + i] * r_xy) / size
            s_yy += (v_y * v_y + v * chart[V3 + i] * r_yy) / size
        s_xx -= s_x * s_x / size
        s_xy -= s_x * s_y / size
        s_yy -= s_y * s_y / size
    for i in range(3):
        w = (chart[V0 + i] + chart[V1 + i] * x + chart[V2 + i] * y + chart[V3 + i] * r) / size
        w_x = (chart[V1 + i] + chart[V3 + i] * r_x - w * s_x) / size
        w_y = (chart[V2 + i] + chart[V3 + i] * r_y - w * s_y) / size
        w_xx = (chart[V3 + i] * r_xx - 2.0 * w_x * s_x - w * s_xx) / size
        w_xy = (chart[V3 + i] * r_xy - w_x * s_y - w_y * s_x - w * s_xy) / size
        w_yy = (chart[V3 + i] * r_yy - 2.0 * w_y * s_y - w * s_yy) / size
        out[P + i] += t * w
        out[P_X + i] += t_x * w + t * w_x
        out[P_Y + i] += t_y * w + t * w_y
        out[P_XX + i] += t_xx * w + 2.0 * t_x * w_x + t * w_xx
        out[P_XY + i] += t_xy * w + t_x * w_y + t_y * w_x + t * w_xy
        out[P_YY + i] += t_yy * w + 2.0 * t_y * w_y + t * w_yy


@small_kernel
def parameters_under(chart, u, v):
    """Return the parameters (x, y) whose base point lies at (u, v)."""
    du, dv = u - chart[O], v - chart[O + 1]
    return chart[QINV] * du + chart[QINV + 1] * dv, chart[QINV + 2] * du + chart[QINV + 3] * dv


@small_kernel
def over_base(chart, u, v):
    """Return z, z_u, z_v, z_uu, z_uv, z_vv of the smooth base over (u, v); nan where it ends."""
    x, y = parameters_under(chart, u, v)
    r, r_x, r_y, r_xx, r_xy, r_yy = root_at(chart, x, y)
    c = chart[C]
    i, j, k, m = chart[QINV], chart[QINV + 1], chart[QINV + 2], chart[QINV + 3]
    z_x, z_y = chart[PZ] + c * r_x, chart[PZ + 1] + c * r_y
    z = chart[O + 2] + chart[PZ] * x + chart[PZ + 1] * y + c * r
    k11 = c * (i * (r_xx * i + r_xy * k) + k * (r_xy * i + r_yy * k))
    k12 = c * (i * (r_xx * j + r_xy * m) + k * (r_xy * j + r_yy * m))
    k22 = c * (j * (r_xx * j + r_xy * m) + m * (r_xy * j + r_yy * m))
    return z, i * z_x + k * z_y, j * z_x + m * z_y, k11, k12, k22


@inner_kernel
def height_at(textures, chart, u, v, work):
    """Return z, z_u, z_v, z_uu, z_uv, z_vv of a chart's textured surface over (u, v), and (x, y).

    z is -inf where there is no such point. `work` (18,) is written to.
    """
    x, y = parameters_under(chart, u, v)
    nothing = (-np.inf, 0.0, 0.0, 0.0, 0.0, 0.0, x, y)
    if chart[TEXTURE] < 0.0 or chart[LEVEL] == 1.0:
        z, g1, g2, k11, k12, k22 = over_base(chart, u, v)
        if math.isnan(z):
            return nothing
        if chart[TEXTURE] < 0.0:
            return z, g1, g2, k11, k12, k22, x, y
        t, t_x, t_y, t_xx, t_xy, t_yy = height_on(textures, chart, x, y, root_at(chart, x, y))
        i, j, k, m = chart[QINV], chart[QINV + 1], chart[QINV + 2], chart[QINV + 3]
        return (
            z + t,
            i * t_x + k * t_y,
            j * t_x + m * t_y,
            i * (t_xx * i + t_xy * k) + k * (t_xy * i + t_yy * k),
            i * (t_xx * j + t_xy * m) + k * (t_xy * j + t_yy * m),
            j * (t_xx * j + t_xy * m) + m * (t_xy * j + t_yy * m),
            x, y,
        )  # fmt: skip
    # A start inside the ellipse: the shift is small, and decides which side of its rim counts.
    if chart[C] > 0.0:
        inside = x * (chart[E] * x + chart[E + 1] * y) + y * (chart[E + 1] * x + chart[E + 2] * y)
        most = 1.0 - 0.25 * chart[LEAST_ROOT] ** 2
        if inside > most:
            scale = math.sqrt(most / inside)
            x, y = x * scale, y * scale
    elif chart[MAPPING] == PLANAR:
        x, y = place_on_plane(textures, chart, u, v)
    error = np.inf
    a = b = c = d = det = 0.0
    for _ in range(_NEWTON_STEPS):
        surface_at(textures, chart, x, y, work)
        off_u, off_v = u - work[P], v - work[P + 1]
        before, error = error, abs(off_u) + abs(off_v)
        a, b, c, d = work[P_X], work[P_Y], work[P_X + 1], work[P_Y + 1]
        det = a * d - b * c
        if error <= _NEAR_ENOUGH or (error < 1e-13 and error >= before):
            break
        if det == 0.0 or not error < 1e3:
            return nothing
        step_x, step_y = (d * off_u - b * off_v) / det, (a * off_v - c * off_u) / det
        x, y = x + step_x, y + step_y
        if error < _NEARLY and chart[C] == 0.0:
            work[P], work[P + 1] = u, v
            work[P + 2] += work[P_X + 2] * step_x + work[P_Y + 2] * step_y
            break
    # A surface that hangs over is seen here from within: its determinant changes sign.
    if not error < 1e-12 or not det * (chart[Q] * chart[Q + 3] - chart[Q + 1] * chart[Q + 2]) > 0.0:
        return nothing
    z_x, z_y = work[P_X + 2], work[P_Y + 2]
    g1, g2 = (d * z_x - c * z_y) / det, (a * z_y - b * z_x) / det
    z_xx = work[P_XX + 2] - g1 * work[P_XX] - g2 * work[P_XX + 1]
    z_xy = work[P_XY + 2] - g1 * work[P_XY] - g2 * work[P_XY + 1]
    z_yy = work[P_YY + 2] - g1 * work[P_YY] - g2 * work[P_YY + 1]
    i, j, k, m = d / det, -b / det, -c / det, a / det
    return (
        work[P + 2], g1, g2,
        i * (z_xx * i + z_xy * k) + k * (z_xy * i + z_yy * k),
        i * (z_xx * j + z_xy * m) + k * (z_xy * j + z_yy * m),
        j * (z_xx * j + z_xy * m) + m * (z_xy * j + z_yy * m),
        x, y,
    )  # fmt: skip
