"""Choices of directions by which a tool leaves a body among facets.

Each direction has a depth delta_d, and residuals rho_dc: the part that remains after leaving by
direction c (`manifold.residual`). A choice C of one or more directions has to cover their full
depths, and of every other direction what remains,

    psi(n_d) . tau >= delta_d                                for d in C,
    psi(n_d) . tau >= delta_d times the product of rho_dc over C     for the others,

and the least |tau| is its length: see `potential` and `ways_out`. Against a direction that C
resolves, tau may go. At a convex edge residuals are 0, and each side is a way out. In a groove they
are 1, and all choices are equal: both walls. Everything between is continuous.

A choice *dominated* by a shorter one, because it has to cover all that the other covers and more,
is no separate way out. How far it is one falls to 0 as it gets longer, by up to a tenth, and
is 0 where the shorter one resolves everything.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel
from asperity._core.structures import by_reference
from asperity.contact.broad_phase.facet_bvh import DIRECTIONS
from asperity.contact.manifold.separation import LONGEST, smooth_step
from asperity.contact.response.ways_out import (
    RATIO,
    WaysOut,
    choose_active,
    update_choice,
    ways_out,
)

LONGER = 0.1
"""Relative difference in length at which a dominated choice has no share."""
_COVERED = 0.5
"""Fraction of another choice's distances that a choice covers, above which domination begins."""
_LITTLE = 0.1
"""Fraction of a depth, or of a tenth of a length, below which covering a distance counts less."""
_COUNTS = 0.2
"""Depth of a direction, over the length of a choice, from which on it counts as not resolved."""
_ALIKE = 0.05
"""Difference of the distances of two choices, over the length, below which they begin to be one."""
_AGAINST = 0.125
"""Largest distance against a resolved direction, over the depths of a choice's members.

psi(n) . psi(m) is nowhere less than -1/8.
"""
_BY_SIZE = np.array(sorted(range(1, 1 << DIRECTIONS), key=lambda members: members.bit_count()))
"""All choices, as the bits of their members; those of few directions come first."""


@by_reference
class MeshChoices(NamedTuple):
    """Scratch memory for the choices among the directions of one body."""

    ways: WaysOut
    members: NDArray[np.int64]
    """Bit i: whether the i-th direction that counts belongs to the choice, (choices,)."""
    needed: NDArray[np.float64]
    """Distance along each of them that a choice has to cover [m], (choices, 6)."""
    distinct: NDArray[np.float64]
    """How far a choice differs from all before it, 0 to 1; (choices,)."""
    own: NDArray[np.float64]
    """How far a choice is dominated by no other, 0 to 1; (choices,)."""
    alone: NDArray[np.float64]
    """How far a choice resolves all other directions, 0 to 1; (choices,)."""
    number: NDArray[np.int64]
    """Number, of six, of the i-th direction that counts; (6,)."""
    depth: NDArray[np.float64]
    """[m], (6,)"""
    presence: NDArray[np.float64]
    """How far each direction counts, 0 to 1; (6,)."""
    residual: NDArray[np.float64]
    """(6, 6)"""


def mesh_choices() -> MeshChoices:
    """Allocate memory for the choices among the directions of one body."""
    ways = ways_out(DIRECTIONS)
    return MeshChoices(
        ways=ways,
        members=np.zeros(len(ways.length), np.int64),
        needed=np.zeros((len(ways.length), DIRECTIONS)),
        distinct=np.zeros(len(ways.length)),
        own=np.zeros(len(ways.length)),
        alone=np.zeros(len(ways.length)),
        number=np.zeros(DIRECTIONS, np.int64),
        depth=np.zeros(DIRECTIONS),
        presence=np.zeros(DIRECTIONS),
        residual=np.zeros((DIRECTIONS, DIRECTIONS)),
    )


@inner_kernel
def collect_directions(space):
    """Fill the inputs of the choices; return the number of directions."""
    choices, rows = space.choices, 0
    for d in range(DIRECTIONS):
        if space.directions[d].patches > 0:
            choices.number[rows], choices.depth[rows] = d, space.directions[d].depth
            choices.presence[rows] = space.directions[d].presence
            for k in range(3):
                choices.ways.inputs[rows, 3 + k] = space.directions[d].normal[k]
            rows += 1
    for i in range(rows):
        for j in range(rows):
            one, two = choices.number[i], choices.number[j]
            choices.residual[i, j] = space.residuals.value[one, two]
    return rows


