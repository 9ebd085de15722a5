"""Verlet neighbour lists of facets, so that a tick need not traverse the BVH.

A tool moves little in a tick. Pairs of facets are therefore listed with a *skin*, a distance added
to the limits, so that a list stays valid until the tool has moved by the skin (Verlet, 1967, for
molecules). There are three lists for each body of the scene:

- the *inner list* is tested in every tick;
- the *outer list* has a skin several times as wide. The inner list is rebuilt from it about every
  ten ticks; each of its pairs has a lower bound on the motion until it can belong to the inner
  list;
- the *pending list* is the next outer list. While the current one is still valid, each tick visits
  some boxes to fill it, so that no tick waits for a full traversal.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel
from asperity._core.stack import stack_array
from asperity.contact.broad_phase.facet_bvh import FacetTable
from asperity.contact.broad_phase.facet_pairs import (
    BvhTraversal,
    facing_cosine,
    largest_displacement,
    least_cosine,
    overlapping_facet_pairs,
    pair_limits,
    place_facet,
    sphere_separation,
    traverse_bvh,
)
from asperity.contact.broad_phase.neighbour_records import (
    EMPTY,
    MAX_LISTED,
    OVERFLOWED,
    append_pair,
    copy_list,
    copy_transform,
)

_TICKS = 10.0
"""Ticks at the current speed for which an inner list should stay valid."""
_LEAST_SKIN, _MOST_SKIN = 2e-4, 1e-3
"""Range of the inner list's skin [m]."""
_LEAST_WIDTH = 2.0
"""Smallest skin of an outer list, in skins of the inner list. A pending list that overflows is
restarted with half its skin, or given up below this one."""
_WORN = 0.55
"""Fraction of the outer list's skin used up when the pending list is started."""
_PENDING_TICKS = 4.0
"""Ticks over which the pending list is filled if it takes as many visits as the last one."""


class RelativePose(NamedTuple):
    """Pose of body A in the frame of body B."""

    first: int
    """Number of A among the bodies."""
    second: int
    """Number of B."""
    row: int
    """Row of the lists: number of the body that is not the tool."""
    transform: NDArray[np.float64]
    """Rotation and translation [m] from A's frame to B's, (3, 4)."""
    size: float
    """Half the diagonal of A's bounding box [m]."""
    step: float
    """Distance that the tool has moved since the last tick [m]."""


@inner_kernel
def separation(table: FacetTable, f, g, limits, facets):
    """Return a lower bound of the motion until two facets are within `limits` [m].

    It is a separation of the facets, projected along g's normal, by a side of either, or the
    distance of their overlap from [-reach, max_depth]; 0 or less if there is none.
    """
    reach = limits.reach
    flat = stack_array((8, 2))
    o, x, y, z = table.origin[g], table.axes[g, 0], table.axes[g, 1], table.axes[g, 2]
    count = table.sides[f]
    low_x, low_y, shallowest = np.inf, np.inf, np.inf
    high_x, high_y, deepest = -np.inf, -np.inf, -np.inf
    for c in range(count):
        # Seen along B's normal, the corners of A's facet are in reverse order.
        p = facets.corners[f, count - 1 - c]
        d0, d1, d2 = p[0] - o[0], p[1] - o[1], p[2] - o[2]
        on_x = d0 * x[0] + d1 * x[1] + d2 * x[2]
        on_y = d0 * y[0] + d1 * y[1] + d2 * y[2]
        deep = -(d0 * z[0] + d1 * z[1] + d2 * z[2])
        flat[c, 0], flat[c, 1] = on_x, on_y
        low_x, high_x = min(low_x, on_x), max(high_x, on_x)
        low_y, high_y = min(low_y, on_y), max(high_y, on_y)
        shallowest, deepest = min(shallowest, deep), max(deepest, deep)
    wide_x, wide_y = table.half[g, 0] + reach, table.half[g, 1] + reach
    apart = max(shallowest - limits.max_depth, -deepest - reach)
    apart = max(apart, low_x - wide_x, -high_x - wide_x, low_y - wide_y, -high_y - wide_y)
    if apart > 0.0:
        return apart
    for r in range(table.count_rows[g]):
        row = table.rows[g, r]
        least = np.inf
        for c in range(count):
            least = min(least, row[0] + row[1] * flat[c, 0] + row[2] * flat[c, 1])
        apart = max(apart, least - reach)
    if apart > 0.0:
        return apart
    box = table.count_rows[g] == 0
    # Where the facets do not face each other, the corners are in the other order.
    turn = 1.0 if facing_cosine(table, f, g, facets) >= 0.0 else -1.0
    for c in range(count):
        after = c + 1 if c + 1 < count else 0
        out_x, out_y = turn * (flat[after, 1] - flat[c, 1]), turn * (flat[c, 0] - flat[after, 0])
        size = math.sqrt(out_x * out_x + out_y * out_y)
        base = out_x * flat[c, 0] + out_y * flat[c, 1] + size * reach
        if box:
            least = -abs(out_x) * table.half[g, 0] - abs(out_y) * table.half[g, 1]
        else:
            least = np.inf
            for k in range(table.sides[g]):
                corner = table.corners[g, k]
                least = min(least, out_x * corner[0] + out_y * corner[1])
        if least > base:
            return (least - base) / size
    return apart


