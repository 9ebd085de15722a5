"""The deepest overlap of many pairs of patches, and the penetration that follows from it.

The gradient of the depth is that of the overlap at the deepest point; see `geom_depth`.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel
from asperity._core.records import clear_record
from asperity._core.stack import stack_array
from asperity.contact.narrow_phase.branch_and_bound import initialise_pair, search_pair
from asperity.contact.narrow_phase.friction import friction_of_tie
from asperity.contact.narrow_phase.incumbent import SAME_POINT, TIE, pruning_threshold
from asperity.contact.narrow_phase.load import scale_of_tie
from asperity.contact.narrow_phase.patch_pair import searches_a
from asperity.contact.narrow_phase.records import BUDGET_SPENT, CERTIFIED
from asperity.contact.narrow_phase.slope_normal import slope_normal_of_tie

_EQUAL = 1e-15
"""Difference between two depths that are equal up to rounding [m]."""


@inner_kernel
def search_candidates(textures, stride, count, guess, tolerance, memory):
    """Search the first `count` candidates of `memory` one by one, the largest bound first.

    For a few pairs of geoms this is faster than `best_first_search`.
    """
    search, candidates = memory.search[0], memory.candidates
    while count > 0:
        k = np.int64(0)  # a literal 0 has another type, for which all calls would be compiled again
        for i in range(1, count):
            if candidates[i].bound > candidates[k].bound:
                k = i
        candidate = candidates[k]
        bound = candidate.bound
        if bound <= pruning_threshold(search) or bound == -np.inf:
            break
        number = candidate.number
        a, b = memory.patches_a[number // stride], memory.patches_b[number % stride]
        patch, other = (a, b) if searches_a(a, b) else (b, a)
        if not candidate.is_initialised:
            candidate.is_initialised = True
            initialise_pair(textures, patch, other, guess, search, candidate)
            candidate.bound = min(candidate.bound, bound)
            continue
        candidate.bound = -np.inf
        search_pair(textures, patch, other, candidate, bound, tolerance, search)


@inner_kernel
def may_touch(result):
    """Return whether bodies may touch although the search has found no contact."""
    is_open = result.depth == -np.inf or result.depth + result.gap > 0.0
    return result.status == BUDGET_SPENT and is_open and not result.depth > 0.0


@inner_kernel
def _is_same_point(one, other):
    """Return whether two ties are at one point."""
    return abs(one.point[0] - other.point[0]) + abs(one.point[1] - other.point[1]) < SAME_POINT


@inner_kernel
def _is_counted(search, t):
    """Return whether a tie is as deep as the incumbent and the first such tie at its point.

    Adjacent patches share their edge; of ties at one point the first of the deepest counts.
    """
    tie = search.ties[t]
    if tie.f < search.incumbent - TIE:
        return False
    for i in range(search.tie_count):
        other = search.ties[i]
        is_first = other.f > tie.f or (other.f == tie.f and i < t)
        if i != t and is_first and _is_same_point(other, tie):
            return False
    return True


@inner_kernel
def _certain_slope_normal(textures, stride, t, memory, m_out, scratch):
    """Fill m of a tie, a certain one if possible; return whether A's patch was searched.

    If m is uncertain, it may be certain for another tie at the same point, on an adjacent facet. Of
    two certain and equally deep ones, as at a corner just over an edge, the less inclined is used.
    """
    search = memory.search[0]
    tie = search.ties[t]
    is_certain, is_a = slope_normal_of_tie(textures, stride, tie, memory, m_out)
    for i in range(search.tie_count):
        other = search.ties[i]
        is_equal = abs(other.f - tie.f) <= _EQUAL and other.pair != tie.pair
        is_deep = other.f >= search.incumbent - TIE if not is_certain else is_equal
        if i == t or not is_deep or not _is_same_point(other, tie):
            continue
        is_other_certain, _ = slope_normal_of_tie(textures, stride, other, memory, scratch)
        inclination = m_out[0] * m_out[0] + m_out[1] * m_out[1]
        is_less_inclined = scratch[0] * scratch[0] + scratch[1] * scratch[1] < inclination
        if is_other_certain and (is_less_inclined or not is_certain):
            is_certain = True
            for k in range(3):
                m_out[k] = scratch[k]
    return is_a


@inner_kernel
def fill_penetration(textures, stride, n, tolerance, memory, result_out):
    """Fill a `PENETRATION` record from a finished search: depth, gap, and means over the ties.

    Under a load, the means are weighted by the derivative of the load by the depth of each tie.
    """
    search, frame = memory.search[0], memory.frame
    clear_record(result_out)
    result_out.friction = np.nan
    if search.best.pair < 0:
        search.incumbent = -np.inf  # nothing was found
    result_out.depth = search.incumbent
    result_out.nodes = int(search.nodes)
    if search.incumbent == -np.inf:
        if search.upper_bound > tolerance:
            result_out.status = BUDGET_SPENT
        return
    gap = max(search.upper_bound - search.incumbent, 0.0)
    result_out.gap = gap
    result_out.status = CERTIFIED if gap <= tolerance else BUDGET_SPENT
    area = 0.0
    for t in range(search.tie_count):
        if _is_counted(search, t):
            area += search.ties[t].weight
    result_out.area = area
    m, p, q = stack_array((3,)), stack_array((3,)), stack_array((3,))
    total = friction = number = 0.0
    has_map = False
    for t in range(search.tie_count):
        if not _is_counted(search, t):
            continue
        tie = search.ties[t]
        # If an area or a line is equally deep, single points have no weight.
        share = tie.weight if area > 0.0 else 1.0
        if share == 0.0:
            continue
        number += share
        if search.load > 0.0:
            share *= scale_of_tie(textures, stride, tie, memory)
        is_a = _certain_slope_normal(textures, stride, t, memory, m, p)
        own, is_mapped = friction_of_tie(textures, stride, tie, is_a, memory)
        has_map = has_map or is_mapped
        if own == own:
            friction += share * own
        else:
            result_out.unknown += share
        a, b = memory.patches_a[tie.pair // stride], memory.patches_b[tie.pair % stride]
        height = -(tie.point[2] if is_a else tie.other_z) - a.lowered
        result_out.ties += 1
        total += share
        for k in range(3):
            p[k] = frame[0, k] * tie.point[0] + frame[1, k] * tie.point[1] + n[k] * height
            q[k] = frame[0, k] * m[0] + frame[1, k] * m[1] + n[k]
        for k in range(3):
            result_out.point[k] += share * p[k]
            result_out.slope_normal[k] += share * q[k]
            one, two = (k + 1) % 3, (k + 2) % 3
            result_out.moment[k] += share * (p[one] * q[two] - p[two] * q[one])
            if a.lowered > 0.0 or b.lowered > 0.0:
                by_u, by_v = frame[0, k] * share, frame[1, k] * share
                result_out.moment[k] += by_v * a.lowered_rate[0] - by_u * a.lowered_rate[1]
                result_out.turn[k] -= share * (a.lowered + b.lowered) * q[k]
                result_out.turn[k] += by_u * (a.lowered_rate[0] - b.lowered_rate[0])
                result_out.turn[k] += by_v * (a.lowered_rate[1] - b.lowered_rate[1])
    if search.load > 0.0:
        result_out.scale = total / number
        result_out.depth = search.load * math.sqrt(search.usual) / result_out.scale
    result_out.unknown /= total
    if has_map:
        result_out.friction = friction / total
    for k in range(3):
        result_out.point[k] /= total
        result_out.slope_normal[k] /= total
        result_out.moment[k] /= total
        result_out.turn[k] /= total
