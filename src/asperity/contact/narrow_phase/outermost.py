"""The outermost sheet of an inclined textured plane.

A texture moves the points of a plane along its normal w. If w is inclined to n, points move
laterally too, and a steep texture folds: several sheets have points at the same (u, v), and the
highest counts. The base point of a point at height t is offset by -t d, d the lateral part of w in
the plane's parameters. So intervals of heights are tested from the highest downwards: an interval
is empty if the texture is below it at all base points of its heights, or these are beyond the
borders.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.bounds.triplanar import MIX_1, is_triplanar, plane_triplanar_top
from asperity.contact.narrow_phase.plane_boxes import (
    beyond_straight_borders,
    on_texture,
    plane_normal,
)
from asperity.contact.narrow_phase.surface_patch import entries
from asperity.texture.highest import texture_top

_COARSE, _FINE = 1.0 / 8.0, 1.0 / 256.0
"""Largest and smallest interval, over the range of heights."""


@small_kernel
def may_fold(textures, patch):
    """Return whether the texture may fold a plane patch, by the largest slope of the whole map."""
    if patch.texture < 0 or patch.is_level or patch.bulge > 0.0:
        return False
    found, w1 = textures.maps[patch.texture], patch.normal_slope
    slope = found.max_slope * patch.map_max
    if is_triplanar(patch):
        slope += MIX_1 * w1 * found.max_abs_surface
    return slope * patch.normal_lateral + found.max_abs_surface * w1 >= patch.lateral_min


@small_kernel
def lean_at(patch, x, y, radius):
    """Return d at (x, y) and a bound of its change within `radius`, in a plane's parameters."""
    w_u, w_v, _, change, _, _ = plane_normal(patch, x, y, radius)
    i, j, k, m = entries(patch.lateral_inverse)
    return i * w_u + j * w_v, k * w_u + m * w_v, change / patch.lateral_min


@inner_kernel
def highest_over(textures, patch, box):
    """Return a bound of the texture's height at points over a box [m], -inf if there are none.

    Parameters
    ----------
    patch : PATCH record
        A plane with a texture.
    box : tuple
        Centre and half sides of the smooth plane's part under the box, in its parameters [m].
    """
    x, y, half_x, half_y = box
    found, sides = textures.maps[patch.texture], patch.rectangle
    most, low = min(found.highest, patch.texture_top), -found.max_abs_surface
    across = math.sqrt(half_x * half_x + half_y * half_y)
    farthest = found.max_abs_surface * patch.normal_lateral / patch.lateral_min
    d_x, d_y, spread = lean_at(patch, x, y, across + farthest)
    coarse, far = _COARSE * (most - low), abs(d_x) + abs(d_y)
    # Smaller intervals hardly narrow the part that the box covers.
    fine = max(_FINE * (most - low), min(across / far, coarse) if far > 0.0 else coarse)
    step, high = coarse, most
    while high > low:
        low_end = max(high - step, low)
        middle, half = 0.5 * (high + low_end), 0.5 * (high - low_end)
        astray = spread * max(abs(high), abs(low_end))
        at_x, at_y = x - middle * d_x, y - middle * d_y
        reach_x = half_x + half * abs(d_x) + astray
        reach_y = half_y + half * abs(d_y) + astray
        top = -np.inf
        is_beyond = (
            (at_x - reach_x > sides[1]) | (at_x + reach_x < sides[0])
            | (at_y - reach_y > sides[3]) | (at_y + reach_y < sides[2])
        )  # fmt: skip
        if not is_beyond and not beyond_straight_borders(patch, 0, at_x, at_y, reach_x, reach_y):
            if is_triplanar(patch):
                top = plane_triplanar_top(textures, patch, at_x, at_y, reach_x, reach_y)
            else:
                u0, u1, v0, v1 = on_texture(patch, at_x, at_y, reach_x, reach_y)
                top = texture_top(textures, patch.texture, u0, u1, v0, v1)
        if top < low_end:
            high, step = low_end, min(2.0 * step, coarse)
        elif step <= fine:
            return min(high, top)
        else:
            step *= 0.5
    return -np.inf
