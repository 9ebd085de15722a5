"""The outermost sheet of an inclined textured surface.

A texture moves the points of a surface along its normal w. If w is inclined to n, points move
laterally too, and a steep texture folds: several sheets have points at the same (u, v), and the
highest counts. The base point of a point at height t is offset by -t d, d the lateral part of w in
the patch's parameters. So intervals of heights are tested from the highest downwards: an interval
is empty if the texture is below it at all base points of its heights, or these are beyond the
borders.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.bounds.borders import beyond_borders
from asperity.contact.narrow_phase.bounds.texture import (
    curved_top,
    map_speed,
    normal_slope,
    root_slope,
    roots_over,
)
from asperity.contact.narrow_phase.bounds.triplanar import MIX_1, is_triplanar, plane_triplanar_top
from asperity.contact.narrow_phase.plane_boxes import (
    beyond_straight_borders,
    on_texture,
    plane_normal,
)
from asperity.contact.narrow_phase.smooth_base import root_at, unit_normal, within_ellipse
from asperity.contact.narrow_phase.surface_patch import TRIPLANAR, entries, singular_values
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
def may_fold_near(textures, patch, x, y, radius):
    """Return whether the texture may fold a curved patch within `radius` of (x, y)."""
    if patch.texture < 0:
        return False
    found, (turn, low) = textures.maps[patch.texture], _turn_near(textures, patch, x, y, radius)
    size = found.max_abs_surface
    x, y = within_ellipse(patch, x, y, low)
    w_u, w_v, _ = unit_normal(patch, x, y, root_at(patch, x, y)[0])
    lateral = min(math.sqrt(w_u * w_u + w_v * w_v) + turn * (size + radius), 1.0)
    slope = found.max_slope * map_speed(patch, low)
    if patch.mapping == TRIPLANAR:
        slope += MIX_1 * normal_slope(patch, low) * size
    return slope * lateral + turn * patch.lateral_min * size >= patch.lateral_min


@inner_kernel
def _turn_near(textures, patch, x, y, radius):
    """Return a bound of |d'| where base points within `radius` of (x, y) may be [1/m].

    The second value is the least root there, or half of that at which the curved patch ends.
    """
    reach = radius + textures.maps[patch.texture].max_abs_surface / patch.lateral_min
    low = max(roots_over(patch, x, y, reach)[0], 0.5 * patch.min_root)
    if not patch.is_unit:
        turn = normal_slope(patch, low) / patch.lateral_min
        # Beyond the ellipse d is taken at a point that moves faster, at most by the aspect.
        return turn if low > 0.5 * patch.min_root else patch.aspect * turn, low
    by_x, by_y, by_root = patch.normal_from_x, patch.normal_from_y, patch.normal_from_root
    _, turn = singular_values(by_x[0], by_y[0], by_x[1], by_y[1])
    turn += math.sqrt(by_root[0] ** 2 + by_root[1] ** 2) * root_slope(patch, low)
    return turn / patch.lateral_min, low


@inner_kernel
def curved_lean(patch, x, y):
    """Return d at (x, y) of a curved patch; continued beyond its ellipse, where it turns no faster.

    Where the normal is not of unit length, it is that of the next point well within the ellipse.
    """
    in_x, in_y = within_ellipse(patch, x, y, 0.5 * patch.min_root)
    root = root_at(patch, in_x, in_y)[0]
    i, j, k, m = entries(patch.lateral_inverse)
    if not patch.is_unit:
        w_u, w_v, _ = unit_normal(patch, in_x, in_y, root)
        return i * w_u + j * w_v, k * w_u + m * w_v
    n, by_x, by_y = patch.normal, patch.normal_from_x, patch.normal_from_y
    w_u = n[0] + by_x[0] * x + by_y[0] * y + patch.normal_from_root[0] * root
    w_v = n[1] + by_x[1] * x + by_y[1] * y + patch.normal_from_root[1] * root
    return i * w_u + j * w_v, k * w_u + m * w_v


@inner_kernel
def base_of(patch, x, y, height):
    """Return, nearly, the base of a curved patch's point at `height` over the base point (x, y)."""
    d_x, d_y = curved_lean(patch, x, y)
    d_x, d_y = curved_lean(patch, x - height * d_x, y - height * d_y)
    return x - height * d_x, y - height * d_y


