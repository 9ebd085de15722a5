"""Directions that shorter ones near them stand for, between convex polyhedra of many faces.

Where faces are a few degrees apart, as those of a prism that stands for a cylinder, many directions
are about as short and lead the same way. With g the separations, delta the depths and s the way
out, direction i is present as far as

    p_i = o_i product over j of (1 - a(n_i . n_j) b((g_i - g_j) / s) c(delta_j / s) p_j),

o_i its own weight. a rises from 0 to 1 from 24 to 16 degrees between the two, b as g_i exceeds g_j
by 0 to an eighth of s, and c falls from 1 to 0 as delta_j is 1.4 to 1.6 times s. Edges do not stand
for faces. The shortest direction is always present, and all change continuously. The constants are
asperity's own.
"""

from __future__ import annotations

import numpy as np

from asperity._core.kernels import inner_kernel
from asperity.contact.manifold.separation import ABOUT, FACE_A, LONGEST, cosine, smooth_step
from asperity.contact.response.ways_out import cosine_of

_BESIDE, _AT = 0.9135, 0.9613
"""Cosines between two directions over which the shorter one comes to stand for the other (24 and
16 degrees)."""
_LATER = 0.125
"""Difference of their separations over the way out from which nothing is left of the longer one."""
_SHALLOW, _DEEP = 1.4, 1.6
"""Depths over the way out between which a direction ceases to stand for others."""
_NOT_DEEPER = 1.2
"""Depth over the least one up to which a direction certainly stands for others."""


@inner_kernel
def _may_stand_for(one, other):
    """Return whether a separation may stand for another one: edges do not for faces."""
    return one.kind <= max(other.kind, FACE_A)


@inner_kernel
def _next_row(inputs, used, last):
    """Return the row after `last` in the order of separations; -1 stands before the first."""
    following = np.int64(-1)
    for i in range(used):
        is_later = last < 0 or inputs[i, 1] > inputs[last, 1]
        is_later = is_later or (inputs[i, 1] == inputs[last, 1] and i > last)
        if is_later and (following < 0 or inputs[i, 1] < inputs[following, 1]):
            following = np.int64(i)
    return following


@inner_kernel
def thin_out(separations, ways, used, s):
    """Reduce `ways.presence` of directions that shorter ones stand for, given the way out `s`."""
    inputs, presence, i = ways.inputs, ways.presence, np.int64(-1)
    for _ in range(used):
        i = _next_row(inputs, used, i)
        for j in range(used):
            later = (inputs[i, 1] - inputs[j, 1]) / (_LATER * s)
            if later <= 0.0 or not _may_stand_for(separations[j], separations[i]):
                continue
            along = cosine_of(inputs[i], inputs[j])
            if along > _BESIDE:
                part = smooth_step((along - _BESIDE) / (_AT - _BESIDE)) * smooth_step(later)
                deeper = (inputs[j, 0] / s - _SHALLOW) / (_DEEP - _SHALLOW)
                presence[i] *= 1.0 - part * (1.0 - smooth_step(deeper)) * presence[j]


@inner_kernel
def is_present(rows, used, i, least):
    """Return whether row `i` is wholly present, if the least depth is `least` [m].

    No direction that counts, or may, stands for any part of it.
    """
    found = rows[i]
    is_near = found.gap_scale * (found.gap - found.rough) <= ABOUT * least
    if found.share < 1.0 or not is_near:
        return False
    for j in range(used):
        is_out = rows[j].depth == -np.inf
        is_shorter = rows[j].gap < found.gap and _may_stand_for(rows[j], found)
        if is_shorter and not is_out and cosine(found, rows[j]) > _BESIDE:
            return False
    return True


@inner_kernel
def is_thinned_out(rows, used, i, least):
    """Return whether a direction that has been searched leaves nothing of row `i`.

    Parameters
    ----------
    rows : SEPARATION records
        Their depth is nan if they have not been searched, -inf if they do not count.
    used : int
        Number of rows.
    i : int
        The row.
    least : float
        Least depth found [m].
    """
    found = rows[i]
    for j in range(used):
        other = rows[j]
        if not 0.0 < other.depth <= _NOT_DEEPER * least:
            continue
        is_later = other.gap_scale * (found.gap - other.gap) >= _LATER * LONGEST * least
        stands = is_later and cosine(found, other) >= _AT and _may_stand_for(other, found)
        if stands and is_present(rows, used, j, least):
            return True
    return False
