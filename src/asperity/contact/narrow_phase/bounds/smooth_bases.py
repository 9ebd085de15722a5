"""Upper bounds of the overlap of two smooth bases, and of the bases raised by their textures.

The bases are concave functions over each other, so tangent planes bound them.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.bounds.borders import beyond_borders
from asperity.contact.narrow_phase.bounds.planes import box_under
from asperity.contact.narrow_phase.bounds.texture import roots_over
from asperity.contact.narrow_phase.outermost import base_of
from asperity.contact.narrow_phase.patch_pair import pair_roughness, pair_shift, window_of
from asperity.contact.narrow_phase.smooth_base import (
    parameters_at,
    parameters_over,
    place_at,
    root_at,
    within_ellipse,
)
from asperity.contact.narrow_phase.surface_patch import entries


@small_kernel
def _base_tangent(patch, x, y):
    """Return height and slopes by (x, y) of the smooth base, and (x, y) moved into its ellipse."""
    if patch.bulge > 0.0:
        x, y = within_ellipse(patch, x, y, 0.5 * patch.min_root)
    r, r_x, r_y, _, _, _ = root_at(patch, x, y)
    c, slope = patch.bulge, patch.slope
    z = patch.origin[2] + slope[0] * x + slope[1] * y + c * r
    return z, slope[0] + c * r_x, slope[1] + c * r_y, x, y


@small_kernel
def base_bound(patch, other, base_x, base_y, box, shift):
    """Return two upper bounds of the overlap of smooth bases over a box, and the other's slope.

    The first, -inf if there is no overlap, is that of two tangent planes; the slope is that of the
    other's plane over (u, v). The second, by the other's highest point, holds wherever textures
    move points laterally. `(base_x, base_y)` estimates where the bases overlap most: the bound is
    tight if the box contains it. `shift` bounds the textures' lateral displacement [m].
    """
    x0, x1, y0, y1 = box
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    radius = math.sqrt(half_x * half_x + half_y * half_y)
    _, most = roots_over(patch, x, y, radius)
    if patch.bulge > 0.0 and most < patch.min_root:
        return -np.inf, -np.inf, 0.0, 0.0
    # The part of the other patch under the box.
    moved = shift / other.lateral_min
    if other.bulge == 0.0:
        own = (x, y, half_x, half_y)
        bx, by, reach_x, reach_y = box_under(parameters_over(patch, other), own, moved)
        sides = other.rectangle
        if bx - reach_x > sides[1] or bx + reach_x < sides[0]:
            return -np.inf, -np.inf, 0.0, 0.0
        if by - reach_y > sides[3] or by + reach_y < sides[2]:
            return -np.inf, -np.inf, 0.0, 0.0
    else:
        u, v = place_at(patch, x, y)
        bx, by = parameters_at(other, u, v)
        reach_x = reach_y = radius * patch.lateral_max / other.lateral_min + moved
        _, most = roots_over(other, bx, by, reach_x)
        if most < other.min_root:
            return -np.inf, -np.inf, 0.0, 0.0
    if beyond_borders(other, bx, by, reach_x, reach_y):
        return -np.inf, -np.inf, 0.0, 0.0
    return tangent_bound(patch, other, base_x, base_y, box, 0.0)


@small_kernel
def tangent_bound(patch, other, base_x, base_y, box, height):
    """Return the `base_bound` without a look at borders; see there.

    The tangent plane of a curved other patch, moved along its normal by `height` (>= 0), bounds
    all that its texture raises up to `height`; it is tight where that is as high.
    """
    x0, x1, y0, y1 = box
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    tx, ty = min(max(base_x, x0), x1), min(max(base_y, y0), y1)
    z, z_x, z_y, px, py = _base_tangent(patch, tx, ty)
    total = z + z_x * (x - px) + z_y * (y - py)
    # Neither base is above its highest point, however steep the tangent planes are.
    top = min(total + abs(z_x) * half_x + abs(z_y) * half_y, patch.base_top) + other.base_top
    u, v = place_at(patch, tx, ty)
    qx, qy = parameters_at(other, u, v)
    if height > 0.0 and other.bulge > 0.0:
        qx, qy = base_of(other, qx, qy, height)
    z, s_x, s_y, qx, qy = _base_tangent(other, qx, qy)
    u, v = place_at(patch, x, y)
    bx, by = parameters_at(other, u, v)
    total += z + s_x * (bx - qx) + s_y * (by - qy)
    i, j, k, m = entries(other.lateral_inverse)
    g1, g2 = i * s_x + k * s_y, j * s_x + m * s_y
    a, b, c, d = entries(patch.lateral)
    z_x += g1 * a + g2 * c
    z_y += g1 * b + g2 * d
    return total + abs(z_x) * half_x + abs(z_y) * half_y, top, g1, g2


@inner_kernel
def order_zero_bound(textures, patch, other):
    """Return an upper bound of the overlap of two patches, -inf without a common part [m]."""
    shift = pair_shift(textures, patch, other)
    x0, x1, y0, y1 = window_of(patch, other, shift)
    if not (x0 <= x1 and y0 <= y1):
        return -np.inf
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    if beyond_borders(patch, x, y, x1 - x, y1 - y):
        return -np.inf
    return raised_base_bound(textures, patch, other, x, y, (x0, x1, y0, y1), shift)


@small_kernel
def raised_base_bound(textures, patch, other, base_x, base_y, box, shift):
    """Return `base_bound` raised by the largest heights of both textures [m]."""
    tangent, top, g1, g2 = base_bound(patch, other, base_x, base_y, box, shift)
    smooth = min(tangent, top)
    return smooth + pair_roughness(textures, patch, other) * math.sqrt(1.0 + g1 * g1 + g2 * g2)
