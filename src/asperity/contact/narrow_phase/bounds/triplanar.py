"""Bounds of a triplanar map over a box of a plane patch: three maps, mixed by the normal.

The mix is `t = sum of a_i t_i`, `a_i = w_i^4 / sum of w^4`, w the normal and t_i the map along the
axis i. The a_i sum to 1; so with m the map that counts most, and a_i what the others count at most,

    t <= top_m + sum over i != m of a_i max(top_i - top_m, 0),

and likewise for slopes and bends. Over a facet whose normals turn little about an axis the other
maps hardly count, and neither do the derivatives of the a_i.
"""

from __future__ import annotations

import math

from asperity._core.kernels import small_kernel
from asperity.contact.narrow_phase.surface_patch import TRIPLANAR
from asperity.texture.highest import texture_top
from asperity.texture.packed import slope_bounds

# Sums of the sizes of the first three derivatives of the a_i by the unit normal, all along one
# direction: the largest over the sphere.
MIX_1, MIX_2, MIX_3 = 4.2, 14.0, 136.0
_LITTLE = 1e-2
"""What counts for less than this is bounded by the whole texture's."""


@small_kernel
def is_triplanar(patch):
    """Return whether a patch has a triplanar map."""
    return patch.texture >= 0 and patch.mapping == TRIPLANAR


@small_kernel
def shares_over(patch, x, y, half_x, half_y):
    """Return which map counts most over a box, and how much the next two do at most."""
    low, m = -1.0, 0
    for i in range(3):
        least, _ = _component(patch, i, x, y, half_x, half_y)
        if least > low:
            low, m = least, i
    one = _share(patch, (m + 1) % 3, low, x, y, half_x, half_y)
    return m, one, _share(patch, (m + 2) % 3, low, x, y, half_x, half_y)


@small_kernel
def _component(patch, i, x, y, half_x, half_y):
    """Return the least and the largest size of a component of w over a box, w as it stands."""
    middle = abs(
        patch.body_normal[i] + patch.body_normal_from_x[i] * x + patch.body_normal_from_y[i] * y
    )
    reach = abs(patch.body_normal_from_x[i]) * half_x + abs(patch.body_normal_from_y[i]) * half_y
    return max(middle - reach, 0.0), middle + reach


@small_kernel
def _share(patch, i, low, x, y, half_x, half_y):
    """Return how much a map counts at most, where the component of another is `low` at least."""
    _, most = _component(patch, i, x, y, half_x, half_y)
    most, low = most**4, low**4
    # What `surface` leaves out.
    if patch.is_unit and most < 1e-12:
        return 0.0
    return most / (most + low) if most > 0.0 else 0.0


@small_kernel
def mixing(patch, x, y, half_x, half_y):
    """Return bounds of the sums of sizes of the a_i's first and second derivatives by the normal.

    Of a small a_i they are, with S >= 1/3 the sum of w^4, at most `4 (a^(3/4) + a) S^(-1/4)` and
    `(12 a^(1/2) + 32 a^(3/4) + 44 a) S^(-1/2)`; and those of a_m are minus the others'.
    """
    _, one, two = shares_over(patch, x, y, half_x, half_y)
    first = second = 0.0
    for a in (one, two):
        root = math.sqrt(a)
        higher = root * math.sqrt(root)
        first += 2.0 * 1.3161 * (4.0 * higher + 4.0 * a)
        second += 2.0 * 1.7321 * (12.0 * root + 32.0 * higher + 44.0 * a)
    return min(first, MIX_1), min(second, MIX_2)


@small_kernel
def _on_map(patch, i, x, y, half_x, half_y):
    """Return the rectangle u0, u1, v0, v1 of a map that a box lies on."""
    one, two = (i + 1) % 3, (i + 2) % 3
    at, by_x, by_y = patch.texture_origin, patch.texture_from_x, patch.texture_from_y
    u = at[one] + by_x[one] * x + by_y[one] * y - patch.map_start[0]
    v = at[two] + by_x[two] * x + by_y[two] * y - patch.map_start[1]
    ru = abs(by_x[one]) * half_x + abs(by_y[one]) * half_y
    rv = abs(by_x[two]) * half_x + abs(by_y[two]) * half_y
    return u - ru, u + ru, v - rv, v + rv


@small_kernel
def triplanar_top(textures, patch, x, y, half_x, half_y):
    """Return the highest point of a triplanar map over a box of a plane patch."""
    k = patch.texture
    m, one, two = shares_over(patch, x, y, half_x, half_y)
    u0, u1, v0, v1 = _on_map(patch, m, x, y, half_x, half_y)
    top = high = texture_top(textures, k, u0, u1, v0, v1)
    for n in range(1, 3):
        share, other = (one if n == 1 else two), textures.maps[k].highest
        if share >= _LITTLE:
            u0, u1, v0, v1 = _on_map(patch, (m + n) % 3, x, y, half_x, half_y)
            other = texture_top(textures, k, u0, u1, v0, v1)
        high += share * max(other - top, 0.0)
    return high


@small_kernel
def triplanar_slopes(textures, patch, x, y, half_x, half_y):
    """Return largest slope and largest second derivative of a triplanar map's parts over a box.

    Along unit directions of the patch's parameters, none of which is longer on a map. What turning
    normals add by mixing the parts otherwise is not in it.
    """
    k = patch.texture
    m, one, two = shares_over(patch, x, y, half_x, half_y)
    slope_m, bend_m = _slopes_of(textures, patch, m, x, y, half_x, half_y)
    slope, bend = slope_m, bend_m
    for n in range(1, 3):
        share = one if n == 1 else two
        slope_i, bend_i = textures.maps[k].max_slope, textures.maps[k].max_curvature
        if share >= _LITTLE:
            slope_i, bend_i = _slopes_of(textures, patch, (m + n) % 3, x, y, half_x, half_y)
        slope += share * max(slope_i - slope_m, 0.0)
        bend += share * max(bend_i - bend_m, 0.0)
    return slope, bend


@small_kernel
def _slopes_of(textures, patch, i, x, y, half_x, half_y):
    """Do `triplanar_slopes` for one of the maps."""
    u0, u1, v0, v1 = _on_map(patch, i, x, y, half_x, half_y)
    slope, bend = slope_bounds(textures, patch.texture, u0, u1, v0, v1)
    if bend < 0.0:
        # Across a slant the map is shorter than the facet, by its least singular value; the
        # largest is 1.
        one, two = (i + 1) % 3, (i + 2) % 3
        by_x, by_y = patch.texture_from_x, patch.texture_from_y
        slant = by_x[one] * by_y[two] - by_x[two] * by_y[one]
        bend *= slant * slant
    return slope, bend
