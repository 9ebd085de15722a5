"""The displaced surface of a patch: points with derivatives, and heights over (u, v).

`surface_at` maps the parameters (x, y) of a patch, over which the search runs, to a point.
`height_at` returns height, slope and curvature over (u, v) of the contact frame, to compare with
the other body's point. It is in closed form unless the texture moves points sideways; then Newton's
method finds the parameters of the point.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.bounds.texture import map_speed
from asperity.contact.narrow_phase.displaced_plane import lift_plane, place_on_plane
from asperity.contact.narrow_phase.outermost import (
    base_of,
    curved_lean,
    highest_over,
    lean_at,
    may_fold,
    may_fold_near,
)
from asperity.contact.narrow_phase.smooth_base import (
    base_height_at,
    parameters_at,
    root_at,
    within_ellipse,
)
from asperity.contact.narrow_phase.surface_patch import CYLINDRICAL, PLANAR, entries
from asperity.texture.packed import texture_at

_NEWTON_STEPS = 20
_CONVERGED = 1e-16
"""Lateral residual at which Newton's method ends [m]."""
NO_WEIGHT = 1e-12
"""Weight of one of a triplanar map's three maps below which it is ignored."""
_DESCENTS = 24
"""Steps down to a folded sheet, at most."""
_NEAR_SHEET = 1e-6
"""Distance from a folded sheet at which Newton's method starts [m]."""
_NEAR = 1e-9
"""Half side of the box around a single point [m]."""
_LINEAR = 1e-12
"""Residual on a plane below which the last step is linear [m]: slopes differ by 1e-8."""


@small_kernel
def _chain_rule(height, u, v):
    """Return t and its derivatives by (x, y) from those by (u, v).

    `u` and `v` are their derivatives by x, y, xx, xy, yy.
    """
    t, h_u, h_v, h_uu, h_uv, h_vv = height
    u_x, u_y, u_xx, u_xy, u_yy = u
    v_x, v_y, v_xx, v_xy, v_yy = v
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
def planar_place(patch, axes, start, x, y, r):
    """Return two coordinates of the base point at (x, y) less `start` [m]; r is the root there.

    `axes` are the numbers of the two coordinates in the texture's frame.
    """
    i, j = axes
    at, by_x, by_y = patch.texture_origin, patch.texture_from_x, patch.texture_from_y
    a, b = patch.texture_from_root[i], patch.texture_from_root[j]
    return (
        at[i] - start[0] + by_x[i] * x + by_y[i] * y + a * r,
        at[j] - start[1] + by_x[j] * x + by_y[j] * y + b * r,
    )


@small_kernel
def cylindrical_place(patch, x, y, r):
    """Return (u, v) of a cylindrical map at (x, y) of a patch [m]; r is the root there."""
    radius, sense = patch.radius, patch.map_sense * patch.map_stretch
    return (
        patch.map_start[0] + sense * radius * math.asin(min(max(y / radius, -1.0), 1.0)),
        patch.map_start[1] + x + patch.lean * r,
    )


@small_kernel
def _planar_map(textures, patch, texture, axes, start, x, y, root):
    """Return t and its derivatives where (u, v) are those of `planar_place`."""
    i, j = axes
    by_x, by_y = patch.texture_from_x, patch.texture_from_y
    r, r_x, r_y, r_xx, r_xy, r_yy = root
    a, b = patch.texture_from_root[i], patch.texture_from_root[j]
    u, v = planar_place(patch, axes, start, x, y, r)
    return _chain_rule(
        texture_at(textures, texture, u, v),
        (by_x[i] + a * r_x, by_y[i] + a * r_y, a * r_xx, a * r_xy, a * r_yy),
        (by_x[j] + b * r_x, by_y[j] + b * r_y, b * r_xx, b * r_xy, b * r_yy),
    )  # fmt: skip


