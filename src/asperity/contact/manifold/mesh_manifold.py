"""The contact manifold between a tool and one body, of which at least one is a mesh.

Pairs of nearby facets give the directions in which the tool may leave the body (`directions`), the
part of each overlap that remains after leaving by another (`residual`), and the way out s
(`response.mesh_way_out`). The energy is k s^2 / 2, a function of the pose alone: memory of the
last tick only sets where searches start and the first limit on the overlap of facets.

The gradient of s has two parts. The part through the depths acts at the patches: with delta_p the
depths of the m patches of a direction and delta their root mean square, patch p has the weight

    w_p = s ds/d(delta) / (m delta),      force_p = k w_p delta_p m_p

(with a stiffness map k_p, delta_p is scaled by sqrt(k_p / k), and w_p by k_p / k).

The rest is through normals, the lines that split regions, and residuals. Its rates follow from
integrals over the overlap region, in one pass over its pieces (`region_gradient`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import clear, inner_kernel
from asperity._core.stack import stack_array
from asperity.contact.broad_phase.facet_bvh import DIRECTIONS
from asperity.contact.broad_phase.facet_pairs import (
    are_convex,
    half_diagonal,
    least_cosine,
    overlapping_facet_pairs,
    pair_limits,
    relative_transform,
)
from asperity.contact.broad_phase.neighbour_list import RelativePose, neighbour_pairs
from asperity.contact.manifold.convex_regions import add_presence_rates
from asperity.contact.manifold.directions import search_directions
from asperity.contact.manifold.inside import WALL
from asperity.contact.manifold.integrals import integrate_regions
from asperity.contact.manifold.mean_normal import add_normal_rates
from asperity.contact.manifold.overlap_region import clip_piece
from asperity.contact.manifold.polyhedron_manifold import (
    add_polyhedron_rest,
    find_polyhedron_separations,
    polyhedron_way_out,
)
from asperity.contact.manifold.polyhedron_pair import is_polyhedron_pair
from asperity.contact.manifold.properties import (
    add_stiffness_rates,
    contact_properties,
    has_map,
    least_scale,
    pair_volume,
    properties_vary,
)
from asperity.contact.manifold.records import MAX_DIRECTIONS
from asperity.contact.manifold.region_gradient import add_piece_gradient, fill_polynomial
from asperity.contact.manifold.residual import add_deepest, add_residual_gradient
from asperity.contact.manifold.split import add_line_rates
from asperity.contact.narrow_phase.load import scale_of
from asperity.contact.response.mesh_way_out import fill_way_out
from asperity.contact.response.ways_out import RATIO
from asperity.geometry.frames import add_to_world, fill_origin, to_body

_LIMIT_FRACTION = 0.25
"""Least limit on the overlap of facets, over the least half side of the thinner body."""
_THINNEST = 0.02
"""Half side that a thinner body counts with, over the smaller body's width: a sheet has none."""
_LEAST_REACH = 3e-5
"""Distance over the smaller body's width at which smooth surfaces belong to the overlap region."""
_OBLIQUE = math.sqrt(3.0)
"""Largest reach of a texture of A along B's normals, over its height: at the corner of a cube."""
_SMALL_STEP = 0.1
"""A step smaller than this fraction of the limit does not raise it."""
_MAX_ROUNDS = 10
"""Maximum number of searches, each with another limit."""


class BodyQuery(NamedTuple):
    """The tool and one scene body at one pose; positions are relative to the tool's centre.

    B, whose normals give the directions, is the body with larger plane faces, so that the energy
    does not depend on which of the two is the tool.
    """

    body: int
    """Number of the scene body."""
    first: int
    """Number of A, the tool or the body."""
    second: int
    """Number of B, the other one."""
    frame_a: NDArray[np.float64]
    """A's frame, (3, 4) [m]."""
    frame_b: NDArray[np.float64]
    """B's frame, (3, 4) [m]."""
    step: float
    """Distance that the tool has moved since the last tick [m]."""
    limit: float
    """Largest overlap of facets that is considered [m]."""
    raised: float
    """Upper bound on the height of both textures above the smooth surfaces [m]."""
    lowered: float
    """Upper bound on their depth below the smooth surfaces [m]."""
    offset: int
    """Added to the number of a direction in patches and memory: 6 if A and B are exchanged."""


