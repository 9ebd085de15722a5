"""Depths of one contact direction between meshes: candidates, sub-regions, searches."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import clear, inner_kernel, kernel, separate_kernel, small_kernel
from asperity._core.records import clear_record, copy_record
from asperity._core.stack import stack_array
from asperity.contact.broad_phase.facet_pairs import (
    PairLimits,
    least_cosine,
    overlapping_facet_pairs,
    relative_transform,
)
from asperity.contact.manifold.overlap_region import clip_pair
from asperity.contact.manifold.split import bound_by, split_lines
from asperity.contact.narrow_phase.best_first import ascend_from_last, best_first_search
from asperity.contact.narrow_phase.geom_depth import frame_round
from asperity.contact.narrow_phase.incumbent import SAME_POINT, TIE, begin_search
from asperity.contact.narrow_phase.line_rates import fill_line_rates
from asperity.contact.narrow_phase.load import (
    FOUND,
    MOST_SEARCHES,
    raise_load,
    settle_load,
)
from asperity.contact.narrow_phase.mesh_patches import (
    CandidateFilter,
    FacetQuery,
    collect_candidates,
    list_pairs,
)
from asperity.contact.narrow_phase.penetration import fill_penetration
from asperity.contact.narrow_phase.warm_start import (
    SubRegions,
    bound_under_load,
    cull_pairs,
    distances_from_lines,
    fill_known_depths,
)

_ANYWHERE = 1e3
"""Distance that no pair of facets exceeds [m]."""


class SplitRegion(NamedTuple):
    """The overlap region of one direction, to be split into sub-regions."""

    sums: np.void
    """Integrals over the region, an `OVERLAP_SUMS` record."""
    axis_u: NDArray[np.float64]
    """Axes of the tangent plane, B's frame, (3,)."""
    axis_v: NDArray[np.float64]
    radius: float
    """How far sub-regions extend beyond the lines that split the region [m]."""
    ceiling: float
    """Depth above which a direction does not count, so that its search may end [m]."""
    guess: NDArray[np.float64]
    """Last deepest points of the sub-regions in A's frame, nan if unknown, (4, 3)."""


