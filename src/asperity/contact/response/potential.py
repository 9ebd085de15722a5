r"""The potential of contact: how far the tool has to move to leave all parts that it overlaps.

Each part of the contact (a convex geom of the tool in one of the scene, or several that have but
one way out and the same one) offers one or more directions n_i with penetration depths delta_i. The
tool leaves by one direction of *every* part.

*One choice of directions.* The least |tau| with `psi(n_p) . tau >= delta_p` for every part p, where
`psi(n) = (n, n n^T) / sqrt(2)`: a translation and a uniform strain. The Gram matrix of psi is
`c (1 + c) / 2`, c the cosine between two normals: parallel walls share their stiffness, walls that
are perpendicular or opposite have k each. With one direction |tau| is delta.

*The least of all choices*, smoothed: s with

    sum_c w_c kappa_c^2 / sum_d S_cd w_d kappa_d = 1,
    kappa_c = max(0, (R - |tau_c| / s) / (R - 1))^2,   S_cd = max(0, cos(tau_c, tau_d))^4, R = 1.5.

It is homogeneous, leaves out choices longer than R s, and counts choices that point the same way
once. The weights w make directions come and go smoothly: a direction counts less if its separation
g exceeds R s (the way leads out through another face), and not at all from 2 s on; and less beside
an almost parallel one that is simpler, by the angle between them (8 to 16 degrees).

The energy is `U = k s^2 / 2` and the wrench `-k s grad(s)`. Where there is one direction, as nearly
always, this is the law of Otaduy & Lin (2004, Eqs 1 and 2). Otherwise grad(s) follows from the
implicit function theorem, with central differences of the sums above by their inputs: depths,
normals and separations, whose derivatives by the tool's pose are exact.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import clear, inner_kernel, small_kernel
from asperity._core.stack import stack_array
from asperity.contact.manifold.separations import FARTHEST, MAX_PARTS

RATIO = 1.5
"""R: a way out counts while it is shorter than this times the least one."""
MAX_CHOICES = 48
_NEAR = RATIO
"""Multiple of the least way out up to which a separation counts fully."""
_APART, _ALONG = 0.961, 0.990
"""Cosines between two directions between which one stands for both (16 and 8 degrees)."""
_LONGEST = 1.3
"""s is at most this times the least length."""
_STEP = 1e-5
"""Relative step of the central differences."""


class WaysOut(NamedTuple):
    """Room for the choices of directions, one for each part."""

    choices: NDArray[np.int64]
    """Row of each part's separation, -1 for none; (choices, parts)."""
    shares: NDArray[np.float64]
    """Multipliers lambda of each choice's parts [m], 0 for those that it need not heed."""
    length: NDArray[np.float64]
    """|tau| of each choice [m]."""
    weight: NDArray[np.float64]
    """w of each choice."""
    alike: NDArray[np.float64]
    """S, (choices, choices)."""
    inputs: NDArray[np.float64]
    """Of each separation: depth, g, share, normal; (separations, 6)."""


def ways_out(separations: int) -> WaysOut:
    """Allocate room for the choices among so many separations."""
    return WaysOut(
        np.zeros((MAX_CHOICES, MAX_PARTS), np.int64),
        np.zeros((MAX_CHOICES, MAX_PARTS)),
        np.zeros(MAX_CHOICES),
        np.zeros(MAX_CHOICES),
        np.zeros((MAX_CHOICES, MAX_CHOICES)),
        np.zeros((separations, 6)),
    )


