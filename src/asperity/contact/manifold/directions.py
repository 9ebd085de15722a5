"""The directions in which the tool may leave a body: their normals, regions and depths.

The overlap region of the two smooth bodies is integrated for each of six directions of the body's
frame (`overlap_region`). A direction with an overlap has a normal, the mean of the body's facet
normals weighted by the overlap, and one to four patches (`split`), whose depths are searched
(`narrow_phase`). The direction's depth is their root mean square, so that its patches have the
total stiffness k.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel
from asperity._core.records import clear_record
from asperity._core.stack import stack_array
from asperity.contact.broad_phase.facet_bvh import DIRECTIONS
from asperity.contact.broad_phase.facet_pairs import are_convex
from asperity.contact.manifold.convex_regions import fill_presences
from asperity.contact.manifold.mean_normal import fill_mean_normal
from asperity.contact.manifold.properties import least_scale
from asperity.contact.manifold.records import MAX_DIRECTIONS, MAX_PARTS, MAX_PATCHES
from asperity.contact.manifold.residual import fill_residuals
from asperity.contact.manifold.separation import LONGEST
from asperity.contact.narrow_phase.geom_depth import SearchLimits, frame_round
from asperity.contact.narrow_phase.load import scale_of
from asperity.contact.narrow_phase.mesh_depth import SplitRegion, region_depths
from asperity.contact.narrow_phase.mesh_patches import FacetQuery
from asperity.contact.narrow_phase.penetration import may_touch
from asperity.contact.response.ways_out import RATIO
from asperity.geometry.frames import depth_tolerance, to_body, to_world

_BUDGET, _LEAST_BUDGET = 2.0, 0.05
"""Node budget of all directions of a body, and the least of one direction, in `max_nodes`."""
_RADIUS = 1.0 / 3.0
"""Default patch radius, over the width of the smaller body."""


@inner_kernel
def _patch_radius(model, parameters, query):
    """Return the radius of the parts into which a region is split [m]."""
    if parameters.patch_radius > 0.0:
        return parameters.patch_radius
    width = model.facets.width
    return _RADIUS * min(width[query.first], width[query.second])


@inner_kernel
def _fill_guesses(query, d, memory, manifold, guess_out):
    """Fill the start points of the searches of direction `d`, A's frame (4, 3) [m].

    A part without one from the last tick gets the deepest point of the same part of the deepest
    direction searched in this tick, or of that direction: between two rough bodies a search without
    a start may spend its budget far from the deepest point, and its too small depth would be the
    least one.
    """
    deepest, at = 0.0, np.int64(-1)
    for p in range(manifold.count[0].patches):
        depth = manifold.result[p].depth
        patch = manifold.patches[p]
        is_known = patch.body == query.body and patch.direction >= query.offset
        if is_known and depth > deepest:
            deepest, at = depth, p
    for part in range(MAX_PARTS):
        same = at
        if at >= 0:
            beside = at - manifold.patches[at].part + part
            if beside < manifold.count[0].patches and manifold.patches[beside].part == part:
                same = beside if manifold.result[beside].depth > 0.0 else at
        for k in range(3):
            guess_out[part, k] = memory.guess[query.body, query.offset + d, part, k]
            if at >= 0 and guess_out[part, k] != guess_out[part, k]:
                guess_out[part, k] = manifold.patches[same].guess[k]


@inner_kernel
def _search_patches(model, parameters, query, task, memory, space, workspace):
    """Search the patches of a direction, append them to the manifold, return their number."""
    d, count, ceiling, source = task
    scene, manifold = model.scene, space.manifold
    direction, frame = space.directions[d], workspace.frame
    n, world, local = stack_array((3,)), stack_array((3,)), stack_array((3, 3))
    guess = stack_array((4, 3))
    _fill_guesses(query, d, memory, manifold, guess)
    for k in range(3):
        n[k] = direction.normal[k]
    # The axes turn with B, so that the split does not depend on B's pose.
    frame_round(n, local)
    for i in range(2):
        to_world(query.frame_b, local[i], frame[i])
    to_world(query.frame_b, n, world)
    for k in range(3):
        frame[2, k] = world[k]
    facets = FacetQuery(np.int64(count), np.int64(source), n, frame, query.frame_a, query.frame_b)
    start = manifold.count[0].patches
    first = model.facets.first_surface
    surfaces = (first[query.first], first[query.second])
    tolerance = depth_tolerance(scene.textures, scene.geometry, surfaces, parameters.tolerance)
    region = SplitRegion(
        space.region.sums[d], local[0], local[1], _patch_radius(model, parameters, query), ceiling,
        guess,
    )  # fmt: skip
    # A deep pose has many directions: together they get twice the budget of one.
    left = max(
        _BUDGET * parameters.max_nodes - space.spent[0], _LEAST_BUDGET * parameters.max_nodes
    )
    limits = SearchLimits(tolerance, min(float(parameters.max_nodes), left))
    patches, has_room = region_depths(
        (scene.textures, model.facets, scene.geometry), region, facets, limits, workspace, space,
        start,
    )  # fmt: skip
    for p in range(start, start + patches):
        space.spent[0] += manifold.result[p].nodes
        if may_touch(manifold.result[p]):
            manifold.count[0].dropped += 1
    if not has_room:
        manifold.count[0].dropped += 1
    place, base = stack_array((3,)), stack_array((3,))
    for p in range(patches):
        patch = manifold.patches[start + p]
        patch.body, patch.direction = query.body, query.offset + d
        patch.part, patch.weight = p, 0.0
        for k in range(3):
            place[k] = manifold.result[start + p].point[k] - query.frame_a[k, 3]
        to_body(query.frame_a, place, patch.guess)
        for k in range(3):
            patch.normal[k] = world[k]
            place[k] = patch.base[2] * frame[2, k] - query.frame_b[k, 3]
            place[k] += patch.base[0] * frame[0, k] + patch.base[1] * frame[1, k]
        to_body(query.frame_b, place, base)
        for k in range(3):
            patch.base[k] = base[k]
    return patches


@inner_kernel
def search_direction(model, parameters, query, task, memory, space, workspace):
    """Search the depth of a direction; return whether it counts.

    `task` is the direction's number, the number of facet pairs, the depth above which the direction
    does not count [m], and the direction whose facets are searched, -1 for all.
    """
    manifold, direction = space.manifold, space.directions[task[0]]
    if manifold.count[0].patches + MAX_PARTS > MAX_PATCHES:
        manifold.count[0].dropped += 1
        return False
    direction.first = manifold.count[0].patches
    direction.patches = _search_patches(model, parameters, query, task, memory, space, workspace)
    square = 0.0
    for p in range(direction.first, direction.first + direction.patches):
        result = manifold.result[p]
        square += (scale_of(result) * max(result.depth, 0.0)) ** 2
    direction.depth = math.sqrt(square / direction.patches)
    # Facets that overlap along their own normals may be side by side along the mean normal.
    is_none = square == 0.0 and space.region.sums[task[0]].deepest > query.lowered
    if is_none or direction.depth > task[2]:
        direction.patches = 0
        return False
    manifold.count[0].patches += direction.patches
    return True


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


@inner_kernel
def _ensure_residuals(table, query, count, c, space):
    """Fill the residuals after leaving by direction `c`, unless they are filled."""
    if space.directions[c].known == 0:
        space.directions[c].known = 1
        fill_residuals(table, query, count, c, space)


@inner_kernel
def _is_resolved_by_each(table, query, count, d, space):
    """Return whether each searched direction resolves `d`: leaves no residual of it."""
    for c in range(DIRECTIONS):
        if space.directions[c].patches > 0:
            _ensure_residuals(table, query, count, c, space)
            if space.residuals.value[d, c] > 0.0:
                return False
    return True


@inner_kernel
def _resolves_all(table, query, count, c, space):
    """Return whether leaving by direction `c` resolves all others."""
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
        if space.directions[c].patches > 0 and _resolves_all(table, query, count, c, space):
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
        is_out = direction.visited == 1 and direction.patches == 0
        if e == c or space.region.sums[e].volume == 0.0 or is_out:
            continue
        if direction.known == 0:
            fill_mean_normal(table, count, e, space.region, direction.normal)
            _ensure_residuals(table, query, count, e, space)
        if space.residuals.value[c, e] < 1.0:
            return False
    return True


@inner_kernel
def search_directions(model, parameters, query, count, memory, space, workspace):
    """Fill depths and residuals of all directions that count; return their number.

    The widest and shallowest overlap comes first. A direction is skipped, its `patches` 0, where
    no choice with it has weight: it is too deep and each searched direction resolves it; or a
    direction that every choice includes resolves all.

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
    table, found = model.facets, space.residuals
    soft = least_scale(table, query, parameters.stiffness)
    are_solid = are_convex(table, query.first, query.second)
    for d in range(MAX_DIRECTIONS):
        clear_record(space.directions[d])
        space.directions[d].presence = 1.0
    if are_solid:
        fill_presences(query, space.region, space.directions)
    for d in range(DIRECTIONS):
        for c in range(DIRECTIONS):
            found.value[d, c] = np.nan
            found.slope[d, c] = found.rate[d, c] = found.whole[d, c] = 0.0
    searched, least = 0, np.inf
    d = _next_direction(query.raised, space)
    while d >= 0:
        direction = space.directions[d]
        direction.visited = 1
        most, deepest = math.inf, space.region.sums[d].deepest
        if searched > 0 and _is_resolved_by_each(table, query, count, d, space):
            # A region cut off at the limit need not be searched: see `mesh_manifold`.
            most = RATIO * (LONGEST if deepest < query.limit else 1.0) * least
        is_near = deepest - query.lowered <= most / soft
        is_near = is_near and direction.presence > 0.0
        if is_near:
            fill_mean_normal(table, count, d, space.region, direction.normal)
            is_near = not _is_redundant(table, query, count, d, space)
        task = (d, count, most, -1 if are_solid else d)
        counts = is_near and search_direction(
            model, parameters, query, task, memory, space, workspace
        )
        if are_solid and is_near and direction.depth == 0.0:
            return 0  # a plane separates them
        if counts:
            searched += 1
            if direction.presence == 1.0:
                least = min(least, direction.depth)
            if direction.depth == 0.0 and _resolves_all(table, query, count, d, space):
                break
        d = _next_direction(query.raised, space)
    for c in range(DIRECTIONS if searched > 1 else 0):
        if space.directions[c].patches > 0:
            _ensure_residuals(table, query, count, c, space)
    return searched
