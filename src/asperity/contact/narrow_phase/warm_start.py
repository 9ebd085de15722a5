"""Warm start: cull pairs of patches by overlaps at the previous tick's deepest points.

The tool moves little in a tick, so where sub-regions of a contact were deepest they are about as
deep again. Those points are evaluated first, and pairs that cannot reach that depth are culled:
for a leaning tool mostly by the highest points of both facets, before the part over which they
meet is cut out.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.bounds.limits import beyond_borders
from asperity.contact.narrow_phase.bounds.plane_pairs import bound_pair, top_bound
from asperity.contact.narrow_phase.displaced_surface import parameters_at, place_at
from asperity.contact.narrow_phase.incumbent import TIE
from asperity.contact.narrow_phase.newton_ascent import is_within
from asperity.contact.narrow_phase.overlap import overlap_at
from asperity.contact.narrow_phase.patch_pair import searches_a


class SubRegions(NamedTuple):
    """Sub-regions of a contact, whose deepest points are searched one by one."""

    point: NDArray[np.float64]
    """(u, v) of the last deepest point, nan if unknown, (n, 2) [m]."""
    side: NDArray[np.float64]
    """Side of either line that a sub-region is on, 1 or -1; 0: both sides, (n, 2)."""
    depth: NDArray[np.float64]
    """Lower bound of the depth, -inf if unknown, (n,) [m]."""
    radius: float
    """How far sub-regions reach over the lines [m]."""


@small_kernel
def _holds(patch, u, v):
    """Return whether a patch's base covers (u, v)."""
    x, y = parameters_at(patch, u, v)
    sides = patch.rectangle
    if not (sides[0] <= x <= sides[1]) or not (sides[2] <= y <= sides[3]):
        return False
    return not beyond_borders(patch, x, y, 0.0, 0.0)


@inner_kernel
def both_hold(patch, other, u, v):
    """Return whether both patches cover (u, v) of the contact frame."""
    return _holds(patch, u, v) and _holds(other, u, v)


@small_kernel
def extent_holds(candidate, u, v):
    """Return whether (u, v) lies within the extent of a candidate's planes."""
    extent = candidate.extent
    return extent[0] <= u <= extent[1] and extent[2] <= v <= extent[3]


@inner_kernel
def distances_from_lines(a, b, at, lines):
    """Return how far a point lies from the two lines that split an overlap region [m].

    The base point on A's patch counts. `lines` (2, 3) has `l_u, l_v, l_0` in each row.
    """
    x, y = (at.x, at.y) if searches_a(a, b) else (at.other_x, at.other_y)
    u, v = place_at(a, x, y)
    return (
        lines[0, 0] * u + lines[0, 1] * v + lines[0, 2],
        lines[1, 0] * u + lines[1, 1] * v + lines[1, 2],
    )


@inner_kernel
def fill_known_depths(textures, count, stride, regions, parts, lines, memory):
    """Lower-bound the depth of each sub-region by the overlap at its previous deepest point.

    Fills `regions.depth` [m], -inf where that point is not known, of the first `parts`. `count`
    is the number of candidates in `memory`; `lines` (2, 3) are those that split the region.
    """
    search = memory.search[0]
    at = search.at
    for p in range(parts):
        regions.depth[p] = -np.inf
    for row in range(count):
        candidate = memory.candidates[row]
        for p in range(parts):
            u, v = regions.point[p, 0], regions.point[p, 1]
            if not extent_holds(candidate, u, v):
                continue
            number = candidate.number
            a, b = memory.patches_a[number // stride], memory.patches_b[number % stride]
            patch, other = (a, b) if searches_a(a, b) else (b, a)
            if not both_hold(patch, other, u, v):
                continue
            x, y = parameters_at(patch, u, v)
            overlap_at(textures, patch, other, x, y, search, at)
            if not at.f > regions.depth[p] or not is_within(patch, other, at, search):
                continue
            first, second = distances_from_lines(a, b, at, lines)
            reach = -regions.radius
            if regions.side[p, 0] * first >= reach and regions.side[p, 1] * second >= reach:
                regions.depth[p] = at.f


@inner_kernel
def cull_pairs(textures, count, stride, threshold, memory):
    """Bound the first `count` candidates; keep those that may be as deep as `threshold` [m].

    Returns how many are left.
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
        # Those that do not meet are -inf deep.
        if candidate.bound <= threshold - TIE:
            continue
        candidate.number = number
        for k in range(4):
            candidate.extent[k] = candidates[row].extent[k]
        kept += 1
    return kept