@inner_kernel
def _fill_sub_regions(region, query, lines, regions):
    """Fill the lines that split a region, and side and start point of each sub-region.

    Returns whether the first and the second line split it.
    """
    first, second = split_lines(region.sums, region.axis_u, region.axis_v, region.radius, lines)
    frame, body = query.frame, query.frame_b
    off_u = off_v = 0.0
    for k in range(3):
        off_u += frame[0, k] * body[k, 3]
        off_v += frame[1, k] * body[k, 3]
    for k in range(2):
        lines[k, 2] -= lines[k, 0] * off_u + lines[k, 1] * off_v
    columns, rows = (2 if first else 1), (2 if second else 1)
    for p in range(columns * rows):
        u, v = _in_contact_frame(region.guess[p], frame, query.frame_a)
        regions.point[p, 0], regions.point[p, 1] = u, v
        regions.side[p, 0] = _side(first, p % columns)
        regions.side[p, 1] = _side(second, p // columns)
    return first, second


@small_kernel
def _side(is_split, half):
    """Return the side of a line on which a sub-region is, 1 or -1; 0 if it does not split."""
    return (1.0 if half == 0 else -1.0) if is_split else 0.0


@inner_kernel
def _in_contact_frame(point, frame, body):
    """Return (u, v) in the contact frame of a point given in a body's frame."""
    u = v = 0.0
    for i in range(3):
        world = body[i, 3]
        for k in range(3):
            world += body[i, k] * point[k]
        u += frame[0, i] * world
        v += frame[1, i] * world
    return u, v


@inner_kernel
def _begin_search(search, max_nodes, culled, ceiling):
    """Begin a search for positive depths; pairs with bounds up to `culled` were culled [m]."""
    begin_search(search, max_nodes, 0.0)
    search.upper_bound, search.ceiling = culled, ceiling


@inner_kernel
def _is_known_too_deep(depths, number, ceiling, results_out):
    """Return whether the root mean square of the known depths is above the ceiling; fill them."""
    square = 0.0
    for p in range(number):
        square += max(depths[p], 0.0) ** 2
    if not square > number * ceiling * ceiling:
        return False
    for p in range(number):
        clear_record(results_out[p])
        results_out[p].depth = depths[p]
    return True


@inner_kernel
def _find_single_deepest(memory, stride, lines):
    """Return whether a single point is deepest, and its distances from the lines [m].

    Ties of facets that share a corner or an edge may be at one point.
    """
    search, best, is_single = memory.search[0], memory.search[0].best, True
    for t in range(search.tie_count):
        tie = search.ties[t]
        if tie.f >= search.incumbent - TIE:
            off = abs(tie.point[0] - best.point[0]) + abs(tie.point[1] - best.point[1])
            is_single = is_single and tie.weight == 0.0 and off < SAME_POINT
    if not is_single:
        return False, 0.0, 0.0
    a, b = memory.patches_a[best.pair // stride], memory.patches_b[best.pair % stride]
    first, second = distances_from_lines(a, b, best, lines)
    return True, first, second


@small_kernel
def _limit_to_sub_region(memory, made_b, lines, side_1, side_2, radius):
    """Add the lines that bound a sub-region to the borders of B's patches; return their number."""
    added = np.int64(0)
    for k in range(2):
        sign = side_1 if k == 0 else side_2
        if sign != 0.0:
            l_u, l_v, l_0 = sign * lines[k, 0], sign * lines[k, 1], sign * lines[k, 2]
            for b in range(made_b):
                bound_by(memory.patches_b[b], l_u, l_v, l_0, radius)
            added += 1
    return added


@inner_kernel
def _search_under_load(textures, stride, count, start, limits, memory, queue):
    """Search a region of two bodies, one with a stiffness map.

    `start` is (u, v) of the last deepest point, nan if unknown, and its row of `SubRegions.found`,
    which is changed.
    """
    search, nodes, (guess, found) = memory.search[0], 0.0, start
    search.load = 0.0
    for turn in range(1 + MOST_SEARCHES):
        bound_under_load(textures, count, stride, memory)
        _begin_search(search, limits.max_nodes, 0.0, math.inf)
        if turn > 0:
            search.incumbent = -math.inf  # the largest lowered overlap is about 0
        ascend_from_last(textures, stride, count, found, memory)
        best_first_search(
            textures, stride, count, guess, limits.tolerance, memory, queue, np.int64(0)
        )
        nodes += search.nodes
        if search.best.pair < 0:
            break
        is_found = abs(search.incumbent) <= FOUND or search.nodes >= search.node_limit
        if turn > 0 and (is_found or turn == MOST_SEARCHES):
            settle_load(textures, stride, memory)
            break
        raise_load(textures, stride, memory)
        at = search.at
        guess = (at.point[0], at.point[1])
        found[0], found[1], found[2] = search.best.pair, at.x, at.y
    search.nodes = nodes


@separate_kernel
def region_depths(model, region, query, limits, memory, space, first):
    """Search the sub-regions of one direction; fill rows of `space.manifold` from `first` on.

    Fills a `PENETRATION` record for each, and `line_rate` and `base` of its `MESH_PATCH`. Returns
    the number of sub-regions, 1, 2 or 4, and whether there was room for all facets. A sub-region
    without contact has a depth of -inf. A direction that is deeper than its ceiling is not searched
    to the end: its depths are lower bounds.

    Parameters
    ----------
    model : tuple (Textures, FacetTable, Geometry)
    region : SplitRegion
    query : FacetQuery
    limits : SearchLimits
    memory : Workspace
    space : FacetSpace
    first : int
        Row of the manifold.
    """
    (textures, _, _), (tolerance, max_nodes), lines = model, limits, space.lines
    results_out, patches_out = space.manifold.result[first:], space.manifold.patches[first:]
    search, stride, n = memory.search[0], memory.patches_b.shape[0], query.frame[2]
    points, sides, depths = stack_array((4, 2)), stack_array((4, 2)), stack_array((4,))
    found = stack_array((4, 3))
    regions = SubRegions(points, sides, depths, found, region.radius)
    split_1, split_2 = _fill_sub_regions(region, query, lines, regions)
    number = np.int64((2 if split_1 else 1) * (2 if split_2 else 1))
    none = np.int64(0)
    listed = list_pairs(model, query, space)
    # First the few facets at the last deepest points: their depths rule out most others.
    criteria = CandidateFilter(listed, none, none, -math.inf, points, number)
    count, made_a, made_b, had_room = collect_candidates(model, query, criteria, memory, space)
    fill_known_depths(textures, count, stride, regions, number, lines, memory)
    best, least = none, depths[0]
    for p in range(1, number):
        least = min(least, depths[p])
        best = p if depths[p] > depths[best] else best
    # With a stiffness map, the point of largest energy need not be the deepest.
    has_map = search.usual > 0.0
    if not has_map and _is_known_too_deep(depths, number, region.ceiling, results_out):
        return number, had_room
    culled = 0.0 if has_map else max(least, 0.0)
    criteria = CandidateFilter(listed, made_a, made_b, culled, points, none)
    count, made_a, made_b, has_room = collect_candidates(model, query, criteria, memory, space)
    has_room = has_room and had_room
    count = cull_pairs(textures, count, stride, culled, memory)
    # The deepest point of all is also that of each sub-region which contains it.
    # If one of m patches is sqrt(m) times as deep as the ceiling, their root mean square is above.
    ceiling = math.inf if has_map else region.ceiling * math.sqrt(float(number))
    guess = (points[best, 0], points[best, 1])
    if has_map:
        start = (guess, found[best])
        _search_under_load(textures, stride, count, start, limits, memory, space.queue)
    else:
        _begin_search(search, float(max_nodes), culled, ceiling)
        ascend_from_last(textures, stride, count, found[best], memory)
        best_first_search(textures, stride, count, guess, tolerance, memory, space.queue, none)
    fill_penetration(textures, stride, n, tolerance, memory, results_out[0])
    clear(patches_out[0].line_rate)
    if number == 1 or results_out[0].depth == -math.inf or results_out[0].depth > ceiling:
        search.load = 0.0
        return 1, has_room
    single, at_1, at_2 = _find_single_deepest(memory, stride, lines)
    for p in range(number - 1, -1, -1):
        side_1, side_2 = sides[p, 0], sides[p, 1]
        if single and side_1 * at_1 >= -region.radius and side_2 * at_2 >= -region.radius:
            copy_record(results_out[p], results_out[0])
            if p > 0:
                results_out[p].nodes = 0.0  # counted once
            clear(patches_out[p].line_rate)
            continue
        added = _limit_to_sub_region(memory, made_b, lines, side_1, side_2, region.radius)
        guess = (points[p, 0], points[p, 1])
        if has_map:
            start = (guess, found[p])
            _search_under_load(textures, stride, count, start, limits, memory, space.queue)
        else:
            _begin_search(search, max_nodes, culled, math.inf)
            ascend_from_last(textures, stride, count, found[p], memory)
            best_first_search(textures, stride, count, guess, tolerance, memory, space.queue, added)
        fill_penetration(textures, stride, n, tolerance, memory, results_out[p])
        fill_line_rates(stride, sides[p], added, memory, patches_out[p])
        for b in range(made_b):
            memory.patches_b[b].border_count -= added
    search.load = 0.0
    return number, has_room


@kernel
def facets_along(model, frames, n, overlap, limits, memory, space, result_out):
    """Fill one `PENETRATION` record with the depth of body 0 in body 1 along `n`.

    Only facets with a smooth overlap below `overlap` [m] count. `model` has the textures, the facet
    table and the geometry; `frames` those of the bodies, (3, 4) each. Returns whether there was
    room for all facets.
    """
    (textures, table, _), (body_a, body_b) = model, frames
    tolerance, max_nodes = limits
    frame, search, region = memory.frame, memory.search[0], space.region
    facets, transform, local = region.facets, stack_array((3, 4)), stack_array((3,))
    relative_transform(body_a, body_b, transform)
    pair_limits = PairLimits(overlap, _ANYWHERE, overlap, least_cosine(table, 0, 1))
    count = overlapping_facet_pairs(table, 0, 1, transform, pair_limits, facets)
    kept = 0
    for i in range(count):
        f, g = facets.pairs[i, 0], facets.pairs[i, 1]
        if clip_pair(table, f, g, overlap, _ANYWHERE, overlap, region)[1] >= 0:
            facets.pairs[kept, 0], facets.pairs[kept, 1] = f, g
            kept += 1
    for i in range(3):
        local[i] = 0.0
        for k in range(3):
            local[i] += body_b[k, i] * n[k]
    frame_round(n, frame)
    query = FacetQuery(np.int64(kept), np.int64(-1), local, frame, body_a, body_b)
    none, stride = np.int64(0), memory.patches_b.shape[0]
    listed = list_pairs(model, query, space)
    criteria = CandidateFilter(listed, none, none, -math.inf, stack_array((4, 2)), none)
    count, _, _, has_room = collect_candidates(model, query, criteria, memory, space)
    count = cull_pairs(textures, count, stride, -math.inf, memory)
    begin_search(search, float(max_nodes), -math.inf)
    guess = (np.nan, np.nan)
    best_first_search(textures, stride, count, guess, tolerance, memory, space.queue, np.int64(0))
    fill_penetration(textures, stride, n, tolerance, memory, result_out[0])
    return has_room and facets.state[0].dropped == 0
