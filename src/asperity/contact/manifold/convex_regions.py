"""The overlap region of two convex meshes, seen from several directions.

Two convex bodies overlap in one region, and each direction separates them completely. So all
directions are split by the whole region, and leave nothing of each other. A direction counts as far
as it has a part of the region: with Q_d = volume_d / (deepest_d + reach)^2 its presence rises from
0 to 1 as its part of the sum of all Q_d goes from 6 to 16 %: the largest of six always counts.
"""

from __future__ import annotations

from asperity._core.kernels import clear, inner_kernel
from asperity._core.stack import stack_array
from asperity.contact.broad_phase.facet_bvh import DIRECTIONS
from asperity.contact.manifold.residual import add_deepest
from asperity.contact.manifold.separation import smooth_step, smooth_step_slope

_ABSENT, _PRESENT = 0.06, 0.16
_LEAST_HEIGHT = 1e-15
"""Avoids a division by 0 [m]."""


@inner_kernel
def _fill_parts(region, directions, reach, part_out):
    """Fill each direction's part of the region (6,); return the sum of all Q [m]."""
    total = 0.0
    for d in range(DIRECTIONS):
        volume, part_out[d] = directions[d].own_volume, 0.0
        if volume > 0.0:
            part_out[d] = volume / max(region.sums[d].deepest + reach, _LEAST_HEIGHT) ** 2
        total += part_out[d]
    for d in range(DIRECTIONS):
        part_out[d] /= max(total, 1e-300)
    return total


@inner_kernel
def fill_presences(query, region, directions):
    """Fill the presence of all directions, and give each the moments of the whole region."""
    part, whole = stack_array((6,)), stack_array((10,))
    clear(whole)
    for d in range(DIRECTIONS):
        sums = region.sums[d]
        directions[d].own_volume = sums.volume
        whole[0] += sums.volume
        for k in range(3):
            whole[1 + k] += sums.first_moment[k]
        for k in range(6):
            whole[4 + k] += sums.second_moment[k]
    _fill_parts(region, directions, query.raised, part)
    for d in range(DIRECTIONS):
        sums = region.sums[d]
        directions[d].presence = smooth_step((part[d] - _ABSENT) / (_PRESENT - _ABSENT))
        if sums.volume == 0.0:
            continue
        sums.volume = whole[0]
        for k in range(3):
            sums.first_moment[k] = whole[1 + k]
        for k in range(6):
            sums.second_moment[k] = whole[4 + k]


@inner_kernel
def add_presence_rates(table, query, count, centre, space, gradient_io):
    """Add the derivatives by presences: by the pairs' volumes to `space.region.rates`, and others.

    `centre` (3,) is the point about which the tool turns, B's frame [m]; `gradient_io` (6,) is by
    translation and rotation.
    """
    region, directions, part, by = (
        space.region, space.directions, stack_array((6,)), stack_array((6,)),
    )  # fmt: skip
    total, mean, is_wanted = _fill_parts(region, directions, query.raised, part), 0.0, False
    for d in range(DIRECTIONS):
        x = (part[d] - _ABSENT) / (_PRESENT - _ABSENT)
        by[d] = directions[d].presence_rate * smooth_step_slope(x) / (_PRESENT - _ABSENT)
        mean += by[d] * part[d]
        is_wanted = is_wanted or by[d] != 0.0
    if not is_wanted:
        return
    for d in range(DIRECTIONS):
        by[d] = (by[d] - mean) / total
        if directions[d].own_volume > 0.0:
            height = max(region.sums[d].deepest + query.raised, _LEAST_HEIGHT)
            by[d] /= height * height
            rate = -2.0 * by[d] * directions[d].own_volume / height
            add_deepest(region.sums[d], rate, centre, gradient_io)
    for i in range(count):
        g = region.facets.pairs[i, 1]
        for d in range(DIRECTIONS):
            if region.volumes[i, d] > 0.0:
                region.rates[i] += table.shares[g, d] * by[d]
