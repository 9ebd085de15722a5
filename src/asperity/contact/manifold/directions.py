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

from asperity._core.kernels import clear, inner_kernel
from asperity._core.records import clear_record
from asperity._core.stack import stack_array
from asperity.contact.broad_phase.facet_bvh import DIRECTIONS
from asperity.contact.broad_phase.facet_pairs import facing_cosine, flattest
from asperity.contact.manifold.inside import is_across_cavity
from asperity.contact.manifold.mean_normal import fill_mean_normal
from asperity.contact.manifold.overlap_region import (
    add_piece,
    clip_depth,
    clip_pair,
    clip_piece,
    corner_slope,
    deepest_corner,
)
from asperity.contact.manifold.properties import least_scale
from asperity.contact.manifold.records import MAX_DIRECTIONS, MAX_PARTS, MAX_PATCHES
from asperity.contact.manifold.residual import fill_residuals
from asperity.contact.manifold.separation import LONGEST
from asperity.contact.narrow_phase.geom_depth import SearchLimits, frame_round
from asperity.contact.narrow_phase.load import scale_of
from asperity.contact.narrow_phase.mesh_depth import SplitRegion, region_depths
from asperity.contact.narrow_phase.mesh_patches import FacetQuery
from asperity.contact.narrow_phase.penetration import may_touch
from asperity.contact.narrow_phase.steep_plane import FLATTEST
from asperity.contact.response.ways_out import RATIO
from asperity.geometry.frames import depth_tolerance, to_body, to_world

_BUDGET, _LEAST_BUDGET = 2.0, 0.05
"""Node budget of all directions of a body, and the least of one direction, in `max_nodes`."""
_RADIUS = 1.0 / 3.0
"""Default patch radius, over the width of the smaller body."""


@inner_kernel
def integrate_regions(table, query, count, thin, region):
    """Fill the integrals of all directions; keep the facet pairs that may touch, return how many.

    Pairs at a steep angle are kept for the depth search but not integrated, unless there are no
    others, as where a needle stands on a plate.

    Parameters
    ----------
    query : BodyQuery
    count : int
        Number of listed facet pairs.
    thin : float
        Overlap above which a piece may lie across a cavity [m].
    region : OverlapRegion
    """
    kept, volume = _integrate(table, query, count, thin, FLATTEST, region)
    if volume == 0.0:
        least = flattest(table, query.first, query.second)
        kept, _ = _integrate(table, query, kept, thin, least, region)
    elif thin < math.inf:
        kept = _drop_steep(table, query, kept, region)
    return kept


@inner_kernel
def _drop_steep(table, query, count, region):
    """Drop steep pairs that overlap by much more than the integrated ones; return how many remain.

    A steep facet ends where one that is less steep begins, nearly as deep. If there is none, it
    belongs to another contact, and would add its depth to this one.
    """
    kept = 0
    for i in range(count):
        f, g, volume = region.facets.pairs[i, 0], region.facets.pairs[i, 1], 0.0
        for d in range(DIRECTIONS):
            volume += region.volumes[i, d]
        if volume == 0.0 and facing_cosine(table, f, g, region.facets) < FLATTEST:
            most = 0.0
            for d in range(DIRECTIONS):
                if table.shares[g, d] > 0.0:
                    most = max(most, region.sums[d].deepest)
            piece = clip_piece(table, query, f, g, region)
            if piece[1] >= 3 and deepest_corner(region, piece)[0] > RATIO * most + query.raised:
                continue
        if kept < i:
            region.facets.pairs[kept, 0], region.facets.pairs[kept, 1] = f, g
            for d in range(DIRECTIONS):
                region.volumes[kept, d] = region.volumes[i, d]
        kept += 1
    return kept


@inner_kernel
def _integrate(table, query, count, thin, least, region):
    """Integrate the pairs above a cosine; return how many are kept, and their volume."""
    sums, limit, reach, kept, total = region.sums, query.limit, query.raised, 0, 0.0
    for d in range(DIRECTIONS):
        clear_record(sums[d])
        sums[d].deepest = -np.inf
    for i in range(count):
        f, g = region.facets.pairs[i, 0], region.facets.pairs[i, 1]
        piece = clip_pair(table, f, g, reach, reach, limit, region)
        if piece[1] < 0:
            continue
        is_piece, deepest, corner = piece[1] >= 3, -np.inf, 0
        if is_piece:
            deepest, corner = deepest_corner(region, piece)
        if deepest > limit:
            piece = clip_depth(region, piece, limit)
            if piece[1] < 3:  # it is beyond the limit where it is over B's facet
                continue
            deepest, corner = deepest_corner(region, piece)
        solid = max(reach, table.thickness[g])
        if deepest > min(thin, solid) and is_across_cavity(table, f, g, piece, query, region):
            continue
        region.facets.pairs[kept, 0], region.facets.pairs[kept, 1] = f, g
        volumes = region.volumes[kept]
        kept += 1
        clear(volumes)
        if not is_piece or facing_cosine(table, f, g, region.facets) < least:
            continue
        for d in range(DIRECTIONS):
            share = table.shares[g, d]
            if share == 0.0:
                continue
            volumes[d] = add_piece(table, g, piece, reach, share, region, sums[d])
            total += volumes[d]
            if deepest > sums[d].deepest:
                _store_deepest(table, (f, g), piece, corner, region, sums[d])
    return kept, total


@inner_kernel
def _store_deepest(table, pair, piece, corner, region, sums):
    """Store a corner of a piece as the deepest point of the smooth bodies."""
    f, g = pair
    p = region.polygon[piece[0], corner]
    sums.deepest = p[2]
    for k in range(3):
        place = table.origin[g, k] + p[0] * table.axes[g, 0, k] + p[1] * table.axes[g, 1, k]
        sums.deepest_point[k] = place - p[2] * table.axes[g, 2, k]
    corner_slope(table, f, g, piece, corner, region, sums.deepest_slope)


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

    A part without one from the last tick gets the deepest point of the directions searched in this
    tick: between two rough bodies a search without a start may spend its budget far from the
    deepest point, and its too small depth would be the least one.
    """
    deepest, at = 0.0, np.int64(-1)
    for p in range(manifold.count[0].patches):
        depth = manifold.result[p].depth
        if manifold.patches[p].body == query.body and depth > deepest:
            deepest, at = depth, p
    for part in range(MAX_PARTS):
        for k in range(3):
            guess_out[part, k] = memory.guess[query.body, d, part, k]
            if at >= 0 and guess_out[part, k] != guess_out[part, k]:
                guess_out[part, k] = manifold.patches[at].guess[k]


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
        patch.body, patch.direction, patch.part, patch.weight = query.body, d, p, 0.0
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
    for d in range(MAX_DIRECTIONS):
        clear_record(space.directions[d])
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
        if is_near:
            fill_mean_normal(table, count, d, space.region, direction.normal)
            is_near = not _is_redundant(table, query, count, d, space)
        task = (d, count, most, d)
        if is_near and search_direction(model, parameters, query, task, memory, space, workspace):
            searched += 1
            least = min(least, direction.depth)
            if direction.depth == 0.0 and _resolves_all(table, query, count, d, space):
                break
        d = _next_direction(query.raised, space)
    for c in range(DIRECTIONS if searched > 1 else 0):
        if space.directions[c].patches > 0:
            _ensure_residuals(table, query, count, c, space)
    return searched
