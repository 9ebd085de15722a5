"""The deepest overlap of two patches, by branch and bound.

A box of the first patch's parameters is pruned if its upper bound does not exceed the incumbent;
otherwise it is quartered. The deepest point is the end of a Newton ascent, so the result is a local
maximum up to rounding, and no other point is deeper by more than the gap.

Boxes that may hold a point as deep as the incumbent are divided down to a twentieth of the contact
(`FINEST_TIE`).
"""

from __future__ import annotations

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.bounds.borders import beyond_borders
from asperity.contact.narrow_phase.bounds.compliance import lowering_over
from asperity.contact.narrow_phase.bounds.curvature import CONCAVE, QUADRATIC, UNEVALUATED
from asperity.contact.narrow_phase.bounds.overlap import general_bound, sphere_bound
from asperity.contact.narrow_phase.bounds.plane_overlap import plane_bound
from asperity.contact.narrow_phase.bounds.smooth_bases import raised_base_bound
from asperity.contact.narrow_phase.flat_on_flat import deepest_of_planes, is_straight
from asperity.contact.narrow_phase.incumbent import TIE, is_spent, pruning_threshold, record_maximum
from asperity.contact.narrow_phase.newton_ascent import is_within, newton_ascent
from asperity.contact.narrow_phase.overlap import limits_at, overlap_at
from asperity.contact.narrow_phase.patch_pair import (
    GENERAL,
    PLANES,
    SPHERE_ON_PLANE,
    PatchPair,
    kind_and_base,
    middle_of,
    pair_shift,
    window_of,
    window_under_sphere,
)
from asperity.contact.narrow_phase.records import MAX_STACK
from asperity.contact.narrow_phase.smooth_base import parameters_at
from asperity.contact.narrow_phase.start_boxes import start_boxes
from asperity.contact.narrow_phase.tighten import tighten_bound

FINEST_TIE = 1.0 / 20.0
"""Box size, over that of the contact, below which boxes are not divided to find ties."""
SMALLEST = 1e-10
"""Box size below which boxes are not divided [m]."""
_FLAT_SLOPE = 1e-7
"""Slope below which smooth planes count as parallel."""
_ROUNDING = 1e-12
"""Difference between a bound and the maximum found in its box at which the bound is attained [m].
"""


@inner_kernel
def _clear_of_limits(patch, other, box, search):
    """Return whether a box around the point `search.at` is within all limits, linearised there."""
    x0, x1, y0, y1 = box
    limits, half_x, half_y = search.limits, 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    for i in range(limits_at(patch, other, search.at, limits)):
        limit = limits[i]
        if limit.g + abs(limit.g_x) * half_x + abs(limit.g_y) * half_y > 0.0:
            return False
    return True


@inner_kernel
def _base_maximum(textures, patch, other, window, search):
    """Return the parameters at which the smooth bases overlap most, or nearly so."""
    x, y = middle_of(other, patch)
    x0, x1, y0, y1 = window
    slope, other_slope = patch.slope, other.slope
    if patch.bulge == slope[0] == slope[1] == 0.0 and other_slope[0] == other_slope[1] == 0.0:
        # Both bases are level there.
        return min(max(x, x0), x1), min(max(y, y0), y1)
    texture, other_texture = patch.texture, other.texture
    patch.texture, other.texture = -1, -1
    newton_ascent(textures, patch, other, window, x, y, max(x1 - x0, y1 - y0), search)
    patch.texture, other.texture = texture, other_texture
    return search.at.x, search.at.y


