"""The directions in which the tool may leave a body: their normals, regions and depths.

The overlap region of the two smooth bodies is integrated for each of six directions of the body's
frame (`overlap_region`). A direction with an overlap has a normal, the mean of the body's facet
normals weighted by the overlap, and a depth (`direction_depth`).

Deep in a body there are up to six directions, but the way out often depends on one or two of them.
The depths of the others are only bounded: if the way out is the same with them at either bound, and
without them, they are not searched.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity._core.records import clear_record
from asperity.contact.broad_phase.facet_bvh import DIRECTIONS
from asperity.contact.broad_phase.facet_pairs import are_convex
from asperity.contact.manifold.convex_regions import fill_presences
from asperity.contact.manifold.direction_depth import DirectionTask, search_direction
from asperity.contact.manifold.mean_normal import fill_mean_normal
from asperity.contact.manifold.records import MAX_DIRECTIONS, MAX_PARTS
from asperity.contact.manifold.residual import fill_residuals
from asperity.contact.response.mesh_choices import is_narrow, is_wide
from asperity.contact.response.mesh_way_out import depends_on_deferred


@inner_kernel
def _next_direction(reach, space):
    """Return the unvisited direction with the largest volume over squared depth; -1 for none."""
    first, most = -1, 0.0
    for d in range(DIRECTIONS):
        sums = space.region.sums[d]
        if sums.volume > 0.0 and not space.directions[d].visited:
            size = sums.volume / (sums.deepest + reach) ** 2
            if size > most:
                first, most = d, size
    return first


@small_kernel
def _may_count(direction):
    """Return whether a direction has been searched and counts, or is deferred."""
    return direction.patches > 0 or direction.is_deferred


@inner_kernel
def _ensure_residuals(table, query, count, c, space):
    """Fill the residuals after leaving by direction `c`, unless they are filled."""
    if space.directions[c].known == 0:
        space.directions[c].known = 1
        fill_residuals(table, query, count, c, space)


@inner_kernel
def _resolves_all(table, query, count, c, space):
    """Return whether direction `c` counts, and leaving by it resolves all others."""
    if not is_wide(c, query.raised, space):
        return False
    _ensure_residuals(table, query, count, c, space)
    for d in range(DIRECTIONS):
        if d != c and space.region.sums[d].volume > 0.0 and space.residuals.value[d, c] > 0.0:
            return False
    return True


@inner_kernel
def _is_redundant(table, query, count, d, space):
    """Return whether another direction resolves all, and `d` resolves no part of that one.

    Then each choice with `d` includes that direction too, and has no weight
    (`response.mesh_way_out`), provided that no other direction resolves a part of it either.
    """
    for c in range(DIRECTIONS):
        if _may_count(space.directions[c]) and _resolves_all(table, query, count, c, space):
            _ensure_residuals(table, query, count, d, space)
            if space.residuals.value[c, d] == 1.0 and _is_independent(
                table, query, count, c, space
            ):
                return True
    return False


@inner_kernel
def _is_independent(table, query, count, c, space):
    """Return whether no other direction resolves any part of direction `c`."""
    for e in range(DIRECTIONS):
        direction = space.directions[e]
        is_out = direction.visited == 1 and not _may_count(direction)
        if e == c or space.region.sums[e].volume == 0.0 or is_out:
            continue
        if direction.known == 0:
            fill_mean_normal(table, count, e, space.region, direction.normal)
            _ensure_residuals(table, query, count, e, space)
        if space.residuals.value[c, e] < 1.0:
            return False
    return True


@small_kernel
def _is_remembered(memory, query, d):
    """Return whether a deepest point of the direction is known from the last tick."""
    for part in range(MAX_PARTS):
        x = memory.guess[query.body, query.offset + d, part, 0]
        if x == x:
            return True
    return False


@small_kernel
def _shallowest_deferred(directions):
    """Return the deferred direction with the least lower bound of its depth; -1 if none is left."""
    first = -1
    for d in range(DIRECTIONS):
        direction = directions[d]
        if direction.is_deferred and (first < 0 or direction.lowest < directions[first].lowest):
            first = d
    return first


@inner_kernel
def _fill_all_residuals(table, query, count, space):
    """Fill the residuals of all directions, if more than one may count."""
    number = 0
    for c in range(DIRECTIONS):
        number += _may_count(space.directions[c])
    for c in range(DIRECTIONS if number > 1 else 0):
        if _may_count(space.directions[c]):
            _ensure_residuals(table, query, count, c, space)


@inner_kernel
def _search(model, parameters, query, which, memory, space, workspace):
    """Search a direction's depth; `which` is its number and the number of facet pairs.

    If it is not the first, was not in contact in the last tick and is not deferred yet, it is only
    searched for a moment. Returns whether it separates two convex bodies.
    """
    d, count = which
    direction, is_first = space.directions[d], True
    for c in range(DIRECTIONS):
        is_first = is_first and not _may_count(space.directions[c])
    # The load under which a stiffness map is searched has no bounds.
    is_bounded = workspace.search[0].usual == 0.0
    is_trial = is_bounded and not is_first and not direction.is_deferred
    is_trial = is_trial and not _is_remembered(memory, query, d)
    are_solid = are_convex(model.facets, query.first, query.second)
    task = DirectionTask(d, count, math.inf, -1 if are_solid else d, is_trial)
    search_direction(model, parameters, query, task, memory, space, workspace)
    return are_solid and direction.depth == 0.0 and not direction.is_deferred


@inner_kernel
def _clear_directions(query, are_solid, space):
    """Clear directions and residuals; fill the presences of convex bodies."""
    found = space.residuals
    for d in range(MAX_DIRECTIONS):
        clear_record(space.directions[d])
        space.directions[d].presence = 1.0
    space.choices.are_solid[0] = are_solid
    if are_solid:
        fill_presences(query, space.region, space.directions)
    for d in range(DIRECTIONS):
        for c in range(DIRECTIONS):
            found.value[d, c] = np.nan
            found.slope[d, c] = found.rate[d, c] = 0.0


@inner_kernel
def search_directions(model, parameters, query, count, memory, space, workspace):
    """Fill depths and residuals of all directions that count; return whether the bodies may touch.

    The widest and shallowest overlap comes first. A direction is left out, its `patches` 0, where
    one that every choice includes resolves all. Those whose depths are only bounded are searched at
    the end, as far as the way out depends on them.

    Parameters
    ----------
    model : MeshModel
    parameters : ForceParameters
    query : BodyQuery
    count : int
        Number of facet pairs.
    memory : MeshMemory
        Only read.
    space : FacetSpace
    workspace : Workspace
    """
    table, directions = model.facets, space.directions
    _clear_directions(query, are_convex(table, query.first, query.second), space)
    d = _next_direction(query.raised, space)
    while d >= 0:
        direction = directions[d]
        direction.visited = True
        if direction.presence > 0.0 and not is_narrow(d, query.raised, space):
            fill_mean_normal(table, count, d, space.region, direction.normal)
            if not _is_redundant(table, query, count, d, space):
                if _search(model, parameters, query, (d, count), memory, space, workspace):
                    return False
                is_free = direction.patches > 0 and direction.depth == 0.0
                if is_free and _resolves_all(table, query, count, d, space):
                    return True  # without any motion
        d = _next_direction(query.raised, space)
    _fill_all_residuals(table, query, count, space)
    d = _shallowest_deferred(directions)
    while d >= 0 and depends_on_deferred(query.raised, space):
        if _search(model, parameters, query, (d, count), memory, space, workspace):
            return False
        d = _shallowest_deferred(directions)
    return True
