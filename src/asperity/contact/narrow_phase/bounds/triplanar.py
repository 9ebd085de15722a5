"""Bounds of a triplanar map over a box of a patch: three maps, blended by the normal.

The height is `t = sum of a_i t_i` with the weights `a_i = w_i^4 / sum of w^4`, w the normal and t_i
the map along axis i. The weights sum to 1, so with m the map of largest weight,

    t <= top_m + sum over i != m of a_i (top_i - top_m),

a_i the largest weight over the box where top_i is above top_m, otherwise the least; and likewise
for slopes and second derivatives. Over a facet with normals near an axis the weights of the other
maps and the derivatives of all weights are small.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from asperity._core.kernels import small_kernel
from asperity.contact.narrow_phase.surface_patch import TRIPLANAR, singular_values
from asperity.texture.highest import texture_top
from asperity.texture.packed import slope_bounds

MIX_1, MIX_2, MIX_3 = 4.2, 14.0, 136.0
"""Largest sums over i, on the whole sphere, of the sizes of the first three derivatives of the
weights a_i by the unit normal along one direction."""
PLANE = (1.0, 0.0)
"""Middle and half the range of the root of a plane patch."""
_SMALL_WEIGHT = 1e-2
"""Weight below which a map has the bound of the whole texture."""


class Share(NamedTuple):
    """Range of the weight of one of three maps over a box."""

    least: float
    most: float


@small_kernel
def is_triplanar(patch):
    """Return whether a patch has a triplanar map."""
    return patch.texture >= 0 and patch.mapping == TRIPLANAR


@small_kernel
def shares_over(patch, box, root):
    """Return the map m of largest weight over a box, and `Share`s of the next two, m + 1 and m + 2.

    `box` is (x, y, half_x, half_y); `root` is the middle and half the range of the root over it.
    """
    ranges = (
        _component(patch, 0, box, root),
        _component(patch, 1, box, root),
        _component(patch, 2, box, root),
    )
    m = 0
    for i in range(1, 3):
        if ranges[i][0] > ranges[m][0]:
            m = i
    of_m, of_one, of_two = ranges[m], ranges[(m + 1) % 3], ranges[(m + 2) % 3]
    return m, _share(patch, of_one, of_m, of_two), _share(patch, of_two, of_m, of_one)


@small_kernel
def _component(patch, i, box, root):
    """Return the least and the largest size of a component of w, not normalised, over a box."""
    x, y, half_x, half_y = box
    by_x, by_y = patch.body_normal_from_x[i], patch.body_normal_from_y[i]
    by_root = patch.body_normal_from_root[i]
    middle = abs(patch.body_normal[i] + by_x * x + by_y * y + by_root * root[0])
    reach = abs(by_x) * half_x + abs(by_y) * half_y + abs(by_root) * root[1]
    return max(middle - reach, 0.0), middle + reach


@small_kernel
def _share(patch, of_map, of_m, of_third):
    """Return the `Share` of a map, from the ranges of the components of w along all three axes."""
    most, low = of_map[1] ** 4, of_m[0] ** 4
    # `height_on` ignores so small a weight.
    if (patch.is_unit and most < 1e-12) or most == 0.0:
        return Share(0.0, 0.0)
    least = of_map[0] ** 4
    others = of_m[1] ** 4 + of_third[1] ** 4
    return Share(least / (least + others), most / (most + low))


@small_kernel
def _blended(value_m, value, share):
    """Return what a map adds to the bound by the map of largest weight, `value_m`."""
    more = value - value_m
    return more * (share.most if more > 0.0 else share.least)


@small_kernel
def mixing(shares):
    """Return bounds of the sums of sizes of the weights' first and second derivatives by w.

    For a small a_i they are, with S >= 1/3 the sum of w^4, at most `4 (a^(3/4) + a) S^(-1/4)` and
    `(12 a^(1/2) + 32 a^(3/4) + 44 a) S^(-1/2)`; those of a_m are minus the sum of the others.
    `shares` is what `shares_over` returns.
    """
    _, one, two = shares
    first = second = 0.0
    for a in (one.most, two.most):
        root = math.sqrt(a)
        higher = root * math.sqrt(root)
        first += 2.0 * 1.3161 * (4.0 * higher + 4.0 * a)
        second += 2.0 * 1.7321 * (12.0 * root + 32.0 * higher + 44.0 * a)
    return min(first, MIX_1), min(second, MIX_2)


@small_kernel
def _box_on_map(patch, i, box, root):
    """Return the rectangle u0, u1, v0, v1 that a box covers on one of the maps."""
    x, y, half_x, half_y = box
    one, two = (i + 1) % 3, (i + 2) % 3
    at, by_x, by_y = patch.texture_origin, patch.texture_from_x, patch.texture_from_y
    by_root = patch.texture_from_root
    u = at[one] + by_x[one] * x + by_y[one] * y + by_root[one] * root[0] - patch.map_start[0]
    v = at[two] + by_x[two] * x + by_y[two] * y + by_root[two] * root[0] - patch.map_start[1]
    ru = abs(by_x[one]) * half_x + abs(by_y[one]) * half_y + abs(by_root[one]) * root[1]
    rv = abs(by_x[two]) * half_x + abs(by_y[two]) * half_y + abs(by_root[two]) * root[1]
    return u - ru, u + ru, v - rv, v + rv


@small_kernel
def triplanar_top(textures, patch, box, root, shares):
    """Return the largest height of a triplanar map over a box of a patch [m]."""
    k = patch.texture
    m, one, two = shares
    u0, u1, v0, v1 = _box_on_map(patch, m, box, root)
    top = high = texture_top(textures, k, u0, u1, v0, v1)
    for n in range(1, 3):
        share, other = (one if n == 1 else two), textures.maps[k].highest
        if share.most >= _SMALL_WEIGHT:
            u0, u1, v0, v1 = _box_on_map(patch, (m + n) % 3, box, root)
            other = texture_top(textures, k, u0, u1, v0, v1)
        high += _blended(top, other, share)
    return high


@small_kernel
def plane_triplanar_top(textures, patch, x, y, half_x, half_y):
    """Return the `triplanar_top` of a box of a plane patch [m]."""
    box = (x, y, half_x, half_y)
    return triplanar_top(textures, patch, box, PLANE, shares_over(patch, box, PLANE))


@small_kernel
def triplanar_slopes(textures, patch, box, root, shares, root_slopes):
    """Return the largest slope and second derivative over a box of the three maps, blended.

    They are along unit directions of the patch's parameters. The variation of the weights is not
    included. `root_slopes` bounds the root's first and second derivatives, 0 for a plane.
    """
    k = patch.texture
    m, one, two = shares
    slope_m, bend_m = _slopes_of(textures, patch, m, box, root, root_slopes)
    slope, bend = slope_m, bend_m
    for n in range(1, 3):
        share = one if n == 1 else two
        slope_i, bend_i = textures.maps[k].max_slope, textures.maps[k].max_curvature
        if share.most >= _SMALL_WEIGHT or root_slopes[1] > 0.0:
            slope_i, bend_i = _slopes_of(textures, patch, (m + n) % 3, box, root, root_slopes)
        slope += _blended(slope_m, slope_i, share)
        bend += _blended(bend_m, bend_i, share)
    return slope, bend


@small_kernel
def _slopes_of(textures, patch, i, box, root, root_slopes):
    """Do `triplanar_slopes` for one of the maps."""
    u0, u1, v0, v1 = _box_on_map(patch, i, box, root)
    slope, bend = slope_bounds(textures, patch.texture, u0, u1, v0, v1)
    one, two = (i + 1) % 3, (i + 2) % 3
    by_x, by_y, by_root = patch.texture_from_x, patch.texture_from_y, patch.texture_from_root
    if patch.bulge > 0.0:
        least, most = singular_values(by_x[one], by_y[one], by_x[two], by_y[two])
        through_root = math.hypot(by_root[one], by_root[two])
        least, most = (
            max(least - through_root * root_slopes[0], 0.0),
            most + through_root * root_slopes[0],
        )
        bend = bend * (most * most if bend > 0.0 else least * least)
        return slope * most, bend + slope * through_root * root_slopes[1]
    if bend < 0.0:
        # On a slant the map is compressed by its least singular value; the largest is 1.
        slant = by_x[one] * by_y[two] - by_x[two] * by_y[one]
        bend *= slant * slant
    return slope, bend
