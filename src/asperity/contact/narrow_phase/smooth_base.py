"""The smooth base of a patch: places, roots, normals and heights, without its texture."""

from __future__ import annotations

import math

from asperity._core.kernels import small_kernel
from asperity.contact.narrow_phase.surface_patch import entries


@small_kernel
def ellipse_form(patch, x, y):
    """Return a^T E a, which is 1 on the ellipse that bounds a curved patch."""
    e11, e12, e22 = patch.ellipse[0], patch.ellipse[1], patch.ellipse[2]
    return x * (e11 * x + e12 * y) + y * (e12 * x + e22 * y)


@small_kernel
def root_at(patch, x, y):
    """Return the root r and r_x, r_y, r_xx, r_xy, r_yy; r is nan beyond the patch's ellipse."""
    if patch.bulge == 0.0:
        return 1.0, 0.0, 0.0, 0.0, 0.0, 0.0
    e11, e12, e22 = patch.ellipse[0], patch.ellipse[1], patch.ellipse[2]
    qx, qy = e11 * x + e12 * y, e12 * x + e22 * y
    r = math.sqrt(1.0 - x * qx - y * qy)
    over = 1.0 / r
    r_x, r_y = -qx * over, -qy * over
    return (
        r, r_x, r_y,
        -(e11 + r_x * r_x) * over, -(e12 + r_x * r_y) * over, -(e22 + r_y * r_y) * over,
    )  # fmt: skip


@small_kernel
def within_ellipse(patch, x, y, least):
    """Return (x, y), moved towards the middle of a curved patch to where the root is `least`."""
    out, most = ellipse_form(patch, x, y), 1.0 - least * least
    scale = math.sqrt(most / out) if out > most else 1.0
    return x * scale, y * scale


@small_kernel
def unit_normal(patch, x, y, root):
    """Return the unit outward normal w at (x, y) of a patch, at which its root is `root`."""
    n, by_x, by_y = patch.normal, patch.normal_from_x, patch.normal_from_y
    by_root = patch.normal_from_root
    w_u = n[0] + by_x[0] * x + by_y[0] * y + by_root[0] * root
    w_v = n[1] + by_x[1] * x + by_y[1] * y + by_root[1] * root
    w_z = n[2] + by_x[2] * x + by_y[2] * y + by_root[2] * root
    size = math.sqrt(w_u * w_u + w_v * w_v + w_z * w_z)
    return w_u / size, w_v / size, w_z / size


@small_kernel
def place_at(patch, x, y):
    """Return (u, v) of the base point at the parameters (x, y)."""
    return (
        patch.origin[0] + patch.lateral[0, 0] * x + patch.lateral[0, 1] * y,
        patch.origin[1] + patch.lateral[1, 0] * x + patch.lateral[1, 1] * y,
    )


@small_kernel
def parameters_at(patch, u, v):
    """Return the parameters (x, y) of the base point at (u, v)."""
    du, dv = u - patch.origin[0], v - patch.origin[1]
    i, j, k, m = entries(patch.lateral_inverse)
    return i * du + j * dv, k * du + m * dv


@small_kernel
def base_height_at(patch, u, v):
    """Return z, z_u, z_v, z_uu, z_uv, z_vv of the smooth base at (u, v); nan beyond its ellipse."""
    x, y = parameters_at(patch, u, v)
    r, r_x, r_y, r_xx, r_xy, r_yy = root_at(patch, x, y)
    c = patch.bulge
    i, j, k, m = entries(patch.lateral_inverse)
    z_x, z_y = patch.slope[0] + c * r_x, patch.slope[1] + c * r_y
    z = patch.origin[2] + patch.slope[0] * x + patch.slope[1] * y + c * r
    k11 = c * (i * (r_xx * i + r_xy * k) + k * (r_xy * i + r_yy * k))
    k12 = c * (i * (r_xx * j + r_xy * m) + k * (r_xy * j + r_yy * m))
    k22 = c * (j * (r_xx * j + r_xy * m) + m * (r_xy * j + r_yy * m))
    return z, i * z_x + k * z_y, j * z_x + m * z_y, k11, k12, k22


@small_kernel
def parameters_over(patch, other):
    """Return b0, b1, b2, c0, c1, c2: the parameters of `other` over (x, y) of `patch`.

    They are `b0 + b1 x + b2 y` and `c0 + c1 x + c2 y`, those of base points at the same (u, v).
    """
    i, j, k, m = entries(other.lateral_inverse)
    q11, q12, q21, q22 = entries(patch.lateral)
    du, dv = patch.origin[0] - other.origin[0], patch.origin[1] - other.origin[1]
    return (
        i * du + j * dv, i * q11 + j * q21, i * q12 + j * q22,
        k * du + m * dv, k * q11 + m * q21, k * q12 + m * q22,
    )  # fmt: skip