@small_kernel
def _ramp(x):
    """Return a smooth step from 0 at 0 to 1 at 1."""
    x = min(max(x, 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)


@small_kernel
def _gram(one, two):
    """Return psi . psi of the normals of two rows of inputs."""
    c = one[3] * two[3] + one[4] * two[4] + one[5] * two[5]
    return 0.5 * c * (1.0 + c)


@inner_kernel
def _solve(inputs, rows, active, count, out):
    """Fill the multipliers of the active parts, so that each is just left; by Cholesky."""
    factor = stack_array((MAX_PARTS, MAX_PARTS))
    for i in range(count):
        one = inputs[rows[int(active[i])]]
        for j in range(i + 1):
            total = _gram(one, inputs[rows[int(active[j])]])
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            factor[i, j] = math.sqrt(max(total, 1e-12)) if i == j else total / factor[j, j]
        total = one[0]
        for k in range(i):
            total -= factor[i, k] * out[k]
        out[i] = total / factor[i, i]
    for i in range(count - 1, -1, -1):
        total = out[i]
        for k in range(i + 1, count):
            total -= factor[k, i] * out[k]
        out[i] = total / factor[i, i]


@inner_kernel
def _choose_active(inputs, rows, parts, shares):
    """Fill the multipliers (parts,) of one choice: a non-negative least-squares problem."""
    active, values = stack_array((MAX_PARTS,)), stack_array((MAX_PARTS,))
    deepest = 0
    for p in range(parts):
        if inputs[rows[p], 0] > inputs[rows[deepest], 0]:
            deepest = p
    active[0], count = float(deepest), 1
    grain = 1e-12 * inputs[rows[deepest], 0]
    for _ in range(6 * MAX_PARTS):
        _solve(inputs, rows, active, count, values)
        worst = -1
        for i in range(count):
            if values[i] < 0.0 and (worst < 0 or values[i] < values[worst]):
                worst = i
        if worst >= 0:
            for i in range(worst, count - 1):
                active[i] = active[i + 1]
            count -= 1
            continue
        most, missing = grain, -1
        for p in range(parts):
            reached = 0.0
            for i in range(count):
                reached += values[i] * _gram(inputs[rows[p]], inputs[rows[int(active[i])]])
            if inputs[rows[p], 0] - reached > most:
                most, missing = inputs[rows[p], 0] - reached, p
        if missing < 0 or count == MAX_PARTS:
            break
        active[count] = float(missing)
        count += 1
    for p in range(parts):
        shares[p] = 0.0
    for i in range(count):
        shares[int(active[i])] = values[i]


@inner_kernel
def _update_choice(inputs, rows, parts, shares):
    """Solve a choice anew for the parts that it heeds; return |tau|."""
    active, values = stack_array((MAX_PARTS,)), stack_array((MAX_PARTS,))
    count = 0
    for p in range(parts):
        if shares[p] != 0.0:
            active[count] = float(p)
            count += 1
    _solve(inputs, rows, active, count, values)
    square = 0.0
    for i in range(count):
        shares[int(active[i])] = values[i]
        square += values[i] * inputs[rows[int(active[i])], 0]
    return math.sqrt(square)


@inner_kernel
def _product(inputs, ways, parts, c, d):
    """Return tau . tau of two choices."""
    total = 0.0
    for p in range(parts):
        if ways.shares[c, p] == 0.0:
            continue
        for q in range(parts):
            if ways.shares[d, q] != 0.0:
                g = _gram(inputs[ways.choices[c, p]], inputs[ways.choices[d, q]])
                total += ways.shares[c, p] * ways.shares[d, q] * g
    return total


@inner_kernel
def _presence(separations, inputs, first, i, s):
    """Return how far separation `i` of a part counts, given the least way out `s`.

    `first` is the first row of its part; rows are in the order of their kinds.
    """
    rough = separations[i].rough
    share = inputs[i, 2] * (1.0 - _ramp(((inputs[i, 1] - rough) / s - _NEAR) / (FARTHEST - _NEAR)))
    for j in range(first, i):
        if separations[j].kind < separations[i].kind and share > 0.0:
            c = 0.0
            for k in range(3, 6):
                c += inputs[i, k] * inputs[j, k]
            beside = _ramp((c - _APART) / (_ALONG - _APART))
            if beside > 0.0:
                share *= 1.0 - beside * _presence_of_face(separations, inputs, first, j, s)
    return share


@inner_kernel
def _presence_of_face(separations, inputs, first, i, s):
    """Return `_presence` of a direction that at most B's faces stand for."""
    rough = separations[i].rough
    share = inputs[i, 2] * (1.0 - _ramp(((inputs[i, 1] - rough) / s - _NEAR) / (FARTHEST - _NEAR)))
    for j in range(first, i):
        if separations[j].kind < separations[i].kind and share > 0.0:
            c = 0.0
            for k in range(3, 6):
                c += inputs[i, k] * inputs[j, k]
            beside = _ramp((c - _APART) / (_ALONG - _APART))
            near = ((inputs[j, 1] - separations[j].rough) / s - _NEAR) / (FARTHEST - _NEAR)
            share *= 1.0 - beside * inputs[j, 2] * (1.0 - _ramp(near))
    return share


@inner_kernel
def _excess(separations, ways, parts, count, s):
    """Return the sum over choices less 1, which is 0 at the soft least s."""
    for c in range(count):
        weight = 1.0
        for p in range(parts):
            i = ways.choices[c, p]
            first = i
            while first > 0 and separations[first - 1].part == separations[i].part:
                first -= 1
            weight *= _presence(separations, ways.inputs, first, i, s)
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
def _update(ways, parts, count):
    """Solve all choices anew for changed inputs, and fill S."""
    inputs = ways.inputs
    for c in range(count):
        ways.length[c] = _update_choice(inputs, ways.choices[c], parts, ways.shares[c])
    for c in range(count):
        ways.alike[c, c] = 1.0
        for d in range(c):
            cosine = _product(inputs, ways, parts, c, d) / (ways.length[c] * ways.length[d])
            ways.alike[c, d] = ways.alike[d, c] = max(cosine, 0.0) ** 4


@inner_kernel
def _enumerate(separations, used, parts, ways):
    """Fill the choices whose length may count, and their multipliers; return how many there are."""
    inputs = ways.inputs
    first, past, at = (
        stack_array((MAX_PARTS,)), stack_array((MAX_PARTS,)), stack_array((MAX_PARTS,)),
    )  # fmt: skip
    rows, shares = ways.choices[MAX_CHOICES - 1], ways.shares[MAX_CHOICES - 1]
    for p in range(parts):
        first[p] = -1.0
    for i in range(used):
        p = separations[i].part
        if p < 0:
            continue
        if first[p] < 0.0:
            first[p] = float(i)
            rows[p] = i
        past[p] = float(i + 1)
        if inputs[i, 0] < inputs[rows[p], 0]:
            rows[p] = i
    _choose_active(inputs, rows, parts, shares)
    bound = RATIO * _LONGEST * _update_choice(inputs, rows, parts, shares)
    for p in range(parts):
        at[p] = first[p]
    count = 0
    while True:
        fits = True
        for p in range(parts):
            rows[p] = int(at[p])
            fits = fits and inputs[rows[p], 0] < bound
        if fits and count < MAX_CHOICES - 1:
            for p in range(parts):
                ways.choices[count, p] = rows[p]
            _choose_active(inputs, rows, parts, ways.shares[count])
            length = _update_choice(inputs, rows, parts, ways.shares[count])
            if length < bound:
                bound = min(bound, RATIO * _LONGEST * length)
                count += 1
        p = 0
        while p < parts:
            at[p] += 1.0
            if at[p] < past[p]:
                break
            at[p] = first[p]
            p += 1
        if p == parts:
            return count


@inner_kernel
def _soft_least(separations, ways, parts, count):
    """Return s, by bisection and secants."""
    least = np.inf
    for c in range(count):
        least = min(least, ways.length[c])
    low, high = least / RATIO, _LONGEST * least
    below = -1.0
    above = _excess(separations, ways, parts, count, high)
    if not above > 0.0:
        return least
    s = least
    for step in range(80):
        value = _excess(separations, ways, parts, count, s)
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
def _perturb(separations, used, ways, i, e, step):
    """Fill the inputs, changed by a step of depth `i`, or of the tool's coordinate `e`."""
    for j in range(used):
        found, row = separations[j], ways.inputs[j]
        row[0], row[1], row[2] = found.depth, found.gap, found.share
        for k in range(3):
            row[3 + k] = found.normal[k]
        if i == j:
            row[0] += step
        elif i < 0 and e >= 0:
            row[1] += step * found.gap_rate[e]
            row[2] += step * found.share_rate[e]
            for k in range(3):
                row[3 + k] += step * found.normal_rate[k, e]


@inner_kernel
def _slope(separations, used, parts, ways, count, at, step):
    """Return the derivative of the excess at fixed s; `at` is (s, depth's row, coordinate)."""
    s, i, e = at
    _perturb(separations, used, ways, i, e, step)
    _update(ways, parts, count)
    rise = _excess(separations, ways, parts, count, s)
    _perturb(separations, used, ways, i, e, -step)
    _update(ways, parts, count)
    return (rise - _excess(separations, ways, parts, count, s)) / (2.0 * step)


@inner_kernel
def fill_potential(separations, used, parts, lever, ways, rates_out):
    """Return the soft least s [m]; fill ds/d(depth) of each separation and the rest of grad(s).

    Parameters
    ----------
    separations : SEPARATION records
        The first `used` rows count, of which those of one part follow each other; their `depth` is
        known and above 0, their `weight` is filled.
    parts : int
        At least 1.
    lever : float
        Length by which a rotation is compared to a translation [m].
    ways : WaysOut
    rates_out : (6,) array
        Derivative of s by the tool's translation and rotation with all depths fixed.
    """
    clear(rates_out)
    for i in range(used):
        separations[i].weight = 0.0
    if parts == 1 and used == 1:
        separations[0].weight = 1.0
        return separations[0].depth
    _perturb(separations, used, ways, -1, -1, 0.0)
    count = _enumerate(separations, used, parts, ways)
    _update(ways, parts, count)
    s = _soft_least(separations, ways, parts, count)
    step = _STEP * s
    rise = _excess(separations, ways, parts, count, s + step)
    by_s = (rise - _excess(separations, ways, parts, count, s - step)) / (2.0 * step)
    for i in range(used):
        is_chosen = False
        for c in range(count):
            for p in range(parts):
                is_chosen = is_chosen or ways.choices[c, p] == i
        if is_chosen:
            at = (s, i, -1)
            rate = _slope(separations, used, parts, ways, count, at, step)
            separations[i].weight = -rate / by_s
    for e in range(6):
        reach = step if e < 3 else _STEP * min(s / lever, 1.0)
        at = (s, -1, e)
        rates_out[e] = -_slope(separations, used, parts, ways, count, at, reach) / by_s
    return s
