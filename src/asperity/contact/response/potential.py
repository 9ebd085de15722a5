"""The potential of contact: the least motion of the tool that separates all overlapping parts.

Each part of the contact (a pair of convex geoms, or several whose only way out is the same
direction) has one or more directions n_i with penetration depths delta_i. The tool leaves by one
direction of *every* part.

*One choice of directions.* The least |tau| with `psi(n_p) . tau >= delta_p` for every part p, where
`psi(n) = (n, n n^T) / sqrt(2)`: a translation and a uniform strain. The Gram matrix of psi is
`c (1 + c) / 2`, c the cosine between two normals: parallel walls share their stiffness, walls that
are perpendicular or opposite have k each. With one direction |tau| is delta.

*The smooth minimum over all choices* is s with

    sum_c w_c kappa_c^2 / sum_d S_cd w_d kappa_d = 1,
    kappa_c = max(0, (R - |tau_c| / s) / (R - 1))^2,   S_cd = max(0, cos(tau_c, tau_d))^4, R = 1.5.

It is homogeneous, ignores choices longer than R s, and counts parallel choices once. The weights w
blend directions in and out: that of a direction falls from 1 to 0 as its separation g grows from
R s to 2 s (the way out is through another face); and beside an almost parallel direction of a lower
kind, by the angle between them (16 to 8 degrees), unless a steep texture makes that one deeper
(1.2 to 1.5 times).

If two surfaces have the stiffness k_p, their depths and separations are scaled by `sqrt(k_p / k)`;
with a stiffness map, k_p is that at the deepest point for the depth and at the softest point for
the separation, which so depends on the pose alone. The energy is `U = k s^2 / 2` and the wrench
`-k s grad(s)`. With one direction, as in most contacts, this is the law of Otaduy & Lin (2004,
Eqs 1 and 2). Otherwise grad(s) follows from the implicit function theorem, with central differences
of the sums above by their inputs: depths, normals and separations, whose derivatives by the tool's
pose are exact.
"""

from __future__ import annotations

import numpy as np

from asperity._core.kernels import clear, inner_kernel
from asperity.contact.manifold.separation import (
    ABOUT,
    ALONG,
    APART,
    FARTHEST,
    LONGEST,
    smooth_step,
)
from asperity.contact.response.thinning import thin_out
from asperity.contact.response.ways_out import RATIO, cosine_of, fill_choices, update_choices

_DOUBLINGS = 6
"""Maximum number of times that the bound on the length is doubled."""
_LAST_RESORT = 1e-9
"""Weight of a direction with too large a separation: it matters only if a part has no other."""
_STEP = 1e-5
"""Relative step of the central differences."""


@inner_kernel
def _own_weight(separations, inputs, i, s):
    """Return the weight of a direction by its own separation and share, given the way out `s`."""
    beyond = (inputs[i, 1] - separations[i].gap_scale * separations[i].rough) / s - RATIO
    return inputs[i, 2] * max(1.0 - smooth_step(beyond / (FARTHEST - RATIO)), _LAST_RESORT)


@inner_kernel
def _redundancy(inputs, i, j):
    """Return how redundant direction `i` is given `j`, by their angle and depths, 0 to 1."""
    c = cosine_of(inputs[i], inputs[j])
    deeper = (inputs[j, 0] / inputs[i, 0] - ABOUT) / (RATIO - ABOUT)
    return smooth_step((c - APART) / (ALONG - APART)) * (1.0 - smooth_step(deeper))


@inner_kernel
def _fill_presence(separations, used, ways, s):
    """Fill how far each separation is there, given the way out `s`."""
    for i in range(used):
        ways.presence[i] = _own_weight(separations, ways.inputs, i, s)
    if separations[0].thinned:
        thin_out(separations, ways, used, s)


@inner_kernel
def _direction_weight(separations, ways, first, i):
    """Return the weight of separation `i` of a part, from what is there.

    `first` is the first row of its part; rows are in the order of their kinds.
    """
    inputs, presence = ways.inputs, ways.presence
    share = presence[i]
    for j in range(first, i):
        if separations[j].kind < separations[i].kind and share > 0.0:
            redundancy = _redundancy(inputs, i, j)
            if redundancy == 0.0:
                continue
            # Of the lower kinds, faces of A may in turn be represented by faces of B.
            other = presence[j]
            for k in range(first, j):
                if separations[k].kind < separations[j].kind:
                    other *= 1.0 - _redundancy(inputs, j, k) * presence[k]
            share *= 1.0 - redundancy * other
    return share


