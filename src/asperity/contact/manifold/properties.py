"""Friction and stiffness of contact between meshes where these vary over the surface.

Both are means over the overlap region, weighted by the volume of the overlap, so that they are
continuous as a tool crosses from one material to the next. The gradient of the energy k s^2 / 2
then has the term s^2 / 2 dk. With a stiffness map, depths are scaled by the square root of the
relative stiffness instead (`narrow_phase.compliance`), and k is that of the force law.
"""

from __future__ import annotations

import math

from asperity._core.kernels import inner_kernel
from asperity.contact.body_arrays import pair_friction, pair_stiffness


@inner_kernel
def _stiffness_of(table, f, g, parameters):
    """Return the stiffness of two facets in series [N/m]."""
    return pair_stiffness(table.stiffness[f], table.stiffness[g], parameters.stiffness)


@inner_kernel
def pair_volume(region, i):
    """Return the volume of the piece of pair `i` [m^3]."""
    total = 0.0
    for d in range(region.volumes.shape[1]):
        total += region.volumes[i, d]
    return total


@inner_kernel
def properties_vary(table, query):
    """Return whether friction or stiffness vary over either body."""
    return table.varies[query.first] or table.varies[query.second]


@inner_kernel
def has_map(table, query):
    """Return whether either body has a stiffness map."""
    return table.has_map[query.first] or table.has_map[query.second]


@inner_kernel
def least_scale(table, query, usual):
    """Return the least factor, at most 1, by which a stiffness map scales a depth; 1 without one.

    `usual` is the stiffness of the force law [N/m].
    """
    if not has_map(table, query):
        return 1.0
    compliance = table.compliance[query.first, 0] + table.compliance[query.second, 0]
    return 1.0 / math.sqrt(max(usual * compliance, 1.0))


@inner_kernel
def largest_scale(table, query, usual):
    """Return the largest factor, at least 1, by which a stiffness map scales a depth."""
    compliance = table.compliance[query.first, 1] + table.compliance[query.second, 1]
    if not has_map(table, query) or compliance == 0.0:
        return 1.0
    return 1.0 / math.sqrt(min(usual * compliance, 1.0))


@inner_kernel
def contact_properties(table, query, count, parameters, region):
    """Return stiffness [N/m] and friction [-] of a contact: means over its `count` facet pairs."""
    f, g = table.first[table.root[query.first]], table.first[table.root[query.second]]
    stiffness = friction = total = 0.0
    if properties_vary(table, query):
        for i in range(count):
            volume = pair_volume(region, i)
            if volume > 0.0:
                f, g = region.facets.pairs[i, 0], region.facets.pairs[i, 1]
                own = pair_friction(table.friction[f], table.friction[g], parameters.friction)
                total += volume
                stiffness += volume * _stiffness_of(table, f, g, parameters)
                friction += volume * own
    if total > 0.0:
        stiffness, friction = stiffness / total, friction / total
    else:
        friction = pair_friction(table.friction[f], table.friction[g], parameters.friction)
        stiffness = _stiffness_of(table, f, g, parameters)
    return (parameters.stiffness if has_map(table, query) else stiffness), friction


@inner_kernel
def add_stiffness_rates(table, count, parameters, stiffness, way_out, region):
    """Add the effect of k on the energy to `region.rates`, as an equivalent change of the way out.

    dU = k s (ds + s / (2 k) dk); the derivative of k by a pair's volume is (k_pair - k) / volume.
    """
    total = 0.0
    for i in range(count):
        total += pair_volume(region, i)
    if total == 0.0:
        return
    for i in range(count):
        f, g = region.facets.pairs[i, 0], region.facets.pairs[i, 1]
        more = _stiffness_of(table, f, g, parameters) - stiffness
        region.rates[i] += 0.5 * way_out * more / (stiffness * total)
