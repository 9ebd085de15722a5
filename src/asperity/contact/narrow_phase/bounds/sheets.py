"""Bounds of a textured plane around one of its points, where a steep texture may fold it."""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.bounds.curvature import surface_bend
from asperity.contact.narrow_phase.bounds.texture import bounds_of, plane_slopes, smooth_bounds
from asperity.contact.narrow_phase.plane_boxes import plane_normal
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
    """Return the height of a displaced plane's point over its base at (x, y), along w [m]."""
    by_x, by_y, square, along = patch.normal_from_x, patch.normal_from_y, 0.0, 0.0
    for k in range(3):
        by_1, by_2 = patch.slope[0], patch.slope[1]
        if k < 2:
            by_1, by_2 = patch.lateral[k, 0], patch.lateral[k, 1]
        w = patch.normal[k] + by_x[k] * x + by_y[k] * y
        square += w * w
        along += w * (point.p[k] - patch.origin[k] - by_1 * x - by_2 * y)
    return along / math.sqrt(square)


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
    own = 2.0 * travel / stretch
    # Base points of points between the centre's sheet and the highest one.
    slope = largest_slope(
        textures, other, (at.other_x, at.other_y, own, own), other.normal_slope, other.normal_bend
    )
    higher = max(highest - _height_of(other, at.other_x, at.other_y, point), 0.0) + slope * own
    far = own + higher * other.normal_lateral / other.lateral_min
    far += found.max_abs_surface * other.normal_slope * own
    over = over_box(textures, other, at.other_x, at.other_y, far, far)
    change = surface_bend(textures, other, over, over.lateral) * far
    return over, (stretch - change if change <= 0.5 * stretch else 0.0), far
