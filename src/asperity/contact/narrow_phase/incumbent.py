"""The incumbent of a search, points that tie with it, and termination of the search.

A search that ends early reports it: its incumbent is a lower bound of the depth, and the bounds of
the remaining boxes give an upper one.

Points within a nanometre of the deepest count as equally deep. Flat on flat, or textures in
register, have many such points, and the force acts at their mean.
"""

from __future__ import annotations

import numpy as np

from asperity._core.clock import seconds_now
from asperity._core.kernels import inner_kernel, small_kernel
from asperity._core.records import copy_record
from asperity.contact.narrow_phase.records import MAX_TIES

TIE = 1e-9
"""Difference in depth up to which points count as equally deep [m]."""
SAME_POINT = 1e-6
"""Distance below which points count as one [m]."""
_CLOCK_INTERVAL = 8.0
"""Nodes between two readings of the clock: about 15 us."""
_LEAST_NODES = 16.0
"""Nodes that every search evaluates even past its deadline (project default)."""
_RIDGE = 1e-6
"""Gaussian curvature over the squared mean below which a maximum is a ridge."""


@inner_kernel
def begin_search(search, max_nodes, floor):
    """Clear a `SEARCH`; `floor` [m] is the first incumbent, without a point."""
    search.incumbent, search.upper_bound, search.nodes = floor, -np.inf, 0.0
    search.node_limit, search.tie_count, search.next_clock_read = max_nodes, 0, _LEAST_NODES
    search.best.pair, search.ceiling = -1, np.inf


@small_kernel
def is_spent(search):
    """Return whether a search has used up its node budget or its time."""
    nodes = search.nodes
    if nodes >= search.node_limit:
        return True
    if search.deadline == 0.0 or nodes < search.next_clock_read:
        return False
    search.next_clock_read = nodes + _CLOCK_INTERVAL
    if seconds_now() < search.deadline:
        return False
    search.node_limit, search.is_cut_short = nodes, True
    return True


@small_kernel
def pruning_threshold(search):
    """Return the bound up to which a box cannot hold a new incumbent or a tie [m]."""
    return search.incumbent - TIE


@inner_kernel
def record_maximum(search, number, weight):
    """Record the local maximum `search.at` of a pair as the new incumbent or a tie.

    `weight` is the area that it represents, if it is on a plateau or a ridge [m^2].
    """
    at, ties = search.at, search.ties
    depth = at.f
    if depth < search.incumbent - TIE:
        return
    bend = at.f_xx + at.f_yy
    if at.f_xx * at.f_yy - at.f_xy * at.f_xy > _RIDGE * bend * bend:
        weight = 0.0  # a peak, whatever the size of its box
    if depth > search.incumbent:
        search.incumbent = depth
        copy_record(search.best, at)
        search.best.pair = number
    count = search.tie_count
    for i in range(count):
        tie = ties[i]
        is_near = abs(tie.x - at.x) < SAME_POINT and abs(tie.y - at.y) < SAME_POINT
        if is_near and tie.pair == number and tie.f >= search.incumbent - TIE:
            weight = max(tie.weight, weight)
            if depth > tie.f:
                copy_record(tie, at)
            tie.pair, tie.weight = number, weight
            return
    if count == MAX_TIES:
        # Make room by dropping points that are no longer deep enough.
        kept = 0
        for i in range(count):
            if ties[i].f >= search.incumbent - TIE:
                copy_record(ties[kept], ties[i])
                kept += 1
        count = kept
        if count == MAX_TIES:
            return
    tie = ties[count]
    copy_record(tie, at)
    tie.pair, tie.weight = number, weight
    search.tie_count = count + 1
