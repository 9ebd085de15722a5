"""The overlap of two patches, which the search maximises, and the limits of both patches.

The point `p(x, y)` of the first patch is compared with the height of the other over the same
(u, v). The heights of each body are along its own outward z, so the overlap is their sum,

    f(x, y) = z(x, y) + H(u(x, y), v(x, y)).

The limits are inequalities `g(x, y) <= 0`: the borders of both patches, the ellipse of a curved
one, and the four sides of the other's rectangle. The sides of the first patch's rectangle are those
of the box that is searched.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.compliance import lower
from asperity.contact.narrow_phase.displaced_surface import height_at, height_on, surface_at
from asperity.contact.narrow_phase.smooth_base import (
    base_height_at,
    ellipse_form,
    parameters_at,
    place_at,
    root_at,
)
from asperity.contact.narrow_phase.surface_patch import entries


@small_kernel
def overlap_on_level(textures, patch, other, x, y, out):
    """Fill an `OVERLAP` of a level patch and a smooth other one; see `overlap_at`."""
    u, v = place_at(patch, x, y)
    t = t_x = t_y = t_xx = t_xy = t_yy = 0.0
    z, g1, g2, k11, k12, k22 = base_height_at(other, u, v)
    out.x, out.y = x, y
    if math.isnan(z):
        out.f = -np.inf
        return
    if patch.texture >= 0:
        t, t_x, t_y, t_xx, t_xy, t_yy = height_on(
            textures, patch, patch.texture, x, y, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        )
    a, b, c, d = entries(patch.lateral)
    out.point[0], out.point[1], out.point[2] = u, v, patch.origin[2] + t
    out.f = out.point[2] + z
    out.f_x = t_x + g1 * a + g2 * c
    out.f_y = t_y + g1 * b + g2 * d
    out.f_xx = t_xx + a * (k11 * a + k12 * c) + c * (k12 * a + k22 * c)
    out.f_xy = t_xy + a * (k11 * b + k12 * d) + c * (k12 * b + k22 * d)
    out.f_yy = t_yy + b * (k11 * b + k12 * d) + d * (k12 * b + k22 * d)
    i, j, k, m = entries(other.lateral_inverse)
    out.other_x, out.other_y = parameters_at(other, u, v)
    out.jacobian[0, 0], out.jacobian[0, 1] = i * a + j * c, i * b + j * d
    out.jacobian[1, 0], out.jacobian[1, 1] = k * a + m * c, k * b + m * d
    i, j, k, m = entries(patch.lateral_inverse)
    out.slope[0], out.slope[1] = i * t_x + k * t_y, j * t_x + m * t_y
    out.other_slope[0], out.other_slope[1] = g1, g2
    out.other_z = z
    for n in range(3):
        out.jacobian_bend[0, n] = out.jacobian_bend[1, n] = 0.0


@inner_kernel
def overlap_at(textures, patch, other, x, y, search, out):
    """Fill an `OVERLAP` of two patches at (x, y) of the first; `search` has scratch memory.

    Under the load of a search it is lowered: see `compliance`.
    """
    if patch.is_level and other.texture < 0:
        overlap_on_level(textures, patch, other, x, y, out)
        if search.load > 0.0:
            lower(textures, patch, other, entries(patch.lateral), search, out)
        return
    surface_at(textures, patch, x, y, search.surface)
    overlap_under(textures, patch, other, x, y, search, out)


@inner_kernel
def overlap_under(textures, patch, other, x, y, search, out):
    """Fill an `OVERLAP` at (x, y), of which `search.surface` is the first patch's point."""
    point, below = search.surface, search.other_surface
    out.x, out.y = x, y
    u, v = point.p[0], point.p[1]
    out.f = -np.inf
    out.other_x = out.other_y = np.nan
    if not (u == u and v == v and point.p[2] == point.p[2]):
        return
    z, g1, g2, k11, k12, k22, bx, by = height_at(textures, other, u, v, below)
    out.other_x, out.other_y = bx, by
    if z == -np.inf:
        return
    u_x, v_x, u_y, v_y = point.p_x[0], point.p_x[1], point.p_y[0], point.p_y[1]
    ku_x, kv_x = k11 * u_x + k12 * v_x, k12 * u_x + k22 * v_x
    ku_y, kv_y = k11 * u_y + k12 * v_y, k12 * u_y + k22 * v_y
    out.f = point.p[2] + z
    out.f_x = point.p_x[2] + g1 * u_x + g2 * v_x
    out.f_y = point.p_y[2] + g1 * u_y + g2 * v_y
    out.f_xx = point.p_xx[2] + g1 * point.p_xx[0] + g2 * point.p_xx[1] + u_x * ku_x + v_x * kv_x
    out.f_xy = point.p_xy[2] + g1 * point.p_xy[0] + g2 * point.p_xy[1] + u_x * ku_y + v_x * kv_y
    out.f_yy = point.p_yy[2] + g1 * point.p_yy[0] + g2 * point.p_yy[1] + u_y * ku_y + v_y * kv_y
    i, j, k, m = entries(other.lateral_inverse)
    is_implicit = other.texture >= 0 and not other.is_level
    if is_implicit:
        a, b, c, d = below.p_x[0], below.p_y[0], below.p_x[1], below.p_y[1]
        det = a * d - b * c
        i, j, k, m = d / det, -b / det, -c / det, a / det
    x_x, x_y = i * u_x + j * v_x, i * u_y + j * v_y
    y_x, y_y = k * u_x + m * v_x, k * u_y + m * v_y
    out.jacobian[0, 0], out.jacobian[0, 1] = x_x, x_y
    out.jacobian[1, 0], out.jacobian[1, 1] = y_x, y_y
    for n in range(3):
        # By xx, xy and yy of the first patch's parameters.
        second = point.p_xx if n == 0 else (point.p_xy if n == 1 else point.p_yy)
        u_nn, v_nn = second[0], second[1]
        if is_implicit:
            a, b = (x_x, x_x) if n == 0 else ((x_x, x_y) if n == 1 else (x_y, x_y))
            c, d = (y_x, y_x) if n == 0 else ((y_x, y_y) if n == 1 else (y_y, y_y))
            cross = a * d + b * c
            u_nn -= below.p_xx[0] * a * b + below.p_xy[0] * cross + below.p_yy[0] * c * d
            v_nn -= below.p_xx[1] * a * b + below.p_xy[1] * cross + below.p_yy[1] * c * d
        out.jacobian_bend[0, n], out.jacobian_bend[1, n] = i * u_nn + j * v_nn, k * u_nn + m * v_nn
    det = u_x * v_y - u_y * v_x
    out.slope[0] = (v_y * point.p_x[2] - v_x * point.p_y[2]) / det
    out.slope[1] = (u_x * point.p_y[2] - u_y * point.p_x[2]) / det
    out.other_slope[0], out.other_slope[1] = g1, g2
    out.point[0], out.point[1], out.point[2] = u, v, point.p[2]
    out.other_z = z
    if search.load > 0.0:
        lower(textures, patch, other, (u_x, u_y, v_x, v_y), search, out)


