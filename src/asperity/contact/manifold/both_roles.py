"""The way out of two convex meshes, with the normals of either.

The directions of `mesh_manifold` are mean normals of body B. Where an edge or a corner of B meets a
face of A, that face's normal gives a shorter way out. Convex bodies are free along either, so that
where the normals of B's overlap differ the roles are exchanged too, and with the two lengths s_1
and s_2 the way out is

    s = s_2 h(s_1 / s_2),    h(r) = r for r <= 1,  1 + x - x^2 / (4 e) with x = min(r - 1, 2 e)

above: s_1 where it is the shorter one, at most (1 + e) s_2 else, with a continuous slope between.
The exchange is blended in as the mean of B's unit normals gets shorter.
"""

from __future__ import annotations

import math

from asperity._core.kernels import clear, inner_kernel
from asperity._core.stack import stack_array
from asperity.contact.broad_phase.facet_bvh import DIRECTIONS
from asperity.contact.broad_phase.facet_pairs import are_convex
from asperity.contact.manifold.mesh_manifold import (
    BodyQuery,
    add_mesh_manifold,
    texture_reach,
)
from asperity.contact.manifold.overlap_region import clip_piece
from asperity.contact.manifold.polyhedron_pair import is_polyhedron_pair
from asperity.contact.manifold.properties import has_map, pair_volume, properties_vary
from asperity.contact.manifold.region_gradient import add_piece_gradient
from asperity.contact.manifold.separation import smooth_step, smooth_step_slope
from asperity.geometry.frames import add_to_world, fill_origin

_ROUNDED = 0.03
"""e: how much the way out exceeds the shorter length at most."""
_ALIGNED, _SPREAD = 0.98, 0.95
"""Lengths of the mean of B's normals between which the exchange is blended in."""
_LEAST_VOLUME = 1e-60
"""Avoids a division by 0 [m^3]."""


@inner_kernel
def _may_leave_by_either(table, query):
    """Return whether the way out of two bodies is that by either one's normals."""
    is_plain = not (properties_vary(table, query) or has_map(table, query))
    return (
        are_convex(table, query.first, query.second)
        and is_plain
        and not is_polyhedron_pair(table, query)
    )


@inner_kernel
def _fill_mean_normal(region, mean_out):
    """Fill the mean (3,) of the unit normals of B's facets that overlap; return its length."""
    clear(mean_out)
    volume = square = 0.0
    for d in range(DIRECTIONS):
        sums = region.sums[d]
        if sums.volume > 0.0:
            volume = sums.volume  # of the whole region
            for k in range(3):
                mean_out[k] += sums.normal[k]
    for k in range(3):
        mean_out[k] /= max(volume, _LEAST_VOLUME)
        square += mean_out[k] * mean_out[k]
    return math.sqrt(square)


@inner_kernel
def _add_spread_gradient(table, query, count, rate, region, rest_io):
    """Add the gradient of the length of the mean normal, times `rate`, world axes."""
    mean, centre, gradient, q = (
        stack_array((3,)), stack_array((3,)), stack_array((6,)), stack_array((6,)),
    )  # fmt: skip
    length, volume = _fill_mean_normal(region, mean), 0.0
    for d in range(DIRECTIONS):
        volume = max(volume, region.sums[d].volume)
    fill_origin(query.frame_b, centre)
    clear(gradient)
    clear(q)
    sign = -1.0 if query.first == query.body else 1.0
    for i in range(count):
        f, g = region.facets.pairs[i, 0], region.facets.pairs[i, 1]
        if pair_volume(region, i) == 0.0:
            continue
        piece = clip_piece(table, query, f, g, region)
        if piece[1] >= 3:
            z, along = table.axes[g, 2], 0.0
            for k in range(3):
                along += z[k] * mean[k] / length
            q[0] = sign * rate * (along - length) / volume
            add_piece_gradient(table, (f, g), piece, query.raised, q, centre, region, gradient)
    add_to_world(query.frame_b, gradient, rest_io)


@inner_kernel
def _is_empty(region):
    """Return whether no direction has an overlap."""
    is_empty = True
    for d in range(DIRECTIONS):
        is_empty = is_empty and region.sums[d].volume == 0.0
    return is_empty


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
    first, here = count.patches, query
    middle, way_out, part, slope = first, 0.0, 0.0, 0.0
    rest, spread, mean = stack_array((6,)), stack_array((6,)), stack_array((3,))
    for turn in range(2):
        found, limit, pairs = add_mesh_manifold(
            model, parameters, here, overlap, memory, space, workspace, rest
        )
        if turn == 0:
            middle, way_out = count.patches, found
            for k in range(6):
                rest_out[k] = rest[k]
            if found == 0.0 or not _may_leave_by_either(table, query):
                break
            x = (_ALIGNED - _fill_mean_normal(region, mean)) / (_ALIGNED - _SPREAD)
            part, slope = smooth_step(x), -smooth_step_slope(x) / (_ALIGNED - _SPREAD)
            if part == 0.0:
                break
            clear(spread)
            if slope != 0.0:
                used = BodyQuery(
                    query.body, query.first, query.second, query.frame_a, query.frame_b, query.step,
                    limit, query.raised, query.lowered, query.offset,
                )  # fmt: skip
                _add_spread_gradient(table, used, pairs, slope, region, spread)
            raised, lowered = texture_reach(table, query.second, query.first)
            here = BodyQuery(
                query.body, query.second, query.first, query.frame_b, query.frame_a, query.step,
                0.0, raised, lowered, DIRECTIONS,
            )  # fmt: skip
        elif found == 0.0 and _is_empty(region):
            count.patches = middle
        else:
            # Without a second length a plane across a normal of A separates the bodies.
            by_first, by_second = _rates(way_out, found) if found > 0.0 else (0.0, 0.0)
            shorter = way_out - by_first * way_out - by_second * found
            by_first, by_second = 1.0 - part * (1.0 - by_first), part * by_second
            total = by_first * way_out + by_second * found
            _scale_weights(space.manifold, first, middle, by_first * total / way_out)
            if by_second > 0.0:
                _scale_weights(space.manifold, middle, count.patches, by_second * total / found)
            else:
                count.patches = middle
            for k in range(6):
                rest_out[k] = by_first * rest_out[k] + by_second * rest[k] - shorter * spread[k]
            way_out = total
    return way_out