@inner_kernel
def initialise_pair(textures, patch, other, guess, search, candidate):
    """Ascend once in a candidate pair, so that all pairs start from a good incumbent.

    `guess` (u, v) is a start point, such as the last deepest point; nan if unknown. Fills the
    candidate's bound, -inf without an overlap, and its base point.
    """
    shift = pair_shift(textures, patch, other)
    window = window_of(patch, other, shift)
    x0, x1, y0, y1 = window
    candidate.bound = -np.inf
    if not (x0 <= x1 and y0 <= y1):
        return
    if is_straight(patch) and is_straight(other) and search.load == 0.0:
        # Solved exactly, without a search.
        found, area = deepest_of_planes(textures, patch, other, TIE, search)
        if found:
            search.nodes += 1.0
            search.upper_bound = max(search.upper_bound, search.at.f)
            record_maximum(search, candidate.number, area)
        return
    span = max(x1 - x0, y1 - y0)
    base_x, base_y = _base_maximum(textures, patch, other, window, search)
    candidate.base_x, candidate.base_y = base_x, base_y
    bound = raised_base_bound(textures, patch, other, base_x, base_y, window, shift)
    if bound == -np.inf:
        return
    if search.load > 0.0:
        bound -= lowering_over(textures, patch, other, window, search)[0]
    candidate.bound = bound
    x, y = parameters_at(patch, guess[0], guess[1])
    if not (x0 <= x <= x1 and y0 <= y <= y1):
        x, y = base_x, base_y
    if newton_ascent(textures, patch, other, window, x, y, 0.1 * span, search):
        record_maximum(search, candidate.number, 0.0)


@inner_kernel
def _is_flat(textures, pair, box, search):
    """Return whether both patches are smooth planes over a box, lowered by a constant."""
    patch, other = pair.patch, pair.other
    if patch.bulge > 0.0 or other.bulge > 0.0 or patch.texture >= 0 or other.texture >= 0:
        return False
    if search.load == 0.0 or patch.stiffness_map < 0:
        return True
    x0, x1, y0, y1 = box
    return lowering_over(textures, patch, other, box, search)[2] * (x1 - x0 + y1 - y0) <= TIE


@inner_kernel
def evaluate_node(textures, pair, box, bound, search):
    """Return an upper bound of the overlap over a box to be divided, -inf if it is pruned.

    `bound` is that of the parent box; for `PLANES`, the order-zero bound of the box. The new bound
    is stored in `search.last_bound` even if the box is pruned. Local maxima found are recorded.
    """
    patch, other, at = pair.patch, pair.other, search.at
    p0, p1, q0, q1 = box
    search.nodes += 1.0
    threshold = pruning_threshold(search)
    x, y = 0.5 * (p0 + p1), 0.5 * (q0 + q1)
    search.last_bound = -np.inf
    if beyond_borders(patch, x, y, p1 - x, q1 - y):
        return -np.inf
    if pair.kind == SPHERE_ON_PLANE:
        found = sphere_bound(textures, pair, box, threshold, at)
    elif pair.kind == PLANES:
        found = plane_bound(textures, pair, box, bound, search)
    else:
        found = general_bound(textures, pair, box, threshold, search)
    is_candidate, high = found.kind != UNEVALUATED, min(found.value, bound)
    if found.kind >= QUADRATIC and high > threshold:
        found_high, is_candidate = tighten_bound(textures, pair, box, found, threshold, search)
        high = min(found_high, bound)
    search.last_bound = high
    is_solved = is_candidate and found.kind == CONCAVE and high <= at.f + _ROUNDING
    if (
        # Ascend only from points that may improve the incumbent. A point beyond a limit is no
        # evidence of a maximum within, and many boxes have a deep one.
        is_candidate
        and at.f > search.incumbent - TIE
        and is_within(patch, other, at, search)
        and newton_ascent(
            textures, patch, other, pair.window, at.x, at.y, p1 - p0 + q1 - q0, search
        )
    ):
        record_maximum(search, pair.number, 0.0)
    if high <= pruning_threshold(search):
        return -np.inf
    if is_solved:
        search.upper_bound = max(search.upper_bound, high)
        return -np.inf
    is_level = is_candidate and high <= at.f + TIE and _is_flat(textures, pair, box, search)
    if is_level and _clear_of_limits(patch, other, box, search):
        # Flat on flat: the whole box is equally deep.
        search.upper_bound = max(search.upper_bound, high)
        record_maximum(search, pair.number, (p1 - p0) * (q1 - q0))
        return -np.inf
    return high