@inner_kernel
def _triplanar_map(textures, patch, texture, x, y, root):
    """Return t and its derivatives of three planar maps, weighted by the normal's fourth powers."""
    r, r_x, r_y, r_xx, r_xy, r_yy = root
    n0, n1, n2, n3 = (
        patch.body_normal, patch.body_normal_from_x, patch.body_normal_from_y,
        patch.body_normal_from_root,
    )  # fmt: skip
    start = (patch.map_start[0], patch.map_start[1])
    total = total_x = total_y = total_xx = total_xy = total_yy = 0.0
    t = t_x = t_y = t_xx = t_xy = t_yy = 0.0
    for k in range(3):
        w = n0[k] + n1[k] * x + n2[k] * y + n3[k] * r
        weight = w * w * w * w
        if weight < NO_WEIGHT:
            # Imperceptible; and a plane normal to an axis has exactly the map of that axis.
            continue
        w_x, w_y = n1[k] + n3[k] * r_x, n2[k] + n3[k] * r_y
        slope, bend, c = 4.0 * w * w * w, 12.0 * w * w, n3[k]
        weight_x, weight_y = slope * w_x, slope * w_y
        weight_xx = bend * w_x * w_x + slope * c * r_xx
        weight_xy = bend * w_x * w_y + slope * c * r_xy
        weight_yy = bend * w_y * w_y + slope * c * r_yy
        axes = ((k + 1) % 3, (k + 2) % 3)
        h = _planar_map(textures, patch, texture, axes, start, x, y, root)
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
def height_on(textures, patch, texture, x, y, root):
    """Return the height t of a texture at (x, y) of a patch, and t_x, t_y, t_xx, t_xy, t_yy.

    `texture` is the number of the patch's texture, or of a map with the same mapping.
    """
    mapping = patch.mapping
    if mapping == PLANAR:
        axes = (np.int64(0), np.int64(1))
        return _planar_map(textures, patch, texture, axes, (0.0, 0.0), x, y, root)
    if mapping == CYLINDRICAL:
        r, _, r_y, _, _, r_yy = root
        radius, lean = patch.radius, patch.lean
        sense = patch.map_sense * patch.map_stretch
        u, v = cylindrical_place(patch, x, y, r)
        return _chain_rule(
            texture_at(textures, texture, u, v),
            (0.0, sense / r, 0.0, 0.0, sense * y / (radius * radius * r * r * r)),
            (1.0, lean * r_y, 0.0, 0.0, lean * r_yy),
        )  # fmt: skip
    return _triplanar_map(textures, patch, texture, x, y, root)


@inner_kernel
def surface_at(textures, patch, x, y, out):
    """Fill a `POINT` at (x, y) of a patch; it is nan beyond the patch's ellipse."""
    root = root_at(patch, x, y)
    c = patch.bulge
    if c == 0.0 and patch.texture >= 0:
        lift_plane(patch, x, y, height_on(textures, patch, patch.texture, x, y, root), out)
        return
    r, r_x, r_y, r_xx, r_xy, r_yy = root
    q11, q12, q21, q22 = entries(patch.lateral)
    origin, slope = patch.origin, patch.slope
    out.p[0], out.p[1] = origin[0] + q11 * x + q12 * y, origin[1] + q21 * x + q22 * y
    out.p[2] = origin[2] + slope[0] * x + slope[1] * y + c * r
    out.p_x[0], out.p_x[1], out.p_x[2] = q11, q21, slope[0] + c * r_x
    out.p_y[0], out.p_y[1], out.p_y[2] = q12, q22, slope[1] + c * r_y
    for i in range(2):
        out.p_xx[i] = out.p_xy[i] = out.p_yy[i] = 0.0
    out.p_xx[2], out.p_xy[2], out.p_yy[2] = c * r_xx, c * r_xy, c * r_yy
    if patch.texture < 0:
        return
    t, t_x, t_y, t_xx, t_xy, t_yy = height_on(textures, patch, patch.texture, x, y, root)
    v0, v1, v2, v3 = patch.normal, patch.normal_from_x, patch.normal_from_y, patch.normal_from_root
    size = 1.0
    if not patch.is_unit:
        size = 0.0
        for i in range(3):
            w = v0[i] + v1[i] * x + v2[i] * y + v3[i] * r
            size += w * w
        size = math.sqrt(size)
    # Derivatives of the length of the normal.
    s_x = s_y = s_xx = s_xy = s_yy = 0.0
    if not patch.is_unit:
        for i in range(3):
            v = v0[i] + v1[i] * x + v2[i] * y + v3[i] * r
            v_x, v_y = v1[i] + v3[i] * r_x, v2[i] + v3[i] * r_y
            s_x += v * v_x / size
            s_y += v * v_y / size
            s_xx += (v_x * v_x + v * v3[i] * r_xx) / size
            s_xy += (v_x * v_y + v * v3[i] * r_xy) / size
            s_yy += (v_y * v_y + v * v3[i] * r_yy) / size
        s_xx -= s_x * s_x / size
        s_xy -= s_x * s_y / size
        s_yy -= s_y * s_y / size
    for i in range(3):
        w = (v0[i] + v1[i] * x + v2[i] * y + v3[i] * r) / size
        w_x = (v1[i] + v3[i] * r_x - w * s_x) / size
        w_y = (v2[i] + v3[i] * r_y - w * s_y) / size
        w_xx = (v3[i] * r_xx - 2.0 * w_x * s_x - w * s_xx) / size
        w_xy = (v3[i] * r_xy - w_x * s_y - w_y * s_x - w * s_xy) / size
        w_yy = (v3[i] * r_yy - 2.0 * w_y * s_y - w * s_yy) / size
        out.p[i] += t * w
        out.p_x[i] += t_x * w + t * w_x
        out.p_y[i] += t_y * w + t * w_y
        out.p_xx[i] += t_xx * w + 2.0 * t_x * w_x + t * w_xx
        out.p_xy[i] += t_xy * w + t_x * w_y + t_y * w_x + t * w_xy
        out.p_yy[i] += t_yy * w + 2.0 * t_y * w_y + t * w_yy


