"""Bounds of a triplanar map over a box of a plane chart: three maps, mixed by the normal.

The mix is `t = sum of a_i t_i`, `a_i = w_i^4 / sum of w^4`, w the normal and t_i the map along the
axis i. The a_i sum to 1; so with m the map that counts most, and a_i what the others count at most,

    t <= top_m + sum over i != m of a_i max(top_i - top_m, 0),

and likewise for slopes and bends. Over a facet whose normals turn little about an axis the other
maps hardly count, and neither do the derivatives of the a_i.
"""

from __future__ import annotations

import math

from asperity._core.kernels import small_kernel
from asperity.contact.narrow_phase.surface_patch import (
    B0,
    B1,
    B2,
    MAPPING,
    ROUND,
    TEXTURE,
    TRIPLANAR,
    UNIT,
    W0,
    W1,
    W2,
)
from asperity.texture.highest import texture_top
from asperity.texture.packed import slope_bounds

# Sums of the sizes of the first three derivatives of the a_i by the unit normal, all along one
# direction: the largest over the sphere.
MIX_1, MIX_2, MIX_3 = 4.2, 14.0, 136.0
_LITTLE = 1e-2
"""What counts for less than this is bounded by the whole texture's."""


@small_kernel
def mixes(chart):
    """Return whether a chart has a triplanar map."""
    return chart[TEXTURE] >= 0.0 and chart[MAPPING] == TRIPLANAR


@small_kernel
def shares_over(chart, x, y, half_x, half_y):
    """Return which map counts most over a box, and how much the next two do at most."""
    low, m = -1.0, 0
    for i in range(3):
        least, _ = _component(chart, i, x, y, half_x, half_y)
        if least > low:
            low, m = least, i
    one = _share(chart, (m + 1) % 3, low, x, y, half_x, half_y)
    return m, one, _share(chart, (m + 2) % 3, low, x, y, half_x, half_y)


@small_kernel
def _component(chart, i, x, y, half_x, half_y):
    """Return the least and the largest size of a component of w over a box, w as it stands."""
    middle = abs(chart[W0 + i] + chart[W1 + i] * x + chart[W2 + i] * y)
    reach = abs(chart[W1 + i]) * half_x + abs(chart[W2 + i]) * half_y
    return max(middle - reach, 0.0), middle + reach


@small_kernel
def _share(chart, i, low, x, y, half_x, half_y):
    """Return how much a map counts at most, where the component of another is `low` at least."""
    _, most = _component(chart, i, x, y, half_x, half_y)
    most, low = most**4, low**4
    # What `surface` leaves out.
    if chart[UNIT] == 1.0 and most < 1e-12:
        return 0.0
    return most / (most + low) if most > 0.0 else 0.0


@small_kernel
def mixing(chart, x, y, half_x, half_y):
    """Return bounds of the sums of sizes of the a_i's first and second derivatives by the normal.

    Of a small a_i they are, with S >= 1/3 the sum of w^4, at most `4 (a^(3/4) + a) S^(-1/4)` and
    `(12 a^(1/2) + 32 a^(3/4) + 44 a) S^(-1/2)`; and those of a_m are minus the others'.
    """
    _, one, two = shares_over(chart, x, y, half_x, half_y)
    first = second = 0.0
    for a in (one, two):
        root = math.sqrt(a)
        higher = root * math.sqrt(root)
        first += 2.0 * 1.3161 * (4.0 * higher + 4.0 * a)
        second += 2.0 * 1.7321 * (12.0 * root + 32.0 * higher + 44.0 * a)
    return min(first, MIX_1), min(second, MIX_2)


@small_kernel
def _on_map(chart, i, x, y, half_x, half_y):
    """Return the rectangle u0, u1, v0, v1 of a map that a box lies on."""
    one, two = (i + 1) % 3, (i + 2) % 3
    u = chart[B0 + one] + chart[B1 + one] * x + chart[B2 + one] * y - chart[ROUND]
    v = chart[B0 + two] + chart[B1 + two] * x + chart[B2 + two] * y - chart[ROUND + 1]
    ru = abs(chart[B1 + one]) * half_x + abs(chart[B2 + one]) * half_y
    rv = abs(chart[B1 + two]) * half_x + abs(chart[B2 + two]) * half_y
    return u - ru, u + ru, v - rv, v + rv


@small_kernel
def triplanar_top(textures, chart, x, y, half_x, half_y):
    """Return the highest point of a triplanar map over a box of a plane chart."""
    k = int(chart[TEXTURE])
    m, one, two = shares_over(chart, x, y, half_x, half_y)
    u0, u1, v0, v1 = _on_map(chart, m, x, y, half_x, half_y)
    top = high = texture_top(textures, k, u0, u1, v0, v1)
    for n in range(1, 3):
        share, other = (one if n == 1 else two), textures.maps[k].highest
        if share >= _LITTLE:
            u0, u1, v0, v1 = _on_map(chart, (m + n) % 3, x, y, half_x, half_y)
            other = texture_top(textures, k, u0, u1, v0, v1)
        high += share * max(other - top, 0.0)
    return high


@small_kernel
def triplanar_slopes(textures, chart, x, y, half_x, half_y):
    """Return largest slope and largest second derivative of a triplanar map's parts over a box.

    Along unit directions of the chart's parameters, none of which is longer on a map. What turning
    normals add by mixing the parts otherwise is not in it.
    """
    k = int(chart[TEXTURE])
    m, one, two = shares_over(chart, x, y, half_x, half_y)
    slope_m, bend_m = _slopes_of(textures, chart, m, x, y, half_x, half_y)
    slope, bend = slope_m, bend_m
    for n in range(1, 3):
        share = one if n == 1 else two
        slope_i, bend_i = textures.maps[k].max_slope, textures.maps[k].max_curvature
        if share >= _LITTLE:
            slope_i, bend_i = _slopes_of(textures, chart, (m + n) % 3, x, y, half_x, half_y)
        slope += share * max(slope_i - slope_m, 0.0)
        bend += share * max(bend_i - bend_m, 0.0)
    return slope, bend


@small_kernel
def _slopes_of(textures, chart, i, x, y, half_x, half_y):
    """Do `triplanar_slopes` for one of the maps."""
    u0, u1, v0, v1 = _on_map(chart, i, x, y, half_x, half_y)
    slope, bend = slope_bounds(textures, int(chart[TEXTURE]), u0, u1, v0, v1)
    if bend < 0.0:
        # Across a slant the map is shorter than the facet, by its least singular value; the
        # largest is 1.
        one, two = (i + 1) % 3, (i + 2) % 3
        slant = chart[B1 + one] * chart[B2 + two] - chart[B1 + two] * chart[B2 + one]
        bend *= slant * slant
    return slope, bend
