"""Choices of directions by which a tool leaves a body among facets.

Each direction has a depth delta_d, and residuals rho_dc: the part that remains after leaving by
direction c (`manifold.residual`). A choice C of one or more directions has to cover their full
depths, and of every other direction what remains,

    psi(n_d) . tau >= delta_d                                for d in C,
    psi(n_d) . tau >= delta_d times the product of rho_dc over C     for the others,

and the least |tau| is its length: see `potential` and `ways_out`. Against a direction that C
resolves, tau may go. At a convex edge residuals are 0, and each side is a way out. In a groove they
are 1, and all choices are equal: both walls. Everything between is continuous.

A direction whose region is much narrower than it is deep counts less. With V the volume of its
region and H the largest of its depth and of the overlap of the highest points of both textures,
what remains of it counts from V / H^3 = 0.003 on, and fully from 0.03. Its *presence* p rises in
the same way, but where none is as wide, with V / H^3 over that of the widest: it resolves p times
as much of others, and choices with it have p times their share. So directions begin and end
continuously. For convex bodies see `manifold.convex_regions`.

A choice *dominated* by a shorter one, because it has to cover all that the other covers and more,
is no separate way out. How far it is one falls to 0 as it gets longer, by up to a tenth, and
is 0 where the shorter one resolves everything.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, small_kernel
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
_WIDE, _NARROW = 0.03, 0.1
"""Volume of a region over its depth cubed from which on it is wide, and fraction of that (or of the
largest of the directions) below which it does not count."""
_AGAINST = 0.125
"""Largest distance against a resolved direction, over the depths of a choice's members.

psi(n) . psi(m) is nowhere less than -1/8.
"""
_LEAST_HEIGHT = 1e-12
"""Avoids a division by 0 [m]."""
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
    width: NDArray[np.float64]
    """How far what remains of each direction counts, 0 to 1; (6,)."""
    residual: NDArray[np.float64]
    """(6, 6)"""
    volume: NDArray[np.float64]
    """Of each direction's region [m^3], (6,)."""
    height: NDArray[np.float64]
    """Largest overlap of the highest points of both textures [m], (6,)."""
    excess: NDArray[np.float64]
    """Depth over the lower bound of it [m], (6,): 0 unless the direction is deferred."""
    are_solid: NDArray[np.bool_]
    """Whether both bodies are convex, (1,)."""


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
        width=np.zeros(DIRECTIONS),
        residual=np.zeros((DIRECTIONS, DIRECTIONS)),
        volume=np.zeros(DIRECTIONS),
        height=np.zeros(DIRECTIONS),
        excess=np.zeros(DIRECTIONS),
        are_solid=np.zeros(1, np.bool_),
    )


@small_kernel
def _width(volume, height):
    """Return the width of a region relative to its depth."""
    return volume / max(height, _LEAST_HEIGHT) ** 3


@small_kernel
def _least_width(c, raised, space):
    """Return the width of a direction's region, a lower bound of it if it is deferred."""
    sums = space.region.sums[c]
    return _width(sums.volume, max(sums.deepest + raised, space.directions[c].highest))


@inner_kernel
def is_narrow(d, raised, space):
    """Return whether direction `d` does not count, however deep it is, beside those searched."""
    sums, widest = space.region.sums[d], 0.0
    for c in range(DIRECTIONS):
        if space.directions[c].patches > 0:
            widest = max(widest, _least_width(c, raised, space))
    narrow = _NARROW * min(widest, _WIDE)
    return not space.choices.are_solid[0] and _width(sums.volume, sums.deepest + raised) <= narrow


@inner_kernel
def is_wide(c, raised, space):
    """Return whether direction `c`, searched or deferred, counts fully."""
    if space.choices.are_solid[0]:
        return space.directions[c].presence == 1.0
    widest = 0.0
    for d in range(DIRECTIONS):
        sums = space.region.sums[d]
        if sums.volume > 0.0:
            widest = max(widest, _width(sums.volume, sums.deepest + raised))
    return _least_width(c, raised, space) >= min(widest, _WIDE)


