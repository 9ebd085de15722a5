"""Bounds of a patch's texture and of its normal over a box of its parameters."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.bounds.triplanar import (
    PLANE,
    mixing,
    shares_over,
    triplanar_slopes,
    triplanar_top,
)
from asperity.contact.narrow_phase.plane_boxes import on_texture, plane_normal
from asperity.contact.narrow_phase.smooth_base import (
    ellipse_form,
    root_at,
    unit_normal,
    within_ellipse,
)
from asperity.contact.narrow_phase.surface_patch import CYLINDRICAL, PLANAR, TRIPLANAR
from asperity.texture.highest import texture_top
from asperity.texture.packed import slope_bounds

_NO_SLOPES = (np.inf, np.inf, np.inf)
"""Bounds of slopes that were not looked up."""


class TextureBounds(NamedTuple):
    """Bounds of a texture t and a unit normal w over a box of a patch's parameters.

    Derivatives are along unit directions of the parameters.
    """

    top: float
    """Largest t [m]; -inf if the box is beyond the patch."""
    slope: float
    """Largest |t'|."""
    bend: float
    """Largest t'' [1/m]."""
    bend_size: float
    """Largest |t''| [1/m]."""
    normal_u: float
    """w at the centre of the box."""
    normal_v: float
    normal_z: float
    normal_change: float
    """Bound of the change of w over the box."""
    normal_slope: float
    """Largest |w'| [1/m]."""
    normal_bend: float
    """Largest |w''| [1/m^2]."""
    lateral: float
    """Largest lateral part of w, at most 1."""
    min_root: float
    """Smallest and largest root; -1 beyond the ellipse."""
    max_root: float


@small_kernel
def smooth_bounds(top, min_root, max_root):
    """Return the bounds of a patch without a texture."""
    return TextureBounds(
        top, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, min_root, max_root
    )  # fmt: skip


@small_kernel
def bounds_of(top, slopes, normal, min_root, max_root):
    """Return bounds from `slopes` (t', t'', |t''|) and `normal`, as `plane_normal` returns it."""
    slope, bend, bend_size = slopes
    u, v, z, change, normal_slope, normal_bend = normal
    lateral = min(math.sqrt(u * u + v * v) + change, 1.0)
    return TextureBounds(
        top, slope, bend, bend_size, u, v, z, change, normal_slope, normal_bend, lateral,
        min_root, max_root,
    )  # fmt: skip


@small_kernel
def roots_over(patch, x, y, radius):
    """Return the least and the largest root within `radius` of (x, y); -1 beyond the ellipse."""
    if patch.bulge == 0.0:
        return 1.0, 1.0
    square = ellipse_form(patch, x, y)
    out, reach = math.sqrt(max(square, 0.0)), math.sqrt(patch.ellipse_max) * radius
    near, far = max(out - reach, 0.0), out + reach
    most = math.sqrt(1.0 - near * near) if near < 1.0 else -1.0
    return (math.sqrt(1.0 - far * far) if far < 1.0 else -1.0), most


@small_kernel
def planar_slopes(textures, patch, x, y, half_x, half_y):
    """Return upper bounds of |t'|, t'' and |t''| over a box of a plane patch with a planar map."""
    k, speed = patch.texture, patch.map_max
    u0, u1, v0, v1 = on_texture(patch, x, y, half_x, half_y)
    slope, bend = slope_bounds(textures, k, u0, u1, v0, v1)
    least = patch.map_min if bend < 0.0 else speed
    return slope * speed, bend * least * least, textures.maps[k].max_curvature * speed * speed


@small_kernel
def plane_slopes(textures, patch, box, normal_slope, normal_bend):
    """Return upper bounds of |t'|, t'' and |t''| over a box (x, y, half_x, half_y) of a plane.

    `normal_slope` and `normal_bend` bound |w'| and |w''|, by which a triplanar map's weights vary.
    """
    x, y, half_x, half_y = box
    if patch.mapping == PLANAR:
        return planar_slopes(textures, patch, x, y, half_x, half_y)
    k, w1, w2 = patch.texture, normal_slope, normal_bend
    shares = shares_over(patch, box, PLANE)
    slope, bend = triplanar_slopes(textures, patch, box, PLANE, shares, (0.0, 0.0))
    bend_size = textures.maps[k].max_curvature
    if patch.is_unit:
        return slope, bend, bend_size
    mix_1, mix_2 = mixing(shares)
    size = textures.maps[k].max_abs_surface
    more = 2.0 * mix_1 * w1 * slope + (mix_2 * w1 * w1 + mix_1 * w2) * size
    return slope + mix_1 * w1 * size, bend + more, bend_size + more


@small_kernel
def normal_slope(patch, low):
    """Return a bound of |w'| where a curved patch's root is at least `low` [1/m]."""
    return patch.aspect * math.sqrt(patch.ellipse_max) / low


