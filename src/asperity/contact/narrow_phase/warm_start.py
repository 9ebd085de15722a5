"""Warm start: cull pairs of patches by overlaps at the previous tick's deepest points.

The tool moves little in a tick, so that the depths at a contact's last deepest points hardly
change. Those points are evaluated first, and pairs that cannot reach that depth are culled: for an
inclined tool mostly by the highest points of both facets, before they are clipped to each other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.bounds.compliance import lowering_over
from asperity.contact.narrow_phase.bounds.plane_pairs import bound_pair, top_bound
from asperity.contact.narrow_phase.incumbent import TIE
from asperity.contact.narrow_phase.overlap import limits_at, overlap_at
from asperity.contact.narrow_phase.patch_pair import pair_shift, searches_a, window_of
from asperity.contact.narrow_phase.smooth_base import parameters_at, place_at
from asperity.contact.narrow_phase.surface_patch import entries

ON_BORDER = 1e-9
"""Distance beyond a facet up to which a point may be on its border [m]."""
_CONVERGED = 1e-10
"""Lateral residual at which the iteration for a point's parameters ends [m]."""
_STEPS = 8
_OFF_BORDER = 1e-10
"""Distance beyond a limit up to which a last deepest point, moved with the tool, counts [m]."""


class SubRegions(NamedTuple):
    """Sub-regions of a contact, whose deepest points are searched one by one."""

    point: NDArray[np.float64]
    """(u, v) of the last deepest point, nan if unknown, (n, 2) [m]."""
    side: NDArray[np.float64]
    """Side of each line on which a sub-region is, 1 or -1; 0: both sides, (n, 2)."""
    depth: NDArray[np.float64]
    """Lower bound of the depth, -inf if unknown, (n,) [m]."""
    found: NDArray[np.float64]
    """Pair number and parameters x, y of the point with that depth, (n, 3)."""
    radius: float
    """How far sub-regions extend beyond the lines [m]."""


@small_kernel
def _is_in_extent(candidate, u, v):
    """Return whether (u, v) is within the extent of a candidate's planes, or at its border."""
    low_u, high_u, low_v, high_v = candidate.extent
    within_u = low_u - ON_BORDER <= u and u <= high_u + ON_BORDER
    return within_u and low_v - ON_BORDER <= v and v <= high_v + ON_BORDER


@inner_kernel
def _overlap_over(textures, patch, other, u, v, search):
    """Fill `search.at` with the overlap at (u, v); return whether it is within the limits.

    A texture moves points laterally, so the point's parameters are found by iteration.
    """
    at = search.at
    x, y = parameters_at(patch, u, v)
    off = np.inf
    for _ in range(_STEPS):
        overlap_at(textures, patch, other, x, y, search, at)
        if at.f == -np.inf:
            return False
        off_u, off_v = at.point[0] - u, at.point[1] - v
        last, off = off, abs(off_u) + abs(off_v)
        if off < _CONVERGED or off > 0.9 * last:
            break
        i, j, k, m = entries(patch.lateral_inverse)
        x -= i * off_u + j * off_v
        y -= k * off_u + m * off_v
    if not off < ON_BORDER:
        return False
    sides = patch.rectangle
    worst = max(max(sides[0] - at.x, at.x - sides[1]), max(sides[2] - at.y, at.y - sides[3]))
    for n in range(limits_at(patch, other, at, search.limits)):
        worst = max(worst, search.limits[n].g)
    return worst <= _OFF_BORDER


@inner_kernel
def distances_from_lines(a, b, at, lines):
    """Return the signed distances of a point from the lines that split an overlap region [m].

    They are those of its base point on B's patch. `lines` (2, 3) has rows `l_u, l_v, l_0`.
    """
    x, y = (at.other_x, at.other_y) if searches_a(a, b) else (at.x, at.y)
    u, v = place_at(b, x, y)
    return (
        lines[0, 0] * u + lines[0, 1] * v + lines[0, 2],
        lines[1, 0] * u + lines[1, 1] * v + lines[1, 2],
    )


@inner_kernel
def fill_known_depths(textures, count, stride, regions, parts, lines, memory):
    """Lower-bound the depth of each sub-region by the overlap at its previous deepest point.

    Fills `regions.depth` [m] of the first `parts`, -inf if that point is unknown. `count` is the
    number of candidates in `memory`; `lines` (2, 3) split the region.
    """
    search = memory.search[0]
    at = search.at
    for p in range(parts):
        regions.depth[p], regions.found[p, 0] = -np.inf, -1.0
    for row in range(count):
        candidate = memory.candidates[row]
        last_u = last_v = np.nan
        is_within = False
        for p in range(parts):
            u, v = regions.point[p, 0], regions.point[p, 1]
            if not _is_in_extent(candidate, u, v):
                continue
            number = candidate.number
            a, b = memory.patches_a[number // stride], memory.patches_b[number % stride]
            patch, other = (a, b) if searches_a(a, b) else (b, a)
            # Several sub-regions often have the same deepest point.
            if not (u == last_u and v == last_v):
                last_u, last_v = u, v
                is_within = _overlap_over(textures, patch, other, u, v, search)
            if not is_within:
                continue
            first, second = distances_from_lines(a, b, at, lines)
            reach = -regions.radius
            if regions.side[p, 0] * first < reach or regions.side[p, 1] * second < reach:
                continue
            if at.f > regions.depth[p]:
                found = regions.found[p]
                regions.depth[p] = at.f
                found[0], found[1], found[2] = number, at.x, at.y


@inner_kernel
def bound_under_load(textures, count, stride, memory):
    """Bound the first `count` candidates under the load of the search."""
    search = memory.search[0]
    for row in range(count):
        candidate = memory.candidates[row]
        a = memory.patches_a[candidate.number // stride]
        b = memory.patches_b[candidate.number % stride]
        patch, other = (a, b) if searches_a(a, b) else (b, a)
        bound_pair(textures, patch, other, search, candidate)
        if search.load > 0.0 and candidate.bound > -np.inf:
            window = window_of(patch, other, pair_shift(textures, patch, other))
            candidate.bound -= lowering_over(textures, patch, other, window, search)[0]


@inner_kernel
def cull_pairs(textures, count, stride, threshold, memory):
    """Bound the first `count` candidates; keep those that may be as deep as `threshold` [m].

    Returns the number of kept candidates.
    """
    candidates, kept = memory.candidates, np.int64(0)
    search = memory.search[0]
    for row in range(count):
        number = candidates[row].number
        a, b = memory.patches_a[number // stride], memory.patches_b[number % stride]
        if top_bound(textures, a, b) <= threshold - TIE:
            continue
        patch, other = (a, b) if searches_a(a, b) else (b, a)
        candidate = candidates[kept]
        bound_pair(textures, patch, other, search, candidate)
        # The bound is -inf for patches without a common part.
        if candidate.bound <= threshold - TIE:
            continue
        candidate.number = number
        for k in range(4):
            candidate.extent[k] = candidates[row].extent[k]
        kept += 1
    return kept
