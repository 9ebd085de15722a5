"""The way out of two convex meshes, with the normals of either.

The directions of `mesh_manifold` are mean normals of body B. Where an edge or a corner of B meets a
face of A, that face's normal gives a shorter way out. Convex bodies are free along either, so that
where the normals of B's overlap differ the roles are exchanged, and with the
two lengths s_1 and s_2 the way out is

    s = s_2 h(s_1 / s_2),    h(r) = r for r <= 1,  1 + x - x^2 / (4 e) with x = min(r - 1, 2 e)

above: s_1 where it is the shorter one, at most (1 + e) s_2 else, with a continuous slope between.
"""

from __future__ import annotations

from asperity._core.kernels import inner_kernel
from asperity._core.stack import stack_array
from asperity.contact.broad_phase.facet_bvh import DIRECTIONS
from asperity.contact.manifold.convex_regions import are_convex
from asperity.contact.manifold.mesh_manifold import (
    BodyQuery,
    add_mesh_manifold,
    texture_reach,
)
from asperity.contact.manifold.polyhedron_pair import is_polyhedron_pair
from asperity.contact.manifold.properties import has_map, properties_vary

_ROUNDED = 0.03
"""e: how much the way out exceeds the shorter length at most."""
_ALIGNED = 0.97
"""Length of the mean of B's normals from which on A's are not looked at."""


@inner_kernel
def _may_leave_by_either(table, query):
    """Return whether the way out of two bodies is that by either one's normals."""
    is_plain = not (properties_vary(table, query) or has_map(table, query))
    return are_convex(table, query) and is_plain and not is_polyhedron_pair(table, query)


@inner_kernel
def _is_spread(region):
    """Return whether the normals of the facets of B that overlap differ, by some 14 degrees."""
    x = y = z = volume = 0.0
    for d in range(DIRECTIONS):
        if region.sums[d].volume > 0.0:
            n, volume = region.sums[d].normal, region.sums[d].volume
            x, y, z = x + n[0], y + n[1], z + n[2]
    return x * x + y * y + z * z < (_ALIGNED * volume) ** 2


@inner_kernel
def _rates(s_1, s_2):
    """Return the derivatives of the way out by the two lengths."""
    x = min(s_1 / s_2 - 1.0, 2.0 * _ROUNDED)
    if x <= 0.0:
        return 1.0, 0.0
    by_first = 1.0 - x / (2.0 * _ROUNDED)
    return by_first, 1.0 + x - x * x / (4.0 * _ROUNDED) - (1.0 + x) * by_first


@inner_kernel
def _scale_weights(manifold, first, last, factor):
    """Multiply the weights of the patches from `first` to `last`."""
    for p in range(first, last):
        manifold.patches[p].weight *= factor


@inner_kernel
def add_convex_or_mesh_manifold(
    model, parameters, query, overlap, memory, space, workspace, rest_out
):
    """Append the patches of a pair of bodies as `add_mesh_manifold`, with the normals of either.

    Parameters and result are those of `add_mesh_manifold`.
    """
    table, count, region = model.facets, space.manifold.count[0], space.region
    first, middle, way_out, here = count.patches, count.patches, 0.0, query
    for turn in range(2):
        rest = stack_array((6,))
        found = add_mesh_manifold(model, parameters, here, overlap, memory, space, workspace, rest)
        if turn == 0:
            middle, way_out = count.patches, found
            for k in range(6):
                rest_out[k] = rest[k]
            if found == 0.0 or not _may_leave_by_either(table, query):
                break
            if not _is_spread(region):
                break
            raised, lowered = texture_reach(table, query.second, query.first)
            here = BodyQuery(
                query.body, query.second, query.first, query.frame_b, query.frame_a, query.step,
                0.0, raised, lowered, DIRECTIONS,
            )  # fmt: skip
        elif found == 0.0:
            count.patches = middle
        else:
            by_first, by_second = _rates(way_out, found)
            total = by_first * way_out + by_second * found
            _scale_weights(space.manifold, first, middle, by_first * total / way_out)
            _scale_weights(space.manifold, middle, count.patches, by_second * total / found)
            for k in range(6):
                rest_out[k] = by_first * rest_out[k] + by_second * rest[k]
            if by_second == 0.0:
                count.patches = middle
            way_out = total
    return way_out