@small_kernel
def _curved_normal(patch, x, y, radius, min_root):
    """Return `plane_normal` of a curved patch with the least root `min_root` (-1: beyond it)."""
    low = max(min_root, 0.5 * patch.min_root)
    w1 = normal_slope(patch, low)
    w2 = patch.aspect * (patch.ellipse_max / (low * low * low))
    if not patch.is_unit:
        w2 += 3.0 * w1 * w1
    # The normal is taken at a point within the ellipse; its change over the box is bounded.
    wx, wy = x, y
    if min_root < 0.0:
        wx, wy = within_ellipse(patch, x, y, low)
    w_u, w_v, w_z = unit_normal(patch, wx, wy, root_at(patch, wx, wy)[0])
    change = w1 * (radius + math.sqrt((x - wx) * (x - wx) + (y - wy) * (y - wy)))
    return w_u, w_v, w_z, change, w1, w2


@small_kernel
def root_slope(patch, low):
    """Return a bound of the root's derivative where a curved patch's root is at least `low`."""
    return math.sqrt(patch.ellipse_max * max(1.0 - low * low, 0.0)) / low


@small_kernel
def map_speed(patch, low):
    """Return a bound of the way on a curved patch's map by its parameters, at roots from `low`."""
    way = patch.map_root * root_slope(patch, low)
    if patch.mapping == CYLINDRICAL:
        return math.sqrt((patch.map_stretch / low) ** 2 + (1.0 + way) ** 2)
    return patch.map_max + way


@inner_kernel
def _top_of(textures, patch, box, least, most):
    """Return the largest height over a box (x, y, half_x, half_y); `least`, `most`: of the root."""
    k, mapping = patch.texture, patch.mapping
    if mapping == TRIPLANAR:
        root = _middle_and_half(least, most)
        return triplanar_top(textures, patch, box, root, shares_over(patch, box, root))
    if mapping == CYLINDRICAL:
        x, y, half_x, half_y = box
        sides = (x - half_x, x + half_x, y - half_y, y + half_y)
        u0, u1, v0, v1 = _box_on_cylinder(patch, sides, least, most)
    else:
        u0, u1, v0, v1 = _box_on_planar_map(patch, box, least, most)
    return texture_top(textures, k, u0, u1, v0, v1)


@inner_kernel
def curved_top(textures, patch, box):
    """Return the largest height over a box (x, y, half_x, half_y) of a curved patch [m].

    It is -inf beyond the patch's ellipse.
    """
    x, y, half_x, half_y = box
    least, most = roots_over(patch, x, y, math.sqrt(half_x * half_x + half_y * half_y))
    return _top_of(textures, patch, box, least, most) if most >= patch.min_root else -np.inf


@inner_kernel
def top_over(textures, patch, x0, x1, y0, y1):
    """Return the `TextureBounds` of a patch over a box of its parameters, without slopes."""
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    radius = math.sqrt(half_x * half_x + half_y * half_y)
    least, most = roots_over(patch, x, y, radius)
    if most <= 0.0:
        return smooth_bounds(-np.inf, -1.0, -1.0)
    if patch.texture < 0:
        return smooth_bounds(0.0, least, most)
    k, mapping, box = patch.texture, patch.mapping, (x, y, half_x, half_y)
    if patch.is_level and mapping == PLANAR:
        u0, u1, v0, v1 = on_texture(patch, x, y, half_x, half_y)
        top = texture_top(textures, k, u0, u1, v0, v1)
        return bounds_of(top, _NO_SLOPES, (0.0, 0.0, 1.0, 0.0, 0.0, 0.0), 1.0, 1.0)
    if patch.bulge > 0.0:
        normal = _curved_normal(patch, x, y, radius, least)
    else:
        normal = plane_normal(patch, x, y, radius)
    top = _top_of(textures, patch, box, least, most)
    return bounds_of(top, _NO_SLOPES, normal, least, most)


