"""Bounds over a box of a plane patch's parameters: normal, texture, borders."""

from __future__ import annotations

import math

from asperity._core.kernels import small_kernel


@small_kernel
def texture_size(textures, patch):
    """Return the largest |t| of a patch's texture [m]."""
    return textures.maps[patch.texture].max_abs_surface if patch.texture >= 0 else 0.0


@small_kernel
def lateral_shift(textures, patch):
    """Return an upper bound of the lateral displacement of points by a patch's texture [m]."""
    if patch.texture < 0 or patch.is_level:
        return 0.0
    return textures.maps[patch.texture].max_abs_surface * patch.normal_lateral


@small_kernel
def on_texture(patch, x, y, half_x, half_y):
    """Return the rectangle u0, u1, v0, v1 of a planar map that a box of a plane patch covers."""
    at, by_x, by_y = patch.texture_origin, patch.texture_from_x, patch.texture_from_y
    ru = abs(by_x[0]) * half_x + abs(by_y[0]) * half_y
    rv = abs(by_x[1]) * half_x + abs(by_y[1]) * half_y
    u = at[0] + by_x[0] * x + by_y[0] * y
    v = at[1] + by_x[1] * x + by_y[1] * y
    return u - ru, u + ru, v - rv, v + rv


@small_kernel
def plane_normal(patch, x, y, radius):
    """Return a plane patch's unit normal w at (x, y), and bounds within `radius`.

    After the three components of w are upper bounds of its change, |w'| and |w''|.
    """
    v_u, v_v, v_z = patch.normal[0], patch.normal[1], patch.normal[2]
    if patch.is_unit:
        return v_u, v_v, v_z, 0.0, 0.0, 0.0
    by_x, by_y = patch.normal_from_x, patch.normal_from_y
    slopes = 0.0
    for i in range(3):
        slopes += by_x[i] * by_x[i] + by_y[i] * by_y[i]
    slopes = math.sqrt(slopes)
    v_u += by_x[0] * x + by_y[0] * y
    v_v += by_x[1] * x + by_y[1] * y
    v_z += by_x[2] * x + by_y[2] * y
    size = math.sqrt(v_u * v_u + v_v * v_v + v_z * v_z)
    w1, w2 = patch.normal_slope, patch.normal_bend
    # Before normalisation w is linear, which bounds its least length in the box.
    shortest = size - slopes * radius
    if slopes < w1 * shortest:
        w1 = slopes / shortest
        w2 = 3.0 * w1 * w1
    over = 1.0 / size
    return v_u * over, v_v * over, v_z * over, w1 * radius, w1, w2


@small_kernel
def beyond_straight_borders(patch, first, x, y, half_x, half_y):
    """Return whether a box is beyond a border of a plane patch, of those from `first` on."""
    for n in range(first, patch.border_count):
        border = patch.borders[n]
        k1, k2, k4 = border.from_x, border.from_y, border.from_square
        g = border.constant + k1 * x + k2 * y
        if k4 != 0.0:
            g += k4 * (x * x + y * y)
            k1, k2 = k1 + 2.0 * k4 * x, k2 + 2.0 * k4 * y
        if g > abs(k1) * half_x + abs(k2) * half_y:
            return True
    return False