@inner_kernel
def texture_reach(table, first, second):
    """Return the bounds `raised` and `lowered` of `BodyQuery` [m].

    Both are along the normals of B, to which A's texture may be oblique.
    """
    reach = _LEAST_REACH * min(table.width[first], table.width[second])
    reach += table.slack[first] + table.slack[second]
    raised, lowered = table.raised, table.lowered
    oblique = _OBLIQUE * raised[first]
    return reach + oblique + raised[second], reach + lowered[first] + lowered[second]


@inner_kernel
def in_order(table, tool, b):
    """Return the numbers of A and B: of the tool and body `b`, B has the larger plane faces."""
    if table.flat_area[tool] > table.flat_area[b]:
        return b, tool
    return tool, b


@inner_kernel
def _fill_pairs(model, query, memory, space):
    """Fill `region.facets.pairs` with the facets that may touch; return the number of pairs."""
    table, facets, transform = model.facets, space.region.facets, stack_array((3, 4))
    relative_transform(query.frame_a, query.frame_b, transform)
    size = half_diagonal(table, query.first)
    pose = RelativePose(query.first, query.second, query.body, transform, size, query.step)
    least = least_cosine(table, query.first, query.second)
    limits = pair_limits(query.limit, query.raised, least)
    if query.offset > 0:
        count = overlapping_facet_pairs(table, query.first, query.second, transform, limits, facets)
    else:
        count = neighbour_pairs(table, pose, limits, memory.lists, facets)
    if facets.state[0].dropped > 0:
        space.manifold.count[0].dropped += 1
    return count


@inner_kernel
def _find_way_out(model, parameters, query, memory, space, workspace):
    """Return the way out by facets that overlap within the limit [m], and the number of pairs."""
    table = model.facets
    size = min(half_diagonal(table, query.first), half_diagonal(table, query.second))
    count = _fill_pairs(model, query, memory, space)
    is_pair = is_polyhedron_pair(table, query)
    # Convex bodies have no cavities.
    thin = math.inf if is_pair else max(WALL * size, query.raised)
    count = integrate_regions(table, query, count, thin, space.region)
    if is_pair:
        way_out = polyhedron_way_out(model, parameters, query, count, memory, space, workspace)
        return way_out, count
    touches = search_directions(model, parameters, query, count, memory, space, workspace)
    return fill_way_out(query.raised, space) if touches else 0.0, count