@inner_kernel
def with_slopes(textures, patch, x0, x1, y0, y1, over):
    """Return what `top_over` returned for a box, `over`, with the slopes."""
    if patch.texture < 0 or over.max_root <= 0.0:
        return over
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    box = (x, y, 0.5 * (x1 - x0), 0.5 * (y1 - y0))
    k, mapping, least, most = patch.texture, patch.mapping, over.min_root, over.max_root
    if patch.bulge == 0.0 and (mapping == TRIPLANAR or (mapping == PLANAR and patch.is_level)):
        slopes = plane_slopes(textures, patch, box, over.normal_slope, over.normal_bend)
        return _with(over, slopes)
    low, r1, r2 = max(least, 0.5 * patch.min_root), 0.0, 0.0
    if patch.bulge > 0.0:
        # Bounds of the root's first and second derivatives.
        r1 = root_slope(patch, low)
        r2 = patch.ellipse_max / (low * low * low)
    if mapping == TRIPLANAR:
        return _with(over, _curved_triplanar_slopes(textures, patch, box, (r1, r2), over))
    if mapping == CYLINDRICAL:
        u0, u1, v0, v1 = _box_on_cylinder(patch, (x0, x1, y0, y1), least, most)
        stretch = patch.map_stretch
        speed = map_speed(patch, low)
        turn = math.sqrt(max(1.0 - low * low, 0.0)) * stretch / (patch.radius * low * low * low)
        turn += patch.map_root * r2
        slowest = max(min(stretch, 1.0) - patch.map_root * r1, 0.0)
    else:
        u0, u1, v0, v1 = _box_on_planar_map(patch, box, least, most)
        speed = patch.map_max + patch.map_root * r1
        turn = patch.map_root * r2
        slowest = max(patch.map_min - patch.map_root * r1, 0.0)
    slope, bend = slope_bounds(textures, k, u0, u1, v0, v1)
    bend = bend * (speed * speed if bend > 0.0 else slowest * slowest) + slope * turn
    bend_size = textures.maps[k].max_curvature * speed * speed + slope * turn
    return _with(over, (slope * speed, bend, bend_size))


@small_kernel
def _with(over, slopes):
    """Return `TextureBounds` with other slopes (t', t'', |t''|)."""
    normal = (
        over.normal_u, over.normal_v, over.normal_z, over.normal_change, over.normal_slope,
        over.normal_bend,
    )  # fmt: skip
    return bounds_of(over.top, slopes, normal, over.min_root, over.max_root)


@inner_kernel
def texture_over(textures, patch, x0, x1, y0, y1):
    """Return the `TextureBounds` of a patch over a box of its parameters."""
    over = top_over(textures, patch, x0, x1, y0, y1)
    return with_slopes(textures, patch, x0, x1, y0, y1, over)


@small_kernel
def _middle_and_half(least, most):
    """Return the middle and half the range of the root, from its bounds."""
    return 0.5 * (most + max(least, 0.0)), 0.5 * (most - max(least, 0.0))


@small_kernel
def _box_on_cylinder(patch, box, least, most):
    """Return the rectangle u0, u1, v0, v1 that a box covers on a cylindrical map.

    `least` and `most` bound the root.
    """
    x0, x1, y0, y1 = box
    radius, stretch = patch.radius, patch.map_stretch
    a0 = stretch * radius * math.asin(min(max(y0 / radius, -1.0), 1.0))
    a1 = stretch * radius * math.asin(min(max(y1 / radius, -1.0), 1.0))
    if patch.map_sense < 0.0:
        a0, a1 = -a1, -a0
    low_root = max(least, 0.0)
    lean0, lean1 = patch.lean * low_root, patch.lean * most
    u, v = patch.map_start[0], patch.map_start[1]
    return u + a0, u + a1, v + x0 + min(lean0, lean1), v + x1 + max(lean0, lean1)


@small_kernel
def _box_on_planar_map(patch, box, least, most):
    """Return the rectangle u0, u1, v0, v1 that a box (x, y, half_x, half_y) covers on a planar map.

    `least` and `most` bound the root.
    """
    x, y, half_x, half_y = box
    at, by_x, by_y, by_root = (
        patch.texture_origin, patch.texture_from_x, patch.texture_from_y, patch.texture_from_root
    )  # fmt: skip
    middle, half_root = _middle_and_half(least, most)
    u = at[0] + by_x[0] * x + by_y[0] * y + by_root[0] * middle
    v = at[1] + by_x[1] * x + by_y[1] * y + by_root[1] * middle
    ru = abs(by_x[0]) * half_x + abs(by_y[0]) * half_y + abs(by_root[0]) * half_root
    rv = abs(by_x[1]) * half_x + abs(by_y[1]) * half_y + abs(by_root[1]) * half_root
    return u - ru, u + ru, v - rv, v + rv


@small_kernel
def _curved_triplanar_slopes(textures, patch, box, root_slopes, over):
    """Return upper bounds of |t'|, t'' and |t''| of a triplanar map over a box of a curved patch.

    `root_slopes` bounds the root's derivatives.
    """
    k, w1, w2 = patch.texture, over.normal_slope, over.normal_bend
    root = _middle_and_half(over.min_root, over.max_root)
    shares = shares_over(patch, box, root)
    slope, bend = triplanar_slopes(textures, patch, box, root, shares, root_slopes)
    speed = patch.map_max + patch.map_root * root_slopes[0]
    bend_size = textures.maps[k].max_curvature * speed * speed
    bend_size += slope * patch.map_root * root_slopes[1]
    mix_1, mix_2 = mixing(shares)
    size = textures.maps[k].max_abs_surface
    more = 2.0 * mix_1 * w1 * slope + (mix_2 * w1 * w1 + mix_1 * w2) * size
    return slope + mix_1 * w1 * size, bend + more, bend_size + more