@inner_kernel
def fill_needed(choices, rows, c):
    """Fill the distances along all directions that choice `c` has to cover.

    Where it resolves a direction, the tool may also move against that one.
    """
    members, all_depths = choices.members[c], 0.0
    for i in range(rows):
        if members >> i & 1:
            all_depths += choices.depth[i]
    for i in range(rows):
        left = 1.0
        if not members >> i & 1:
            for j in range(rows):
                if members >> j & 1:
                    left *= choices.residual[i, j]
        choices.needed[c, i] = left * choices.depth[i]
        choices.ways.inputs[i, 0] = choices.needed[c, i] - _AGAINST * (1.0 - left) * all_depths


@inner_kernel
def _domination(choices, rows, c, other):
    """Return the degree to which choice `c` covers all distances of another one, 0 to 1."""
    part = 1.0
    for i in range(rows):
        need = choices.needed[other, i]
        if need > 0.0:
            covered = min(choices.needed[c, i] / need, 1.0)
            left = need / max(choices.depth[i], _LITTLE * choices.ways.length[other])
            if left < _LITTLE:  # continuous as the distance vanishes
                covered = 1.0 - smooth_step(left / _LITTLE) * (1.0 - covered)
            part *= covered
    return smooth_step((part - _COVERED) / (1.0 - _COVERED))


@inner_kernel
def _presence(choices, rows, c):
    """Return how far a choice of several directions counts, 0 to 1: as far as each has a depth."""
    members, presence = choices.members[c], 1.0
    for i in range(rows):
        if members >> i & 1 and members != 1 << i:
            presence *= smooth_step(choices.depth[i] / (_ALIKE * choices.ways.length[c]))
    return presence


@inner_kernel
def _fill_distinct(choices, rows, count):
    """Fill how far each choice counts and differs from those before it, of no more directions.

    A direction that begins to overlap doubles all choices: each with it and without.
    """
    for c in range(count):
        distinct = _presence(choices, rows, c)
        for other in range(c):
            off = 0.0
            for i in range(rows):
                off = max(off, abs(choices.needed[c, i] - choices.needed[other, i]))
            same = 1.0 - smooth_step(off / (_ALIKE * choices.ways.length[other]))
            distinct *= 1.0 - choices.distinct[other] * same
        choices.distinct[c] = distinct


@inner_kernel
def fill_shares(choices, rows, count):
    """Fill how far each choice is distinct, and how far it is dominated by no other."""
    length = choices.ways.length
    _fill_distinct(choices, rows, count)
    for c in range(count):
        choices.alone[c] = 1.0
        for i in range(rows):
            if not choices.members[c] >> i & 1 and choices.depth[i] > 0.0:
                counts = smooth_step(choices.depth[i] / (_COUNTS * length[c]))
                choices.alone[c] *= 1.0 - counts * choices.needed[c, i] / choices.depth[i]
    for c in range(count):
        own = 1.0
        for other in range(count):
            if other == c:
                continue
            more = choices.distinct[other] * _domination(choices, rows, c, other)
            if more > 0.0:
                ratio = (length[c] / length[other] - 1.0) / LONGER
                longer = smooth_step(ratio)
                alone = choices.alone[other] * smooth_step(ratio + 1.0)
                own *= 1.0 - more * (longer + alone - longer * alone)
        choices.own[c] = own * presence_of(choices, rows, c)


@inner_kernel
def presence_of(choices, rows, c):
    """Return how far a choice counts by the presence of its directions, 0 to 1."""
    presence = 1.0
    for i in range(rows):
        if choices.members[c] >> i & 1:
            presence *= choices.presence[i]
    return presence


@inner_kernel
def _is_duplicate(choices, rows, count):
    """Return whether choice `count` has the same distances as one before it."""
    for c in range(count):
        same = True
        for i in range(rows):
            same = same and choices.needed[c, i] == choices.needed[count, i]
        if same:
            return True
    return False


@inner_kernel
def list_choices(choices, rows):
    """Fill the choices short enough to count; return their number, 0 if one has no length.

    Those of few directions come first.
    """
    ways, bound, count = choices.ways, np.inf, 0
    for members in _BY_SIZE:
        if count == ways.length.size or members >= 1 << rows:
            continue
        choices.members[count] = members
        fill_needed(choices, rows, count)
        if _is_duplicate(choices, rows, count):
            continue
        most = 0.0
        for i in range(rows):
            ways.choices[count, i] = i
            most = max(most, choices.needed[count, i])
        if most == 0.0:
            return 0
        if most >= bound:
            continue
        choose_active(ways.inputs, ways.choices[count], rows, ways.shares[count])
        length = update_choice(ways.inputs, ways.choices[count], rows, ways.shares[count])
        ways.length[count] = length
        presence = _presence(choices, rows, count)
        if length < bound and presence > 0.0:
            count += 1
            if presence == 1.0 and presence_of(choices, rows, count - 1) == 1.0:
                bound = min(bound, RATIO * LONGEST * length)
    return count
