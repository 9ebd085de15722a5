"""Bounds of a textured patch around one of its points, where a steep texture may fold it."""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.bounds.curvature import displacement_bend
from asperity.contact.narrow_phase.bounds.texture import (
    bounds_of,
    plane_slopes,
    smooth_bounds,
    texture_over,
)
from asperity.contact.narrow_phase.plane_boxes import plane_normal
from asperity.contact.narrow_phase.smooth_base import place_at, root_at, unit_normal
from asperity.contact.narrow_phase.surface_patch import PLANAR


@small_kernel
def over_box(textures, patch, x, y, half_x, half_y):
    """Return the `TextureBounds` of a textured plane over a box, without its highest point."""
    radius = math.sqrt(half_x * half_x + half_y * half_y)
    normal = plane_normal(patch, x, y, radius)
    slopes = plane_slopes(textures, patch, (x, y, half_x, half_y), normal[4], normal[5])
    return bounds_of(np.inf, slopes, normal, 1.0, 1.0)


@small_kernel
def largest_slope(textures, patch, box, normal_slope, normal_bend):
    """Return a bound of the slope over a box: that of the whole texture where it is planar."""
    if patch.mapping == PLANAR:
        return textures.maps[patch.texture].max_slope * patch.map_max
    return plane_slopes(textures, patch, box, normal_slope, normal_bend)[0]


@small_kernel
def _least_stretch(point):
    """Return the least derivative of a surface's (u, v) along unit directions of its parameters."""
    a, b, c, d = point.p_x[0], point.p_y[0], point.p_x[1], point.p_y[1]
    # The smaller singular value of the Jacobian.
    return abs(a * d - b * c) / math.sqrt(a * a + b * b + c * c + d * d)


@small_kernel
def _height_of(patch, x, y, point):
    """Return the height of a displaced point over its base at (x, y), along w [m]."""
    root = root_at(patch, x, y)[0]
    u, v = place_at(patch, x, y)
    z = patch.origin[2] + patch.slope[0] * x + patch.slope[1] * y + patch.bulge * root
    w = unit_normal(patch, x, y, root)
    return w[0] * (point.p[0] - u) + w[1] * (point.p[1] - v) + w[2] * (point.p[2] - z)


@inner_kernel
def _around(textures, patch, x, y, reach):
    """Return the `TextureBounds` of a textured patch within `reach` of (x, y) along both axes."""
    if patch.bulge > 0.0:
        return texture_over(textures, patch, x - reach, x + reach, y - reach, y + reach)
    return over_box(textures, patch, x, y, reach, reach)


@inner_kernel
def nearby(textures, other, travel, highest, search):
    """Return bounds of the other's texture around the point under the centre, and its stretch.

    They hold for all points under the box if no other sheet is above: the points are within
    `travel` of the centre's in (u, v), and none is higher than `highest` over its base. If the
    Jacobian changes little on the way, no two points coincide (as in Kantorovich's theorem), where
    the slope alone does not rule out a fold. The stretch is the least singular value of the
    Jacobian, 0 if it changes too much. The third result bounds the points' distance in the other's
    parameters.
    """
    at, point = search.at, search.other_surface
    stretch, found = _least_stretch(point), textures.maps[other.texture]
    over = smooth_bounds(0.0, 1.0, 1.0)
    if not stretch > 0.0:
        return over, 0.0, np.inf
    own, x, y = 2.0 * travel / stretch, at.other_x, at.other_y
    size = found.max_abs_surface
    # Base points of points between the centre's sheet and the highest one.
    higher = max(highest - _height_of(other, x, y, point), 0.0)
    if other.bulge > 0.0:
        wide = _around(textures, other, x, y, own + size / other.lateral_min)
        astray = size * wide.normal_slope / other.lateral_min
        if astray >= 0.5:
            return over, 0.0, np.inf
        higher += wide.slope * own
        far = own + higher * wide.lateral / other.lateral_min / (1.0 - astray)
    else:
        turn = other.normal_slope
        box = (x, y, own, own)
        higher += largest_slope(textures, other, box, turn, other.normal_bend) * own
        far = own + higher * other.normal_lateral / other.lateral_min + size * turn * own
    over = _around(textures, other, x, y, far)
    change = displacement_bend(textures, other, over, over.lateral) * far
    return over, (stretch - change if change <= 0.5 * stretch else 0.0), far