@inner_kernel
def _motion_until_listed(table: FacetTable, f, g, limits, size, facets):
    """Return a lower bound of the tool's motion until a pair is within `limits` [m].

    It is 0 or less if the pair is within them. `size` is half the diagonal of the tool's bounding
    box [m].
    """
    motion = (limits.min_cosine - facing_cosine(table, f, g, facets)) * size
    motion = max(motion, sphere_separation(table, f, g, limits, facets))
    return motion if motion > 0.0 else separation(table, f, g, limits, facets)


@inner_kernel
def _rebuild_from_outer(table: FacetTable, pose, limits, lists, facets):
    """Fill the inner list with pairs of the outer one; return their number, without limit."""
    facets.state[0].tick += 1
    facets.state[0].dropped = 0
    b, outer = pose.row, lists.outer
    travelled, count = lists.travelled[b], np.int64(0)
    for i in range(outer.state[b].count):
        if travelled < outer.needed_at[b, i]:
            continue
        f, g = outer.pairs[b, i, 0], outer.pairs[b, i, 1]
        if facets.placed[f].tick != facets.state[0].tick:
            place_facet(table, f, pose.transform, facets)
        motion = _motion_until_listed(table, f, g, limits, pose.size, facets)
        outer.needed_at[b, i] = travelled + max(motion, 0.0)
        if motion <= 0.0:
            count = append_pair(lists.inner.pairs, b, count, f, g)
    return count


@inner_kernel
def _rebuild_from_bvh(table: FacetTable, pose, limits, lists, facets):
    """Fill the inner list by a full BVH traversal; return the number of pairs, without limit."""
    found = overlapping_facet_pairs(table, pose.first, pose.second, pose.transform, limits, facets)
    count = np.int64(0)
    for i in range(found):
        f, g = facets.pairs[i, 0], facets.pairs[i, 1]
        if separation(table, f, g, limits, facets) <= 0.0:
            count = append_pair(lists.inner.pairs, pose.row, count, f, g)
    return count


@inner_kernel
def _rebuild_inner(table: FacetTable, pose, limits, skin, lists, facets):
    """Rebuild the inner list for `limits` widened by `skin` [m]."""
    b = pose.row
    inner, outer = lists.inner.state[b], lists.outer.state[b]
    max_depth, reach = limits.max_depth + skin, limits.reach + skin
    least = least_cosine(table, pose.first, pose.second)
    wide = pair_limits(max_depth, reach, least - skin / pose.size)
    # A pair outside the old limits by some distance may be within the new ones once the motion of
    # the tool and the widening of the limits add up to that distance.
    wider = max(max_depth - inner.max_depth, reach - inner.reach, skin - inner.skin, 0.0)
    lists.travelled[b] += (
        largest_displacement(table, pose.first, inner.transform, pose.transform) + wider
    )
    inner.max_depth, inner.reach, inner.skin = max_depth, reach, skin
    copy_transform(pose.transform, inner.transform)
    moved = largest_displacement(table, pose.first, outer.transform, pose.transform)
    if (
        outer.count >= 0
        and moved + skin <= outer.skin
        and max_depth + moved <= outer.max_depth
        and reach + moved <= outer.reach
    ):
        count = _rebuild_from_outer(table, pose, wide, lists, facets)
    else:
        count = _rebuild_from_bvh(table, pose, wide, lists, facets)
    fits = count <= MAX_LISTED and facets.state[0].dropped == 0
    inner.count = count if fits else OVERFLOWED


@inner_kernel
def _measure_pending(table: FacetTable, pose, first, last, lists, facets):
    """Fill `needed_at` of the pending pairs from `first` to `last`."""
    b = pose.row
    inner, pending = lists.inner.state[b], lists.pending
    least = least_cosine(table, pose.first, pose.second)
    limits = pair_limits(inner.max_depth, inner.reach, least - inner.skin / pose.size)
    # Triangle inequality: the motion from here to the next rebuild is at most that from here back
    # to the last rebuild plus that from there to the next.
    moved = largest_displacement(table, pose.first, inner.transform, pose.transform)
    travelled = lists.travelled[b] - moved
    for i in range(first, last):
        f, g = pending.pairs[b, i, 0], pending.pairs[b, i, 1]
        motion = _motion_until_listed(table, f, g, limits, pose.size, facets)
        pending.needed_at[b, i] = travelled + max(motion, 0.0)