@inner_kernel
def add_mesh_manifold(model, parameters, query, overlap, memory, space, workspace, rest_out):
    """Append the patches between the tool and one body to `space.manifold`, with their weights.

    Parameters
    ----------
    model : MeshModel
    parameters : ForceParameters
    query : BodyQuery
        Its limit is ignored.
    overlap : float
        Overlap that MuJoCo finds [m]: without memory of the last tick, the limit is raised to it
        until a way out is found.
    memory : MeshMemory
        Only the neighbour lists are written.
    space : FacetSpace
    workspace : Workspace
    rest_out : (6,) array
        The part of the way out's gradient that does not act at the patches, by the tool's
        translation and rotation, world axes; includes that of the stiffness, where it varies.

    Returns
    -------
    float
        The way out [m]; 0 where there is no contact.
    float
        The limit on the overlap that was needed [m].
    int
        Number of facet pairs.
    """
    first, dropped = space.manifold.count[0].patches, space.manifold.count[0].dropped
    size = half_diagonal(model.facets, query.first) + half_diagonal(model.facets, query.second)
    limit, way_out, count = _first_limit(model, memory, query, overlap), 0.0, 0
    here, least = query, _least_limit(model, query)
    usual = parameters.stiffness
    soft = least_scale(model.facets, query, usual)
    is_pair = is_polyhedron_pair(model.facets, query)
    clear(rest_out)
    if is_pair:
        deep, limit = find_polyhedron_separations(model.facets, query, usual, space), 4.0 * least
        if deep == 0.0:
            return 0.0, limit, count
        while limit < deep:
            limit *= 2.0
    workspace.search[0].usual = 1.0 / usual if has_map(model.facets, query) else 0.0
    too_low = 0.0
    for _ in range(_MAX_ROUNDS):
        space.spent[0] = 0.0  # discarded rounds do not reduce the budget of the last one
        space.manifold.count[0].patches, space.manifold.count[0].dropped = first, dropped
        here = BodyQuery(
            query.body, query.first, query.second, query.frame_a, query.frame_b, query.step,
            limit, query.raised, query.lowered, query.offset,
        )  # fmt: skip
        way_out, count = _find_way_out(model, parameters, here, memory, space, workspace)
        if is_pair:
            break
        wanted = RATIO * way_out / soft + query.lowered
        is_new = memory.known[query.body] == 0
        if is_new and way_out == 0.0 and limit < min(RATIO * overlap + query.lowered, size):
            wanted = 2.0 * limit
        if wanted > limit:
            too_low = limit
            limit *= 2.0
        elif wanted <= 0.5 * limit and limit > max(least, 2.0 * too_low) and way_out > 0.0:
            limit *= 0.5
        else:
            break
    if way_out == 0.0:
        return 0.0, limit, count
    b, table = query.body, model.facets
    space.stiffness[b], space.friction[b] = contact_properties(
        table, here, count, parameters, space.region
    )
    _fill_weights(here, space, way_out, rest_out)
    if is_pair:
        add_polyhedron_rest(table, here, count, parameters, way_out, space, rest_out)
    elif properties_vary(table, here) or _has_rest(space):
        _add_rest(table, here, count, parameters, way_out, space, rest_out)
    if query.first == query.body:
        _swap_bodies(space.manifold, first, rest_out)
    return way_out, here.limit, count


@inner_kernel
def _swap_bodies(manifold, first, rest_io):
    """Change the sign of patches from `first` on and of the rest, so that they act on B, not A."""
    for p in range(first, manifold.count[0].patches):
        patch, result = manifold.patches[p], manifold.result[p]
        for k in range(3):
            patch.normal[k] = -patch.normal[k]
            result.slope_normal[k] = -result.slope_normal[k]
            result.moment[k] = -result.moment[k]
    for k in range(6):
        rest_io[k] = -rest_io[k]


@inner_kernel
def _least_limit(model, query):
    """Return the least limit on the overlap of facets [m]: a fraction of the thinner body."""
    table, least = model.facets, np.inf
    for k in range(3):
        least = min(least, table.reach[table.root[query.first], k])
        least = min(least, table.reach[table.root[query.second], k])
    least = max(least, _THINNEST * min(table.width[query.first], table.width[query.second]))
    return _LIMIT_FRACTION * least + query.lowered


@inner_kernel
def _first_limit(model, memory, query, overlap):
    """Return the first limit on the overlap of facets [m]; `overlap` is what MuJoCo finds.

    It is the least limit times a power of two, so that the way out depends on the pose alone.
    """
    limit, farthest = _least_limit(model, query), overlap
    if memory.known[query.body] == 1:
        farthest = memory.way_out[query.body]
        # Sliding hardly ever needs a larger limit, and an unnecessary round costs a whole tick.
        if query.step > _SMALL_STEP * limit:
            farthest += query.step
    while limit < RATIO * farthest + query.lowered:
        limit *= 2.0
    return limit


