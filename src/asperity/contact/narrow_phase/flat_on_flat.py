"""Fast path for two smooth planes: their overlap is linear, so its maximum is at a corner.

If the whole overlap polygon, or one of its sides, is equally deep, its centroid represents it, with
its area or length as weight.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel
from asperity.contact.narrow_phase.overlap import overlap_at
from asperity.contact.narrow_phase.polygon import clip
from asperity.contact.narrow_phase.smooth_base import parameters_over

_SLACK = 1e-15
"""Distance by which sides are moved outwards against rounding where two edges meet [m]."""
_LINE_WIDTH = 1e-9
"""Width that turns the length of a line into a weight [m]."""


@inner_kernel
def is_straight(patch):
    """Return whether a patch is plane, smooth, and has straight sides, unlike a cylinder's end."""
    if patch.bulge > 0.0 or patch.texture >= 0:
        return False
    curved = 0
    for i in range(patch.border_count):
        curved += 1 if patch.borders[i].from_square != 0.0 else 0
    return curved == 0


@inner_kernel
def plane_overlap(patch, other, slack, polygon):
    """Fill `polygon` with the part of a patch's parameters where two plane patches overlap.

    The limits of the other patch are widened by `slack` [m]; curved ones are ignored. Returns the
    number of corners and the overlap of the smooth bases, which is linear: at (0, 0), by x, by y.
    """
    b0, b1, b2, c0, c1, c2 = parameters_over(patch, other)
    at_zero = patch.origin[2] + other.origin[2] + other.slope[0] * b0 + other.slope[1] * c0
    g_x = patch.slope[0] + other.slope[0] * b1 + other.slope[1] * c1
    g_y = patch.slope[1] + other.slope[0] * b2 + other.slope[1] * c2
    own = size = patch.corner_count
    mid_x, mid_y = (
        0.5 * (patch.rectangle[0] + patch.rectangle[1]),
        0.5 * (patch.rectangle[2] + patch.rectangle[3]),
    )
    half_x, half_y = patch.rectangle[1] - mid_x, patch.rectangle[3] - mid_y
    for n in range(size):
        polygon[n, 0], polygon[n, 1] = patch.corners[n, 0], patch.corners[n, 1]
    if own == 0:
        size = 4
        for n in range(4):
            polygon[n, 0] = patch.rectangle[0] if n in (0, 3) else patch.rectangle[1]
            polygon[n, 1] = patch.rectangle[2] if n < 2 else patch.rectangle[3]
    # The first borders of a facet are the sides between its corners.
    for n in range(own, patch.border_count):
        border = patch.borders[n]
        if border.from_square == 0.0 and size > 0:
            size = clip(polygon, size, border.from_x, border.from_y, -border.constant)
    slack /= other.lateral_min
    # A facet that is bounded by its sides fills its rectangle: its borders suffice.
    for n in range(4 if other.corner_count == 0 else 0):
        sign = 1.0 if n & 1 else -1.0
        f0, f1, f2 = (b0, b1, b2) if n < 2 else (c0, c1, c2)
        r = sign * (other.rectangle[n] - f0) + slack
        far = sign * (f1 * mid_x + f2 * mid_y) + abs(f1) * half_x + abs(f2) * half_y
        if size > 0 and far > r:
            size = clip(polygon, size, sign * f1, sign * f2, r)
    for n in range(other.border_count):
        border = other.borders[n]
        k1, k2 = border.from_x, border.from_y
        f1, f2, r = (
            k1 * b1 + k2 * c1,
            k1 * b2 + k2 * c2,
            slack - border.constant - k1 * b0 - k2 * c0,
        )
        far = f1 * mid_x + f2 * mid_y + abs(f1) * half_x + abs(f2) * half_y
        if border.from_square == 0.0 and size > 0 and far > r:
            size = clip(polygon, size, f1, f2, r)
    return size, at_zero, g_x, g_y


@inner_kernel
def deepest_of_planes(textures, patch, other, tie, search):
    """Fill `search.at` with the deepest point of two smooth plane patches.

    Returns
    -------
    tuple (bool, float)
        Whether there is such a point; the area that it represents [m^2]. Corners within `tie` [m]
        of the deepest count as equally deep.
    """
    polygon, at = search.polygon, search.at
    size, at_zero, g_x, g_y = plane_overlap(patch, other, _SLACK, polygon)
    if size == 0:
        return False, 0.0
    most = -np.inf
    for j in range(size):
        most = max(most, g_x * polygon[j, 0] + g_y * polygon[j, 1])
    # Keep the equally deep corners; they are consecutive.
    tied = 0
    for j in range(size):
        if g_x * polygon[j, 0] + g_y * polygon[j, 1] >= most - tie:
            polygon[tied, 0], polygon[tied, 1] = polygon[j, 0], polygon[j, 1]
            tied += 1
    area = c_x = c_y = 0.0
    length, first, last = 0.0, 0, 0
    for j in range(tied):
        k = j + 1 if j + 1 < tied else 0
        one, two = polygon[j, 0] - polygon[0, 0], polygon[j, 1] - polygon[0, 1]
        part = one * (polygon[k, 1] - polygon[0, 1]) - two * (polygon[k, 0] - polygon[0, 0])
        area += 0.5 * part
        c_x += part / 6.0 * (one + polygon[k, 0] - polygon[0, 0])
        c_y += part / 6.0 * (two + polygon[k, 1] - polygon[0, 1])
        for i in range(j):
            away = math.hypot(polygon[j, 0] - polygon[i, 0], polygon[j, 1] - polygon[i, 1])
            if away > length:
                length, first, last = away, i, j
    if abs(area) > 1e-6 * length * length and length > 0.0:
        x, y = polygon[0, 0] + c_x / area, polygon[0, 1] + c_y / area
        area = abs(area)
    else:
        # A corner, or the middle of a side.
        x = 0.5 * (polygon[first, 0] + polygon[last, 0])
        y = 0.5 * (polygon[first, 1] + polygon[last, 1])
        area = _LINE_WIDTH * length
    overlap_at(textures, patch, other, x, y, search, at)
    return at.f >= at_zero + most - 2.0 * tie, area
