"""Small boxes that are certified: whether a point as deep as the incumbent is in them.

Only where a ridge or a plateau is deepest does each box of it have another point. A peak, or a
point that is held in a corner of the limits, is alone in its box, and is not sought again.
"""

from __future__ import annotations

from asperity._core.kernels import inner_kernel
from asperity.contact.narrow_phase.branch_and_bound import resolve_leaf
from asperity.contact.narrow_phase.incumbent import SAME_POINT, pruning_threshold
from asperity.contact.narrow_phase.overlap import limits_at

_RIDGE = 1e-6
"""Gaussian curvature over the squared mean below which a maximum is a ridge."""
_HELD = 1e-9
"""A limit this near a point holds it [m]."""
_CORNER = 1e-3
"""Sine of the angle between two limits, and slope against either, of a point held in a corner."""


@inner_kernel
def _is_isolated(patch, other, tie, limits):
    """Return whether a tie is a peak, or held in a corner of the limits: no other is as deep near.

    Elsewhere it may be one of a ridge or a plateau, whose points count by the area they stand for.
    """
    bend = tie.f_xx + tie.f_yy
    if bend < 0.0 and tie.f_xx * tie.f_yy - tie.f_xy * tie.f_xy > _RIDGE * bend * bend:
        return True
    count = limits_at(patch, other, tie, limits)
    for i in range(count):
        for j in range(i if limits[i].g > -_HELD else 0):
            one, two = limits[i], limits[j]
            det = one.g_x * two.g_y - one.g_y * two.g_x
            if two.g <= -_HELD or abs(det) < _CORNER:
                continue
            # The slope is a sum of both limits' normals: the overlap falls along either side.
            by_one = (tie.f_x * two.g_y - tie.f_y * two.g_x) / det
            by_two = (one.g_x * tie.f_y - one.g_y * tie.f_x) / det
            if by_one > _CORNER and by_two > _CORNER:
                return True
    return False


@inner_kernel
def resolve_once(textures, pair, box, bound, search):
    """Do `resolve_leaf`, unless the only point as deep as the incumbent in the box is known."""
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