@inner_kernel
def _descend(textures, patch, x, y, height):
    """Return, nearly, the base of a curved patch's outermost point over the base point (x, y).

    From `height`, above all points there, it goes down no further than the texture's largest slope
    allows, and so does not pass the outermost sheet.
    """
    at_x, at_y = base_of(patch, x, y, height)
    most = textures.maps[patch.texture].max_slope
    for _ in range(_DESCENTS):
        at_x, at_y = within_ellipse(patch, at_x, at_y, 0.5 * patch.min_root)
        root = root_at(patch, at_x, at_y)
        gap = height - height_on(textures, patch, patch.texture, at_x, at_y, root)[0]
        if gap < _NEAR_SHEET:
            break
        d_x, d_y = curved_lean(patch, at_x, at_y)
        height -= gap / (1.0 + most * map_speed(patch, root[0]) * math.sqrt(d_x * d_x + d_y * d_y))
        at_x, at_y = x - height * d_x, y - height * d_y
    return at_x, at_y


@inner_kernel
def height_at(textures, patch, u, v, point):
    """Return z, z_u, z_v, z_uu, z_uv, z_vv of the displaced surface over (u, v), and (x, y).

    z is -inf where there is no such point. `point` is a `POINT` for scratch.
    """
    x, y = parameters_at(patch, u, v)
    nothing = (-np.inf, 0.0, 0.0, 0.0, 0.0, 0.0, x, y)
    if patch.texture < 0 or patch.is_level:
        z, g1, g2, k11, k12, k22 = base_height_at(patch, u, v)
        if math.isnan(z):
            return nothing
        if patch.texture < 0:
            return z, g1, g2, k11, k12, k22, x, y
        t, t_x, t_y, t_xx, t_xy, t_yy = height_on(
            textures, patch, patch.texture, x, y, root_at(patch, x, y)
        )
        i, j, k, m = entries(patch.lateral_inverse)
        return (
            z + t,
            i * t_x + k * t_y,
            j * t_x + m * t_y,
            i * (t_xx * i + t_xy * k) + k * (t_xy * i + t_yy * k),
            i * (t_xx * j + t_xy * m) + k * (t_xy * j + t_yy * m),
            j * (t_xx * j + t_xy * m) + m * (t_xy * j + t_yy * m),
            x, y,
        )  # fmt: skip
    if patch.bulge > 0.0:
        if may_fold_near(textures, patch, x, y, 0.0):
            height = highest_over(textures, patch, (x, y, _NEAR, _NEAR))
            if height > -np.inf:
                x, y = _descend(textures, patch, x, y, height)
        # Start inside the ellipse: the shift is small, and selects the side of the rim.
        x, y = within_ellipse(patch, x, y, 0.5 * patch.min_root)
    else:
        if may_fold(textures, patch):
            height = highest_over(textures, patch, (x, y, _NEAR, _NEAR))
            if height > -np.inf:
                d_x, d_y, _ = lean_at(patch, x, y, 0.0)
                x, y = x - height * d_x, y - height * d_y
        if patch.mapping == PLANAR:
            x, y = place_on_plane(textures, patch, u, v, x, y)
    error = np.inf
    a = b = c = d = det = 0.0
    for _ in range(_NEWTON_STEPS):
        surface_at(textures, patch, x, y, point)
        off_u, off_v = u - point.p[0], v - point.p[1]
        before, error = error, abs(off_u) + abs(off_v)
        a, b, c, d = point.p_x[0], point.p_y[0], point.p_x[1], point.p_y[1]
        det = a * d - b * c
        if error <= _CONVERGED or (error < 1e-13 and error >= before):
            break
        if det == 0.0 or not error < 1e3:
            return nothing
        step_x, step_y = (d * off_u - b * off_v) / det, (a * off_v - c * off_u) / det
        x, y = x + step_x, y + step_y
        if error < _LINEAR and patch.bulge == 0.0:
            point.p[0], point.p[1] = u, v
            point.p[2] += point.p_x[2] * step_x + point.p_y[2] * step_y
            break
    q11, q12, q21, q22 = entries(patch.lateral)
    # An overhanging surface is seen from inside: its determinant changes sign.
    if not error < 1e-12 or not det * (q11 * q22 - q12 * q21) > 0.0:
        return nothing
    z_x, z_y = point.p_x[2], point.p_y[2]
    g1, g2 = (d * z_x - c * z_y) / det, (a * z_y - b * z_x) / det
    z_xx = point.p_xx[2] - g1 * point.p_xx[0] - g2 * point.p_xx[1]
    z_xy = point.p_xy[2] - g1 * point.p_xy[0] - g2 * point.p_xy[1]
    z_yy = point.p_yy[2] - g1 * point.p_yy[0] - g2 * point.p_yy[1]
    i, j, k, m = d / det, -b / det, -c / det, a / det
    return (
        point.p[2], g1, g2,
        i * (z_xx * i + z_xy * k) + k * (z_xy * i + z_yy * k),
        i * (z_xx * j + z_xy * m) + k * (z_xy * j + z_yy * m),
        j * (z_xx * j + z_xy * m) + m * (z_xy * j + z_yy * m),
        x, y,
    )  # fmt: skip