@small_kernel
def _set_limit(limit, values, is_other, at):
    """Fill value and derivatives of a limit, given by its patch's own parameters.

    `values` are g, g_x, g_y, g_xx, g_xy, g_yy; those of the other patch are transformed.
    """
    g, g_a, g_b, g_aa, g_ab, g_bb = values
    limit.g = g
    if is_other:
        i, j, k, m = entries(at.jacobian)
        limit.g_x, limit.g_y = g_a * i + g_b * k, g_a * j + g_b * m
        limit.g_xx = i * (g_aa * i + g_ab * k) + k * (g_ab * i + g_bb * k)
        limit.g_xy = i * (g_aa * j + g_ab * m) + k * (g_ab * j + g_bb * m)
        limit.g_yy = j * (g_aa * j + g_ab * m) + m * (g_ab * j + g_bb * m)
        bend = at.jacobian_bend
        limit.g_xx += g_a * bend[0, 0] + g_b * bend[1, 0]
        limit.g_xy += g_a * bend[0, 1] + g_b * bend[1, 1]
        limit.g_yy += g_a * bend[0, 2] + g_b * bend[1, 2]
    else:
        limit.g_x, limit.g_y = g_a, g_b
        limit.g_xx, limit.g_xy, limit.g_yy = g_aa, g_ab, g_bb


@small_kernel
def _add_patch_limits(patch, x, y, is_other, at, limits_out, count):
    """Add the ellipse and the borders of one patch; return the new number of limits."""
    owner = 2 if is_other else 1
    if patch.bulge > 0.0:
        e11, e12, e22 = patch.ellipse[0], patch.ellipse[1], patch.ellipse[2]
        scale = 0.5 / math.sqrt(patch.ellipse_max)
        g = scale * (ellipse_form(patch, x, y) - 1.0 + patch.min_root**2)
        twice = 2.0 * scale
        values = (
            g, twice * (e11 * x + e12 * y), twice * (e12 * x + e22 * y), twice * e11, twice * e12,
            twice * e22,
        )  # fmt: skip
        limit = limits_out[count]
        _set_limit(limit, values, is_other, at)
        limit.owner, limit.is_concave = 0, False
        count += 1
    for i in range(patch.border_count):
        border, limit = patch.borders[i], limits_out[count]
        r, r_x, r_y, r_xx, r_xy, r_yy = root_at(patch, x, y)
        k1, k2, k3, k4 = border.from_x, border.from_y, border.from_root, border.from_square
        values = (
            border.constant + k1 * x + k2 * y + k3 * r + k4 * (x * x + y * y),
            k1 + k3 * r_x + 2.0 * k4 * x, k2 + k3 * r_y + 2.0 * k4 * y,
            k3 * r_xx + 2.0 * k4, k3 * r_xy, k3 * r_yy + 2.0 * k4,
        )  # fmt: skip
        _set_limit(limit, values, is_other, at)
        limit.owner, limit.is_concave = (owner if border.is_edge else 0), k3 > 0.0
        count += 1
    return count


@inner_kernel
def limits_at(patch, other, at, limits_out):
    """Fill the `LIMIT`s of two patches at a point of `overlap_at`; return their number."""
    count = _add_patch_limits(patch, at.x, at.y, False, at, limits_out, np.int64(0))
    x, y = at.other_x, at.other_y
    if other.bulge == 0.0:
        owner = 2 if other.rectangle_is_edge else 0
        for side in range(4):
            sign = 1.0 if side & 1 else -1.0
            is_x = side < 2
            g = sign * ((x if is_x else y) - other.rectangle[side])
            g_a, g_b = (sign, 0.0) if is_x else (0.0, sign)
            limit = limits_out[count]
            _set_limit(limit, (g, g_a, g_b, 0.0, 0.0, 0.0), True, at)
            limit.owner, limit.is_concave = owner, False
            count += 1
    return _add_patch_limits(other, x, y, True, at, limits_out, count)