@inner_kernel
def _excess(separations, ways, numbers, s):
    """Return the sum over choices minus 1, which is 0 at the smooth minimum s.

    `numbers` are those of rows, parts and choices.
    """
    used, parts, count = numbers
    _fill_presence(separations, used, ways, s)
    for c in range(count):
        weight = 1.0
        for p in range(parts):
            i = ways.choices[c, p]
            first = i
            while first > 0 and separations[first - 1].part == separations[i].part:
                first -= 1
            weight *= _direction_weight(separations, ways, first, i)
        x = max(RATIO - ways.length[c] / s, 0.0) / (RATIO - 1.0)
        ways.weight[c] = weight * x * x
    total = 0.0
    for c in range(count):
        if ways.weight[c] == 0.0:
            continue
        x = max(RATIO - ways.length[c] / s, 0.0) / (RATIO - 1.0)
        below = 0.0
        for d in range(count):
            below += ways.alike[c, d] * ways.weight[d]
        total += ways.weight[c] * x * x / below
    return total - 1.0


@inner_kernel
def _smooth_minimum(separations, ways, numbers, most):
    """Return s by the secant method with bisection; -1 above `most` times the least length."""
    least = np.inf
    for c in range(numbers[2]):
        least = min(least, ways.length[c])
    low, high = least / RATIO, most * least
    below = -1.0
    above = _excess(separations, ways, numbers, high)
    if not above > 0.0:
        return -1.0
    s = least
    for step in range(80):
        value = _excess(separations, ways, numbers, s)
        if value > 0.0:
            high, above = s, value
        else:
            low, below = s, value
        if value == 0.0 or high - low < 1e-14 * least:
            break
        s = low - below * (high - low) / (above - below)
        if step % 3 == 2 or not low < s < high:
            s = 0.5 * (low + high)
    return s


@inner_kernel
def _select_shortest(separations, used):
    """Give a weight to the direction of least length alone; return that length [m]."""
    least = 0
    for i in range(used):
        length = separations[i].scale * separations[i].depth
        if length < separations[least].scale * separations[least].depth:
            least = i
    separations[least].weight = separations[least].scale
    return separations[least].scale * separations[least].depth


@inner_kernel
def _perturb(separations, used, ways, i, e, step):
    """Fill the inputs, perturbed by a step of depth `i` or of the tool's coordinate `e`."""
    for j in range(used):
        found, row = separations[j], ways.inputs[j]
        scale, row[2] = found.scale, found.share
        row[0], row[1] = scale * found.depth, found.gap_scale * found.gap
        for k in range(3):
            row[3 + k] = found.normal[k]
        if i == j:
            row[0] += scale * step
        elif i < 0 and e >= 0:
            row[1] += found.gap_scale * step * found.gap_rate[e]
            row[2] += step * found.share_rate[e]
            for k in range(3):
                row[3 + k] += step * found.normal_rate[k, e]


@inner_kernel
def _slope(separations, ways, numbers, at, step):
    """Return the derivative of the excess at fixed s; `at` is (s, row of the depth, coordinate)."""
    (s, i, e), (used, parts, count) = at, numbers
    _perturb(separations, used, ways, i, e, step)
    update_choices(ways, parts, count)
    rise = _excess(separations, ways, numbers, s)
    _perturb(separations, used, ways, i, e, -step)
    update_choices(ways, parts, count)
    return (rise - _excess(separations, ways, numbers, s)) / (2.0 * step)


@inner_kernel
def fill_potential(separations, used, parts, lever, ways, rates_out):
    """Return the smooth minimum s [m]; fill ds/d(depth) of each separation and the rest of grad(s).

    Parameters
    ----------
    separations : SEPARATION records
        The first `used` rows are valid, those of one part consecutive; their `depth` is above 0,
        their `weight` is filled.
    parts : int
        At least 1.
    lever : float
        Length that makes a rotation comparable to a translation [m].
    ways : WaysOut
    rates_out : (6,) array
        Derivative of s by the tool's translation and rotation with all depths fixed.
    """
    clear(rates_out)
    for i in range(used):
        separations[i].weight = 0.0
    if parts == 1 and used == 1:
        separations[0].weight = separations[0].scale
        return separations[0].scale * separations[0].depth
    _perturb(separations, used, ways, -1, -1, 0.0)
    most, s, count = LONGEST, -1.0, 0
    # If several directions together take all weight from the shortest choice, s is longer.
    for _ in range(_DOUBLINGS):
        count = fill_choices(separations, used, parts, most, ways)
        update_choices(ways, parts, count)
        s = _smooth_minimum(separations, ways, (used, parts, count), most)
        if s > 0.0:
            break
        most *= 2.0
    if not s > 0.0:
        return _select_shortest(separations, used)
    step, numbers = _STEP * s, (used, parts, count)
    rise = _excess(separations, ways, numbers, s + step)
    by_s = (rise - _excess(separations, ways, numbers, s - step)) / (2.0 * step)
    for i in range(used):
        is_chosen = False
        for c in range(count):
            for p in range(parts):
                is_chosen = is_chosen or ways.choices[c, p] == i
        if is_chosen:
            at = (s, i, -1)
            rate = _slope(separations, ways, numbers, at, step)
            separations[i].weight = -rate / by_s
    for e in range(6):
        reach = step if e < 3 else _STEP * min(s / lever, 1.0)
        at = (s, -1, e)
        rates_out[e] = -_slope(separations, ways, numbers, at, reach) / by_s
    return s