@inner_kernel
def fill_widths(choices, rows):
    """Fill presence and width of each direction, unless both bodies are convex."""
    if choices.are_solid[0]:
        return
    widest = 0.0
    for i in range(rows):
        height = max(choices.height[i], choices.depth[i] - choices.excess[i])
        choices.presence[i] = _width(choices.volume[i], height)
        widest = max(widest, choices.presence[i])
    widest = min(widest, _WIDE)
    for i in range(rows):
        width = choices.presence[i]
        choices.presence[i] = smooth_step((width / widest - _NARROW) / (1.0 - _NARROW))
        choices.width[i] = smooth_step((width / _WIDE - _NARROW) / (1.0 - _NARROW))


@inner_kernel
def collect_directions(raised, space):
    """Fill the inputs of the choices; return the number of directions.

    `raised` is the height of both textures above the smooth surfaces [m].
    """
    choices, rows = space.choices, 0
    for d in range(DIRECTIONS):
        direction = space.directions[d]
        if direction.patches > 0:
            choices.number[rows], choices.depth[rows] = d, direction.depth
            choices.presence[rows] = direction.presence
            choices.volume[rows] = space.region.sums[d].volume
            choices.height[rows] = space.region.sums[d].deepest + raised
            choices.excess[rows] = direction.depth - direction.lowest
            rows += 1
    fill_widths(choices, rows)
    kept = 0
    for i in range(rows):
        if choices.presence[i] > 0.0:
            for values in (
                choices.depth, choices.presence, choices.width, choices.volume, choices.height,
                choices.excess,
            ):  # fmt: skip
                values[kept] = values[i]
            choices.number[kept] = choices.number[i]
            kept += 1
    for i in range(kept):
        one = choices.number[i]
        for k in range(3):
            choices.ways.inputs[i, 3 + k] = space.directions[one].normal[k]
        for j in range(kept):
            choices.residual[i, j] = space.residuals.value[one, choices.number[j]]
    return kept


@inner_kernel
def fill_needed(choices, rows, c):
    """Fill the distances along all directions that choice `c` has to cover.

    Where it resolves a direction, the tool may also move against that one.
    """
    members, all_depths, are_solid = choices.members[c], 0.0, choices.are_solid[0]
    for i in range(rows):
        if members >> i & 1:
            all_depths += choices.depth[i]
    for i in range(rows):
        left = 1.0
        if not members >> i & 1:
            for j in range(rows):
                if members >> j & 1:
                    part = 1.0 if are_solid else choices.presence[j]
                    left *= 1.0 - part * (1.0 - choices.residual[i, j])
            left *= 1.0 if are_solid else choices.width[i]
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
def _sameness(choices, rows, c, other):
    """Return how far choice `c` has the distances of another one before it, 0 to 1."""
    off = 0.0
    for i in range(rows):
        off = max(off, abs(choices.needed[c, i] - choices.needed[other, i]))
    return 1.0 - smooth_step(off / (_ALIKE * choices.ways.length[other]))


@inner_kernel
def _fill_distinct(choices, rows, count):
    """Fill how far each choice counts and differs from those before it, of no more directions.

    A direction that begins to overlap doubles all choices: each with it and without.
    """
    for c in range(count):
        distinct = _presence(choices, rows, c)
        for other in range(c):
            same = choices.distinct[other] * _sameness(choices, rows, c, other)
            distinct *= 1.0 - presence_of(choices, rows, other) * same
        choices.distinct[c] = distinct


@inner_kernel
def _distinct_from(choices, rows, other, c):
    """Return how far another choice is distinct, as choice `c` sees it: as if `c` were present.

    A choice that is the same as `c` and comes after it has what `c` leaves it. So with a domination
    between them both together count once, however far `c` is present.
    """
    part = presence_of(choices, rows, c)
    if other < c or part == 1.0:
        return choices.distinct[other]
    same = choices.distinct[c] * _sameness(choices, rows, other, c)
    return choices.distinct[other] * (1.0 - same) / max(1.0 - part * same, 1e-300)


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
            more = _domination(choices, rows, c, other)
            if more > 0.0:
                more *= _distinct_from(choices, rows, other, c) * presence_of(choices, rows, other)
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
