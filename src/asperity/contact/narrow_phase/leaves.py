"""Points as deep as the incumbent in small, certified boxes.

On a ridge or a plateau each box has another such point. A peak, or a maximum at a corner of the
limits, is alone in its box, so that its box is not searched again.
"""

from __future__ import annotations

from asperity._core.kernels import inner_kernel
from asperity.contact.narrow_phase.branch_and_bound import resolve_leaf
from asperity.contact.narrow_phase.incumbent import SAME_POINT, pruning_threshold
from asperity.contact.narrow_phase.overlap import limits_at

_RIDGE = 1e-6
"""Gaussian curvature over the squared mean below which a maximum is a ridge."""
_ACTIVE = 1e-9
"""Distance of a point from a limit below which the limit is active [m]."""
_CORNER = 1e-3
"""Smallest sine between two active limits, and least multiplier of each, at a corner."""


@inner_kernel
def _is_isolated(patch, other, tie, limits):
    """Return whether a tie is a peak or a maximum at a corner of the limits.

    Else it may be on a ridge or a plateau, whose points are weighted by the area they represent.
    """
    bend = tie.f_xx + tie.f_yy
    if bend < 0.0 and tie.f_xx * tie.f_yy - tie.f_xy * tie.f_xy > _RIDGE * bend * bend:
        return True
    count = limits_at(patch, other, tie, limits)
    for i in range(count):
        for j in range(i if limits[i].g > -_ACTIVE else 0):
            one, two = limits[i], limits[j]
            det = one.g_x * two.g_y - one.g_y * two.g_x
            if two.g <= -_ACTIVE or abs(det) < _CORNER:
                continue
            # The gradient is a positive combination of both normals: the overlap falls along both.
            by_one = (tie.f_x * two.g_y - tie.f_y * two.g_x) / det
            by_two = (one.g_x * tie.f_y - one.g_y * tie.f_x) / det
            if by_one > _CORNER and by_two > _CORNER:
                return True
    return False


@inner_kernel
def resolve_once(textures, pair, box, bound, search):
    """Call `resolve_leaf`, unless the box's only point as deep as the incumbent is recorded."""
    x0, x1, y0, y1 = box
    is_rough = pair.patch.texture >= 0 or pair.other.texture >= 0
    for t in range(search.tie_count if is_rough else 0):
        tie = search.ties[t]
        if tie.pair != pair.number or tie.f < pruning_threshold(search):
            continue
        within_x = x0 - SAME_POINT <= tie.x and tie.x <= x1 + SAME_POINT
        within_y = y0 - SAME_POINT <= tie.y and tie.y <= y1 + SAME_POINT
        if within_x and within_y and _is_isolated(pair.patch, pair.other, tie, search.limits):
            tie.weight = 0.0
            search.upper_bound = max(search.upper_bound, bound)
            return
    resolve_leaf(textures, pair, box, bound, search)
    at = search.at
    for t in range(search.tie_count if is_rough else 0):
        tie = search.ties[t]
        is_it = tie.pair == pair.number and tie.x == at.x and tie.y == at.y
        if is_it and _is_isolated(pair.patch, pair.other, tie, search.limits):
            tie.weight = 0.0
