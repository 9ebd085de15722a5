"""Choices of directions by which the tool leaves all parts of a contact, and their lengths.

See `potential`. The length of a choice is the solution of a non-negative least-squares problem with
as many unknowns as parts, by an active-set method.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, small_kernel
from asperity._core.stack import stack_array
from asperity._core.structures import by_reference
from asperity.contact.manifold.separation import MAX_PARTS

RATIO = 1.5
"""R: multiple of the least way out below which another one counts."""
MAX_CHOICES = 48
"""Maximum number of choices; further ones are ignored."""


@by_reference
class WaysOut(NamedTuple):
    """Scratch memory for the choices of one direction for each part."""

    choices: NDArray[np.int64]
    """Row of each part's separation, -1 for none; (choices, parts)."""
    shares: NDArray[np.float64]
    """Multipliers lambda of each choice's parts [m], 0 for inactive ones."""
    rows: NDArray[np.int64]
    """Scratch memory for one choice, (parts,)."""
    row_shares: NDArray[np.float64]
    length: NDArray[np.float64]
    """|tau| of each choice [m]."""
    weight: NDArray[np.float64]
    """w of each choice."""
    alike: NDArray[np.float64]
    """S, (choices, choices)."""
    inputs: NDArray[np.float64]
    """Scaled depth, scaled g, share and normal of each separation, (separations, 6)."""
    presence: NDArray[np.float64]
    """How far each separation is there by its own g and shorter ones near it, (separations,)."""


def ways_out(separations: int) -> WaysOut:
    """Allocate memory for the choices among `separations` separations."""
    return WaysOut(
        np.zeros((MAX_CHOICES, MAX_PARTS), np.int64),
        np.zeros((MAX_CHOICES, MAX_PARTS)),
        np.zeros(MAX_PARTS, np.int64),
        np.zeros(MAX_PARTS),
        np.zeros(MAX_CHOICES),
        np.zeros(MAX_CHOICES),
        np.zeros((MAX_CHOICES, MAX_CHOICES)),
        np.zeros((separations, 6)),
        np.zeros(separations),
    )


@small_kernel
def cosine_of(one, two):
    """Return the cosine of the angle between the normals of two rows of inputs."""
    return one[3] * two[3] + one[4] * two[4] + one[5] * two[5]


@small_kernel
def _gram(one, two):
    """Return psi . psi of the normals of two rows of inputs."""
    c = cosine_of(one, two)
    return 0.5 * c * (1.0 + c)


@inner_kernel
def _solve(inputs, rows, active, count, out):
    """Fill the multipliers that make the constraints of the active parts equalities (Cholesky)."""
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
def choose_active(inputs, rows, parts, shares):
    """Fill the multipliers (parts,) of one choice by the active-set method."""
    active, values = stack_array((MAX_PARTS,)), stack_array((MAX_PARTS,))
    deepest = 0
    for p in range(parts):
        if inputs[rows[p], 0] > inputs[rows[deepest], 0]:
            deepest = p
    active[0], count = float(deepest), 1
    rounding = 1e-12 * inputs[rows[deepest], 0]
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
        most, missing = rounding, -1
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
def update_choice(inputs, rows, parts, shares):
    """Solve a choice again for its active parts; return |tau|."""
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
def _inner(inputs, ways, parts, c, d):
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
def fill_alike(ways, parts, count):
    """Fill S of all choices from their lengths and multipliers."""
    for c in range(count):
        ways.alike[c, c] = 1.0
        for d in range(c):
            cosine = _inner(ways.inputs, ways, parts, c, d) / (ways.length[c] * ways.length[d])
            ways.alike[c, d] = ways.alike[d, c] = max(cosine, 0.0) ** 4


@inner_kernel
def update_choices(ways, parts, count):
    """Solve all choices again for changed inputs, and fill S."""
    inputs = ways.inputs
    for c in range(count):
        ways.length[c] = update_choice(inputs, ways.choices[c], parts, ways.shares[c])
    fill_alike(ways, parts, count)


@inner_kernel
def fill_choices(separations, used, parts, most, ways):
    """Fill the choices short enough to count, and their multipliers; return their number.

    Short enough is for a smooth minimum of at most `most` times the least length.
    """
    inputs = ways.inputs
    first, past, at = (
        stack_array((MAX_PARTS,)), stack_array((MAX_PARTS,)), stack_array((MAX_PARTS,)),
    )  # fmt: skip
    rows, shares = ways.rows, ways.row_shares
    for p in range(parts):
        first[p] = -1.0
    for i in range(used):
        p = separations[i].part
        if first[p] < 0.0:
            first[p] = float(i)
            rows[p] = i
        past[p] = float(i + 1)
        if inputs[i, 0] < inputs[rows[p], 0]:
            rows[p] = i
    choose_active(inputs, rows, parts, shares)
    bound = RATIO * most * update_choice(inputs, rows, parts, shares)
    for p in range(parts):
        at[p] = first[p]
    count = 0
    while True:
        fits = True
        for p in range(parts):
            rows[p] = int(at[p])
            fits = fits and inputs[rows[p], 0] < bound
        if fits and count < ways.length.size:
            for p in range(parts):
                ways.choices[count, p] = rows[p]
            choose_active(inputs, rows, parts, ways.shares[count])
            length = update_choice(inputs, rows, parts, ways.shares[count])
            if length < bound:
                bound = min(bound, RATIO * most * length)
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