@inner_kernel
def _fill_weights(query, space, way_out, rest_io):
    """Fill the weights of the patches; add the rates through normals and split lines.

    A patch whose depth shortens the way out is no contact: its gradient is part of the rest.
    """
    manifold, n, turn = space.manifold, stack_array((3,)), stack_array((3,))
    for d in range(MAX_DIRECTIONS):
        direction = space.directions[d]
        if direction.patches == 0 or direction.depth == 0.0 or direction.rate == 0.0:
            continue
        part = direction.rate / (direction.patches * direction.depth)
        for k in range(3):
            n[k] = 0.0
        for p in range(direction.first, direction.first + direction.patches):
            patch, depth = manifold.patches[p], manifold.result[p].depth
            if depth <= 0.0:
                continue
            m, moment = manifold.result[p].slope_normal, manifold.result[p].moment
            own = part * scale_of(manifold.result[p]) ** 2
            patch.weight = max(own * way_out, 0.0)
            for k in range(3):
                n[k] += own * depth * (manifold.result[p].turn[k] - depth * m[k])
                if own < 0.0:
                    rest_io[k] -= own * depth * m[k]
                    rest_io[3 + k] -= own * depth * moment[k]
            for k in range(2):
                if patch.line_rate[k] != 0.0:
                    rate = own * depth * patch.line_rate[k]
                    add_line_rates(space.region.sums[d], k, patch.base, rate, direction)
        to_body(query.frame_b, n, turn)
        for k in range(3):
            direction.turn[k] += turn[k]


@inner_kernel
def _has_rest(space):
    """Return whether the way out depends on more than the depths."""
    for d in range(DIRECTIONS):
        direction = space.directions[d]
        if direction.patches == 0:
            continue
        if direction.presence_rate != 0.0 or direction.height_rate != 0.0:
            return True
        if direction.volume_rate != 0.0 or not _is_flat(space.region.sums[d]):
            return True
        for c in range(DIRECTIONS):
            if space.residuals.rate[d, c] != 0.0:
                return True
    return False


@inner_kernel
def _is_flat(sums):
    """Return whether all facet normals of a direction are equal."""
    n = sums.normal
    square = n[0] * n[0] + n[1] * n[1] + n[2] * n[2]
    return square >= (1.0 - 1e-13) * sums.volume * sums.volume


@inner_kernel
def _add_rest(table, query, count, parameters, way_out, space, rest_io):
    """Add the rest of the gradient, that of the stiffness included, world axes."""
    region, rates = space.region, space.region.rates
    centre, gradient, q = stack_array((3,)), stack_array((6,)), stack_array((6,))
    fill_origin(query.frame_b, centre)
    clear(gradient)
    for d in range(DIRECTIONS):
        for c in range(DIRECTIONS):
            add_residual_gradient(table, query, count, (d, c), centre, space, gradient)
        if space.directions[d].height_rate != 0.0:
            add_deepest(region.sums[d], space.directions[d].height_rate, centre, gradient)
    for i in range(count):
        rates[i] = 0.0
    for d in range(DIRECTIONS):
        if space.directions[d].patches > 0 and not _is_flat(region.sums[d]):
            add_normal_rates(table, count, d, region, space.directions[d].turn, rates)
    if are_convex(table, query.first, query.second):
        add_presence_rates(table, query, count, centre, space, gradient)
    if properties_vary(table, query) and not has_map(table, query):
        stiffness = space.stiffness[query.body]
        add_stiffness_rates(table, count, parameters, stiffness, way_out, region)
    for i in range(count):
        if pair_volume(region, i) == 0.0:
            continue
        f, g = region.facets.pairs[i, 0], region.facets.pairs[i, 1]
        fill_polynomial(table, g, i, space.directions, region, q)
        is_wanted = False
        for k in range(6):
            is_wanted = is_wanted or q[k] != 0.0
        if not is_wanted:
            continue
        piece = clip_piece(table, query, f, g, region)
        if piece[1] >= 3:
            add_piece_gradient(table, (f, g), piece, query.raised, q, centre, region, gradient)
    add_to_world(query.frame_b, gradient, rest_io)


@inner_kernel
def remember(memory, b, way_out):
    """Store the state of contact with body `b` for the next tick."""
    memory.known[b] = 1
    memory.way_out[b] = way_out
    memory.in_contact[b] = way_out > 0.0
