"""The mean normal of a direction of contact between meshes, and its derivative.

It is the mean of B's facet normals over the overlap region, weighted by the volume of the overlap,
blended with the mean of only those normals within 20 degrees of it: so a chamfer beside a wide face
does not tilt the normal of the face. The blending weight is the fraction of the volume with such
normals. At an edge between two faces that both deviate by more it is 0, so that the normal is
continuous as the tool moves round the edge.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from asperity._core.kernels import inner_kernel
from asperity._core.stack import stack_array

_LEAST_COSINE = math.cos(math.radians(20.0))
"""Smallest cosine to the mean of a facet normal that counts as near it."""


class _Near(NamedTuple):
    """Sums over facets whose normal is near the mean."""

    size: float
    """Length of the weighted sum of their normals [m^3]."""
    share: float
    """Their fraction of the volume: the blending weight."""
    total: float
    """Volume of all facets [m^3]."""


@inner_kernel
def _sum_near(table, count, d, region, mean, near_out):
    """Fill the unit mean (3,) of normals near `mean`, or `mean` if none is; return a `_Near`."""
    x = y = z = near = total = 0.0
    for i in range(count):
        volume = region.volumes[i, d]
        if volume == 0.0:
            continue
        f = table.axes[region.facets.pairs[i, 1], 2]
        along = f[0] * mean[0] + f[1] * mean[1] + f[2] * mean[2]
        total += volume
        volume *= max((along - _LEAST_COSINE) / (1.0 - _LEAST_COSINE), 0.0)
        near += volume
        x, y, z = x + volume * f[0], y + volume * f[1], z + volume * f[2]
    size = math.sqrt(x * x + y * y + z * z)
    for k in range(3):
        near_out[k] = (x, y, z)[k] / size if size > 0.0 else mean[k]
    return _Near(size, near / total, total)


@inner_kernel
def _fill_mean(normal_sum, mean_out):
    """Fill the unit vector (3,) along a sum of normals; return the sum's norm."""
    size = math.sqrt(normal_sum[0] ** 2 + normal_sum[1] ** 2 + normal_sum[2] ** 2)
    for k in range(3):
        mean_out[k] = normal_sum[k] / size
    return size


@inner_kernel
def fill_mean_normal(table, count, d, region, normal_out):
    """Fill the unit normal (3,) of direction `d` in B's frame."""
    mean, near = stack_array((3,)), stack_array((3,))
    _fill_mean(region.sums[d].normal, mean)
    found = _sum_near(table, count, d, region, mean, near)
    square = 0.0
    for k in range(3):
        normal_out[k] = mean[k] + found.share * (near[k] - mean[k])
        square += normal_out[k] * normal_out[k]
    for k in range(3):
        normal_out[k] /= math.sqrt(square)


@inner_kernel
def add_normal_rates(table, count, d, region, turn, rates_io):
    """Add derivatives by the pairs' volumes (pairs,): `fill_mean_normal` differentiated in reverse.

    `turn` (3,) is the derivative of the differentiated quantity by the unit normal of direction
    `d`.
    """
    mean, near, by_mean, by_near = (
        stack_array((3,)), stack_array((3,)), stack_array((3,)), stack_array((3,)),
    )  # fmt: skip
    length = _fill_mean(region.sums[d].normal, mean)
    found = _sum_near(table, count, d, region, mean, near)
    square = along = 0.0
    for k in range(3):
        total = mean[k] + found.share * (near[k] - mean[k])
        square += total * total
        along += total * turn[k]
    size, by_share, onto = math.sqrt(square), 0.0, 0.0
    for k in range(3):
        total = mean[k] + found.share * (near[k] - mean[k])
        across = (turn[k] - total * along / square) / size
        by_mean[k], by_near[k] = (1.0 - found.share) * across, found.share * across
        by_share += (near[k] - mean[k]) * across
        onto += near[k] * by_near[k]
    for k in range(3):
        by_near[k] = (by_near[k] - near[k] * onto) / found.size if found.size > 0.0 else 0.0
    by_near_volume, by_total = by_share / found.total, -by_share * found.share / found.total
    for i in range(count):
        volume = region.volumes[i, d]
        if volume == 0.0:
            continue
        f = table.axes[region.facets.pairs[i, 1], 2]
        along = f[0] * mean[0] + f[1] * mean[1] + f[2] * mean[2]
        if along > _LEAST_COSINE:
            rate = by_near_volume
            for k in range(3):
                rate += by_near[k] * f[k]
            for k in range(3):
                by_mean[k] += volume * rate * f[k] / (1.0 - _LEAST_COSINE)
    onto = mean[0] * by_mean[0] + mean[1] * by_mean[1] + mean[2] * by_mean[2]
    for k in range(3):
        by_mean[k] = (by_mean[k] - mean[k] * onto) / length
    for i in range(count):
        if region.volumes[i, d] == 0.0:
            continue
        g = region.facets.pairs[i, 1]
        f = table.axes[g, 2]
        along = f[0] * mean[0] + f[1] * mean[1] + f[2] * mean[2]
        part = max((along - _LEAST_COSINE) / (1.0 - _LEAST_COSINE), 0.0)
        rate = by_total + part * by_near_volume
        for k in range(3):
            rate += (by_mean[k] + part * by_near[k]) * f[k]
        rates_io[i] += table.shares[g, d] * rate