@inner_kernel
def resolve_leaf(textures, pair, box, bound, search):
    """Ascend from a small certified box to find a point as deep as the incumbent."""
    patch, other, at = pair.patch, pair.other, search.at
    x0, x1, y0, y1 = box
    search.upper_bound = max(search.upper_bound, bound)
    weight = (x1 - x0) * (y1 - y0)
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    if _is_flat(textures, pair, box, search):
        overlap_at(textures, patch, other, x, y, search, at)
        if abs(at.f_x) + abs(at.f_y) < _FLAT_SLOPE:
            # Flat on flat: the box counts if its centre is within the limits.
            if _clear_of_limits(patch, other, (x, x, y, y), search):
                record_maximum(search, pair.number, weight)
            return
    if newton_ascent(textures, patch, other, pair.window, x, y, x1 - x0 + y1 - y0, search):
        record_maximum(search, pair.number, weight)


@small_kernel
def _place_node(stack, first, top, box, bound):
    """Insert a box into the stack so that entries from `first` on are in the order of bounds."""
    place = top
    while place > first and stack[place - 1].bound > bound:
        below, above = stack[place - 1], stack[place]
        above.x0, above.x1, above.y0, above.y1 = below.x0, below.x1, below.y0, below.y1
        above.bound = below.bound
        place -= 1
    node = stack[place]
    node.x0, node.x1, node.y0, node.y1 = box
    node.bound = bound


@inner_kernel
def search_pair(textures, patch, other, candidate, bound, tolerance, search):
    """Search one pair of patches, depth first, and improve the incumbent.

    Parameters
    ----------
    patch, other : PATCH records
        The search runs over the parameters of `patch`.
    candidate : CANDIDATE record
        The pair, initialised.
    bound : float
        Upper bound of its overlap [m].
    tolerance : float
        A box is not divided for a gain smaller than this [m].
    """
    kind, x, y = kind_and_base(patch, other, candidate.base_x, candidate.base_y)
    if search.load > 0.0:
        kind = np.int64(GENERAL)
    shift = pair_shift(textures, patch, other)
    window = window_of(patch, other, shift)
    pair = PatchPair(patch, other, candidate.number, kind, x, y, shift, window)
    x0, x1, y0, y1 = window
    finest = max(max(x1 - x0, y1 - y0) * FINEST_TIE, SMALLEST)
    if pair.kind == SPHERE_ON_PLANE:
        window = window_under_sphere(textures, pair, pruning_threshold(search))
    stack, boxes = search.stack, search.start_boxes
    top = 0
    for i in range(start_boxes(textures, patch, window, boxes)):
        box = (boxes[i, 0], boxes[i, 1], boxes[i, 2], boxes[i, 3])
        high = evaluate_node(textures, pair, box, bound, search)
        if high > -np.inf:
            _place_node(stack, top, top, box, high)
            top += 1
    while top > 0:
        top -= 1
        node = stack[top]
        x0, x1, y0, y1, bound = node.x0, node.x1, node.y0, node.y1, node.bound
        if bound <= pruning_threshold(search):
            continue
        if bound <= search.incumbent + tolerance and max(x1 - x0, y1 - y0) <= finest:
            resolve_leaf(textures, pair, (x0, x1, y0, y1), bound, search)
            continue
        if is_spent(search) or top + 4 > MAX_STACK or x1 - x0 + y1 - y0 < SMALLEST:
            search.upper_bound = max(search.upper_bound, bound)
            continue
        # Oblong boxes are halved, others quartered.
        cut_x, cut_y = 2.0 * (x1 - x0) > y1 - y0, 2.0 * (y1 - y0) > x1 - x0
        mx, my = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
        first = top
        for child in range(4):
            if (child & 1 and not cut_x) or (child & 2 and not cut_y):
                continue
            p0, p1 = (mx if child & 1 else x0), (mx if cut_x and not child & 1 else x1)
            q0, q1 = (my if child & 2 else y0), (my if cut_y and not child & 2 else y1)
            high = evaluate_node(textures, pair, (p0, p1, q0, q1), bound, search)
            if high > -np.inf:
                _place_node(stack, first, top, (p0, p1, q0, q1), high)
                top += 1
