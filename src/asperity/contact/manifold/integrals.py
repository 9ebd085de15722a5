"""The pairs of facets that overlap in a pose, and the integrals of all directions over them.

Pairs across a cavity or behind a wall (`inside`), or beyond the limit on the overlap, are left
out.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import clear, inner_kernel
from asperity._core.records import clear_record
from asperity.contact.broad_phase.facet_bvh import DIRECTIONS
from asperity.contact.broad_phase.facet_pairs import facing_cosine, flattest, pair_limits
from asperity.contact.broad_phase.neighbour_list import separation
from asperity.contact.manifold.inside import is_across_cavity
from asperity.contact.manifold.overlap_region import (
    add_piece,
    clip_depth,
    clip_pair,
    clip_piece,
    corner_slope,
    deepest_corner,
)
from asperity.contact.manifold.properties import pair_volume
from asperity.contact.narrow_phase.steep_plane import FLATTEST
from asperity.contact.response.ways_out import RATIO


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
        f, g = region.facets.pairs[i, 0], region.facets.pairs[i, 1]
        if pair_volume(region, i) == 0.0 and facing_cosine(table, f, g, region.facets) < FLATTEST:
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
    limits = pair_limits(limit, reach, 0.0)
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
        elif separation(table, f, g, limits, region.facets) > 0.0:
            continue  # listed for a motion that has not come
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