@inner_kernel
def _outer_will_last(table: FacetTable, pose, limits, skin, lists):
    """Return whether the outer list is good for some more rebuilds of the inner list."""
    outer = lists.outer.state[pose.row]
    moved = largest_displacement(table, pose.first, outer.transform, pose.transform)
    return (
        outer.count >= 0
        and moved <= _WORN * outer.skin
        and limits.max_depth + skin + moved <= outer.max_depth
        and limits.reach + skin + moved <= outer.reach
    )


@inner_kernel
def _advance_pending(table: FacetTable, pose, limits, skin, lists, facets):
    """Visit some boxes for the pending list if the outer list soon becomes invalid."""
    b = pose.row
    pending, progress = lists.pending.state[b], lists.pending_state[b]
    if progress.stack_size == OVERFLOWED or skin == 0.0:
        return
    if progress.stack_size == EMPTY:
        if _outer_will_last(table, pose, limits, skin, lists):
            return
        pending.skin = progress.width * skin
        pending.max_depth = limits.max_depth + pending.skin
        pending.reach = limits.reach + pending.skin
        pending.count, progress.stack_size, progress.visits = 0, 1, 0
        lists.stack[b, 0, 0], lists.stack[b, 0, 1] = table.root[pose.first], table.root[pose.second]
        copy_transform(pose.transform, pending.transform)
    # The list holds all pairs within its limits while the tool is within the skin of the pose where
    # it was started; relative to the current pose, the limits are wider by the motion since.
    moved = largest_displacement(table, pose.first, pending.transform, pose.transform)
    if moved > pending.skin:
        progress.stack_size, progress.expected_visits = EMPTY, 2.0 * progress.expected_visits
        return
    wide = pair_limits(
        pending.max_depth + moved, pending.reach + moved,
        least_cosine(table, pose.first, pose.second) - (pending.skin + moved) / pose.size,
    )  # fmt: skip
    visits, before = np.int64(progress.expected_visits / _PENDING_TICKS) + 1, pending.count
    traversal = BvhTraversal(lists.stack[b], progress.stack_size, lists.pending.pairs[b], before)
    stack_size, count, unused, dropped = traverse_bvh(
        table, pose.transform, wide, traversal, visits, facets
    )
    _measure_pending(table, pose, before, count, lists, facets)
    progress.visits += visits - unused
    progress.stack_size, pending.count = stack_size, count
    if dropped > 0:
        progress.width *= 0.5
        progress.stack_size = EMPTY if progress.width >= _LEAST_WIDTH else OVERFLOWED
    elif stack_size == 0:
        copy_list(lists.pending, b, count, lists.outer)
        progress.stack_size, progress.expected_visits = EMPTY, float(progress.visits)


@inner_kernel
def _facing_pairs(table: FacetTable, pose, lists, facets):
    """Fill `facets.pairs` with the facing pairs of the inner list; return their number."""
    b, inner, count = pose.row, lists.inner, np.int64(0)
    least = least_cosine(table, pose.first, pose.second)
    for i in range(inner.state[b].count):
        f, g = inner.pairs[b, i, 0], inner.pairs[b, i, 1]
        if facets.placed[f].tick != facets.state[0].tick:
            place_facet(table, f, pose.transform, facets)
        if facing_cosine(table, f, g, facets) >= least:
            facets.pairs[count, 0], facets.pairs[count, 1] = f, g
            count += 1
    return count


@inner_kernel
def neighbour_pairs(table: FacetTable, pose, limits, lists, facets):
    """Fill `facets.pairs` as `overlapping_facet_pairs` does, mostly from the neighbour lists.

    The result has all pairs of facets with an overlap between `-reach` and `max_depth` that are at
    most `reach` apart in B's plane, and few others.

    Parameters
    ----------
    pose : RelativePose
    limits : PairLimits
        With the `min_cosine` of `flattest`.
    lists : NeighbourList
    facets : FacetPairs

    Returns
    -------
    int
        Number of pairs.
    """
    inner, before = lists.inner.state[pose.row], facets.state[0].tick
    moved = largest_displacement(table, pose.first, inner.transform, pose.transform)
    skin = min(_LEAST_SKIN + _TICKS * pose.step, _MOST_SKIN)
    if skin < 2.0 * pose.step:
        skin = 0.0  # at this speed no list stays valid for a tick
    if (
        inner.count == EMPTY
        or moved > inner.skin
        or limits.max_depth + moved > inner.max_depth
        or limits.reach + moved > inner.reach
    ):
        _rebuild_inner(table, pose, limits, skin, lists, facets)
    if inner.count == OVERFLOWED:
        return overlapping_facet_pairs(
            table, pose.first, pose.second, pose.transform, limits, facets
        )
    if facets.state[0].tick == before:
        # The inner list is still valid, so that there is time for the pending one.
        facets.state[0].tick += 1
        facets.state[0].dropped = 0
        _advance_pending(table, pose, limits, skin, lists, facets)
    return _facing_pairs(table, pose, lists, facets)