@small_kernel
def _curved_base_over(patch, box, middle, half, turn):
    """Return the box of base points of heights `middle` +- `half` over a box of a curved patch.

    `turn` bounds |d'|. With the base point b, at which d is known, any other base point b' has
    |b' - b| <= |box| + half |d| + |residual of b| + |height| |d'| |b' - b|.
    """
    x, y, half_x, half_y = box
    at_x, at_y = base_of(patch, x, y, middle)
    d_x, d_y = curved_lean(patch, at_x, at_y)
    reach_x = half_x + half * abs(d_x) + abs(at_x - x + middle * d_x)
    reach_y = half_y + half * abs(d_y) + abs(at_y - y + middle * d_y)
    astray = (abs(middle) + half) * turn
    if astray >= 0.5:
        return x, y, np.inf, np.inf
    more = astray / (1.0 - astray) * math.sqrt(reach_x * reach_x + reach_y * reach_y)
    return at_x, at_y, reach_x + more, reach_y + more


@inner_kernel
def _curved_top_between(textures, patch, box, middle, half, turn):
    """Return the largest height of base points of heights `middle` +- `half` over a box [m].

    It is inf where the normal turns too fast to find them.
    """
    base = _curved_base_over(patch, box, middle, half, turn)
    if base[2] == np.inf:
        return np.inf
    return -np.inf if beyond_borders(patch, *base) else curved_top(textures, patch, base)


@small_kernel
def _top_between(textures, patch, box, middle, half, lean):
    """Return the `_curved_top_between` of a plane patch; `lean` is what `lean_at` returns."""
    (x, y, half_x, half_y), (d_x, d_y, spread), sides = box, lean, patch.rectangle
    astray = spread * max(abs(middle + half), abs(middle - half))
    at_x, at_y = x - middle * d_x, y - middle * d_y
    reach_x = half_x + half * abs(d_x) + astray
    reach_y = half_y + half * abs(d_y) + astray
    is_beyond = (
        (at_x - reach_x > sides[1]) | (at_x + reach_x < sides[0])
        | (at_y - reach_y > sides[3]) | (at_y + reach_y < sides[2])
    )  # fmt: skip
    if is_beyond or beyond_straight_borders(patch, 0, at_x, at_y, reach_x, reach_y):
        return -np.inf
    if is_triplanar(patch):
        return plane_triplanar_top(textures, patch, at_x, at_y, reach_x, reach_y)
    u0, u1, v0, v1 = on_texture(patch, at_x, at_y, reach_x, reach_y)
    return texture_top(textures, patch.texture, u0, u1, v0, v1)


@inner_kernel
def highest_over(textures, patch, box):
    """Return a bound of the texture's height at points over a box [m], -inf if there are none.

    Parameters
    ----------
    patch : PATCH record
        With a texture.
    box : tuple
        Centre and half sides of the smooth base's part under the box, in its parameters [m].
    """
    x, y, half_x, half_y = box
    found, is_curved = textures.maps[patch.texture], patch.bulge > 0.0
    most, low = min(found.highest, patch.texture_top), -found.max_abs_surface
    across = math.sqrt(half_x * half_x + half_y * half_y)
    if is_curved:
        turn, _ = _turn_near(textures, patch, x, y, across)
        d_x, d_y = curved_lean(patch, x, y)
        lean = (d_x, d_y, turn)
    else:
        farthest = found.max_abs_surface * patch.normal_lateral / patch.lateral_min
        lean = lean_at(patch, x, y, across + farthest)
    coarse, far = _COARSE * (most - low), abs(lean[0]) + abs(lean[1])
    # Smaller intervals hardly narrow the part that the box covers.
    fine = max(_FINE * (most - low), min(across / far, coarse) if far > 0.0 else coarse)
    step, high = coarse, most
    while high > low:
        low_end = max(high - step, low)
        middle, half = 0.5 * (high + low_end), 0.5 * (high - low_end)
        if is_curved:
            top = _curved_top_between(textures, patch, box, middle, half, lean[2])
        else:
            top = _top_between(textures, patch, box, middle, half, lean)
        if top == np.inf:
            return high
        if top < low_end:
            high, step = low_end, min(2.0 * step, coarse)
        elif step <= fine:
            return min(high, top)
        else:
            step *= 0.5
    return -np.inf
