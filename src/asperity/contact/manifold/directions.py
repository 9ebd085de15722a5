"""Directions of contact with one body: whose turn it is, which counts, and how much.

A plane may count for two directions, and across a convex edge the same overlap is seen from two
sides. So a direction has a twin, is explained by another, or counts in part; see `touch`, which
searches them.
"""

from __future__ import annotations

from asperity._core.kernels import inner_kernel
from asperity.contact.broad_phase.facet_bvh import BINS
from asperity.contact.manifold.overlap_region import MASS, MEAN, WHERE, way_out

_EXPLAINED, _OWN = 1.2, 2.0
"""A place is out, and surely not, after this many depths of the other direction."""
_ON_SURFACE = 1e-6
"""A place this deep is on the surface [m]."""
_ALIKE, _SAME = 0.75, 0.95
"""Directions whose normals agree to this cosine begin to share their part, and do share it."""

# Columns of `FacetSpace.directions`.
N, FADE, DEPTH_OF, ROWS, FIRST, PART, TWIN, VALID, MOST = 0, 3, 4, 5, 6, 7, 8, 9, 10
IS_EXPLAINED, SEEN = 11, 12  # by another direction, and so not searched; had its turn


@inner_kernel
def next_direction(memory, b, space):
    """Return the direction whose turn it is: those in contact first, then by their footprint."""
    sums, ways, first = space.footprint.sums, space.directions, -1
    for d in range(BINS):
        if ways[d, SEEN] == 1.0:
            continue
        ahead = first < 0 or memory.active[b, d] > memory.active[b, first]
        if ahead or (
            memory.active[b, d] == memory.active[b, first] and sums[d, MASS] > sums[first, MASS]
        ):
            first = d
    ways[first, SEEN] = 1.0
    return first


@inner_kernel
def is_explained(table, count, d, space):
    """Return whether another direction accounts for one that might become a contact.

    That is `weigh`'s rule before anything is searched. Contact begins near B's surface, so where
    the smooth bodies overlap most is near the deepest place. And where what counts for both does
    not touch along the one, it does not along the other.
    """
    sums, place = space.footprint.sums, space.frames[7, 0, :3]
    way = space.directions[d]
    for k in range(3):
        place[k] = sums[d, WHERE + k]
    for c in range(BINS):
        other = space.directions[c]
        if other[ROWS] == 0.0 or sums[c, MASS] < sums[d, MASS]:
            continue
        if way[0] * other[0] + way[1] * other[1] + way[2] * other[2] > _ALIKE:
            continue
        depth = _EXPLAINED * max(other[DEPTH_OF], 0.0) + _ON_SURFACE
        if way_out(table, count, c, other, place, space.footprint) <= depth:
            return True
    return False


@inner_kernel
def weigh(table, count, near_b, space):
    """Fill how much each direction counts beside the others.

    Across a convex edge the same overlap is seen from two sides. A direction does not count whose
    deepest place would be out of B if the tool were moved out along another, with a larger
    footprint, by that one's depth.
    """
    rows, sums = space.rows, space.footprint.sums
    place = space.frames[7, 0, :3]
    for d in range(BINS):
        way = space.directions[d]
        way[VALID] = 1.0
        if way[DEPTH_OF] <= 0.0 or way[ROWS] == 0.0:
            continue
        deepest = int(way[FIRST])
        for p in range(deepest, int(way[FIRST] + way[ROWS])):
            if rows.result[p].depth > rows.result[deepest].depth:
                deepest = p
        for i in range(3):
            place[i] = 0.0
            for k in range(3):
                place[i] += near_b[k, i] * (rows.result[deepest].point[k] - near_b[k, 3])
        for c in range(BINS):
            other = space.directions[c]
            if c == d or other[DEPTH_OF] <= 0.0 or other[ROWS] == 0.0:
                continue
            if sums[c, MASS] < sums[d, MASS] or (sums[c, MASS] == sums[d, MASS] and c > d):
                continue
            along = way[0] * other[0] + way[1] * other[1] + way[2] * other[2]
            if along > _SAME:
                continue  # they share their part already
            out = way_out(table, count, c, other, place, space.footprint)
            counts = (out / other[DEPTH_OF] - _EXPLAINED) / (_OWN - _EXPLAINED)
            shared = max((along - _ALIKE) / (_SAME - _ALIKE), 0.0)
            way[VALID] *= shared + (1.0 - shared) * min(max(counts, 0.0), 1.0)


@inner_kernel
def twin_of(space, sums, d):
    """Return a direction that was searched whose footprint is the same but for its share, or -1."""
    for c in range(BINS):
        if c == d or space.directions[c, ROWS] == 0.0:
            continue
        same = True
        for k in range(3):
            same = same and abs(space.directions[c, N + k] - space.directions[d, N + k]) < 1e-12
            one, two = sums[c, MEAN + k] / sums[c, MASS], sums[d, MEAN + k] / sums[d, MASS]
            same = same and abs(one - two) < 1e-12
        if same:
            return c
    return -1


@inner_kernel
def share_stiffness(space):
    """Fill the weights of a body's patches, and what is remembered of its directions."""
    rows, sums = space.rows, space.footprint.sums
    total = 0.0
    for d in range(BINS):
        way = space.directions[d]
        if way[DEPTH_OF] <= 0.0:
            continue
        way[VALID] = space.directions[int(way[TWIN]), VALID]
        alike = 0.0
        for c in range(BINS):
            other = space.directions[c]
            if other[DEPTH_OF] > 0.0:
                along = way[0] * other[0] + way[1] * other[1] + way[2] * other[2]
                alike += sums[c, MASS] * max((along - _ALIKE) / (1.0 - _ALIKE), 0.0)
        part = way[VALID] * way[DEPTH_OF] * sums[d, MASS] / alike
        space.directions[int(way[TWIN]), PART] += part
        total += part
    if total == 0.0:
        total = 1.0
    for d in range(BINS):
        way = space.directions[d]
        first, patches = int(way[FIRST]), int(way[ROWS])
        for p in range(first, first + patches):
            live = rows.result[p].depth > 0.0
            rows.weight[p] = way[FADE] * way[PART] / (total * patches) if live else 0.0
