"""The way out of a body among facets: the smooth minimum over choices of directions.

See `mesh_choices` for the choices, `potential` and `ways_out` for the smooth minimum of their
lengths.
"""

from __future__ import annotations

import numpy as np

from asperity._core.kernels import inner_kernel
from asperity.contact.broad_phase.facet_bvh import DIRECTIONS
from asperity.contact.manifold.separation import LONGEST
from asperity.contact.response.mesh_choices import (
    LONGER,
    collect_directions,
    fill_needed,
    fill_shares,
    fill_widths,
    list_choices,
    presence_of,
)
from asperity.contact.response.ways_out import RATIO, fill_alike, update_choice

_STEP = 1e-5
"""Relative step of the central differences."""
_SAME = 1e-12
"""Relative difference between two ways out that are equal up to rounding."""
_ABSENT, _LOWEST, _HIGHEST = 0, 1, 2
"""A deferred direction left out, or at the lower or the upper bound of its depth."""


@inner_kernel
def _update(choices, rows, count):
    """Solve all choices again for changed inputs; fill shares and S."""
    ways = choices.ways
    fill_widths(choices, rows)
    for c in range(count):
        fill_needed(choices, rows, c)
        ways.length[c] = update_choice(ways.inputs, ways.choices[c], rows, ways.shares[c])
    fill_shares(choices, rows, count)
    fill_alike(ways, rows, count)


@inner_kernel
def _excess(choices, count, s):
    """Return the sum over choices minus 1, which is 0 at the smooth minimum s.

    Choices that are alike count once, however their shares are divided among them. What a choice
    has lost to others that are alike is among their shares.
    """
    ways, distinct, own = choices.ways, choices.distinct, choices.own
    for c in range(count):
        x = max(RATIO - ways.length[c] / s, 0.0) / (RATIO - 1.0)
        ways.weight[c] = x * x
    total = 0.0
    for c in range(count):
        share = own[c] * distinct[c]
        if share * ways.weight[c] > 0.0:
            alike = 0.0
            for d in range(count):
                if d != c:
                    alike += ways.alike[c, d] * own[d] * distinct[d] * ways.weight[d]
            missing = (distinct[c] - share) * ways.weight[c]
            total += share * ways.weight[c] ** 2 / (share * ways.weight[c] + max(missing, alike))
    return total - 1.0


@inner_kernel
def _smooth_minimum(choices, rows, count):
    """Return s, by the secant method with bisection."""
    least = longest = np.inf
    for c in range(count):
        if choices.own[c] * choices.distinct[c] > 0.0:
            least = min(least, choices.ways.length[c])
            if presence_of(choices, rows, c) == 1.0:
                longest = min(longest, choices.ways.length[c])
    if count == 1:
        return least
    longest = least if longest == np.inf else longest
    low, high, below = least / RATIO, LONGEST * longest, -1.0
    above = _excess(choices, count, high)
    if not above > 0.0:
        return least
    s = least
    for step in range(80):
        s = low - below * (high - low) / (above - below)
        if step % 3 == 2 or not low < s < high:
            s = 0.5 * (low + high)
        value = _excess(choices, count, s)
        if value > 0.0:
            high, above = s, value
        else:
            low, below = s, value
        if value == 0.0 or high - low < 1e-14 * least:
            break
    return s


@inner_kernel
def _keep_contributing(choices, rows, count, s):
    """Keep the choices that contribute at s; return their number.

    Almost equal choices, such as with and without a direction of no depth, cancel each other's
    share. Then s is the least length itself, and its gradient that of the first.
    """
    ways, kept = choices.ways, 0
    for c in range(count):
        # Choices beyond RATIO have no weight, but may reduce the share of one that has.
        if ways.length[c] >= RATIO / (1.0 - LONGER) * s or (kept > 0 and ways.length[0] == s):
            continue
        if ways.length[c] == s and choices.own[c] * choices.distinct[c] > 0.0:
            kept = 0
        if kept != c:
            choices.members[kept], ways.length[kept] = choices.members[c], ways.length[c]
            for i in range(rows):
                ways.shares[kept, i] = ways.shares[c, i]
        kept += 1
    return kept


@inner_kernel
def _rise(choices, values, i, change, rows, count, s):
    """Return by how much the excess at s rises from `values[i]` less `change` to that plus it.

    `values` is one of the arrays of `choices`, or a row of one.
    """
    was = values[i]
    values[i] = was + change
    _update(choices, rows, count)
    rise = _excess(choices, count, s)
    values[i] = was - change
    _update(choices, rows, count)
    rise -= _excess(choices, count, s)
    values[i] = was
    return rise


@inner_kernel
def _fill_width_rates(space, rows, count, s, by_s):
    """Fill the derivatives of the way out by volumes and heights of the regions."""
    choices, is_partial = space.choices, False
    for i in range(rows):
        is_partial = is_partial or 0.0 < choices.presence[i] < 1.0 or 0.0 < choices.width[i] < 1.0
    if choices.are_solid[0] or not is_partial:
        return
    for i in range(rows):
        direction, height = space.directions[choices.number[i]], choices.height[i]
        change = _STEP * choices.volume[i]
        rise = _rise(choices, choices.volume, i, change, rows, count, s)
        direction.volume_rate = -rise / (2.0 * change * by_s)
        if height > choices.depth[i]:
            change = min(_STEP * height, 0.5 * (height - choices.depth[i]))
            rise = _rise(choices, choices.height, i, change, rows, count, s)
            direction.height_rate = -rise / (2.0 * change * by_s)


@inner_kernel
def _fill_rates(space, rows, count, s):
    """Fill the derivatives of the way out by depths, normals and residuals."""
    choices, inputs = space.choices, space.choices.ways.inputs
    step = _STEP * s
    rise = _excess(choices, count, s + step)
    by_s = (rise - _excess(choices, count, s - step)) / (2.0 * step)
    _fill_width_rates(space, rows, count, s, by_s)
    for i in range(rows):
        direction = space.directions[choices.number[i]]
        if choices.depth[i] > 0.0:
            rise = _rise(choices, choices.depth, i, step, rows, count, s)
            direction.rate = -rise / (2.0 * step * by_s)
        for k in range(3):
            rise = _rise(choices, inputs[i], 3 + k, _STEP, rows, count, s)
            direction.turn[k] = -rise / (2.0 * _STEP * by_s)
        part = choices.presence[i]
        if choices.are_solid[0] and 0.0 < part < 1.0:
            change = min(_STEP, 0.5 * min(part, 1.0 - part))
            rise = _rise(choices, choices.presence, i, change, rows, count, s)
            direction.presence_rate = -rise / (2.0 * change * by_s)
        for j in range(rows):
            one, two, was = choices.number[i], choices.number[j], choices.residual[i, j]
            if i == j or was <= 0.0 or was >= 1.0:
                continue  # its slope is 0 too
            change = min(_STEP, 0.5 * min(was, 1.0 - was))
            rise = _rise(choices, choices.residual[i], j, change, rows, count, s)
            space.residuals.rate[one, two] = -rise / (2.0 * change * by_s)


@inner_kernel
def _only_active_direction(choices, rows):
    """Return the only active direction of the first choice if it is a member of it; else -1."""
    only = -1
    for i in range(rows):
        if choices.ways.shares[0, i] != 0.0:
            if only >= 0 or not choices.members[0] >> i & 1:
                return -1
            only = i
    return only


@inner_kernel
def _length(raised, space):
    """Return the way out of a body [m]; fill the choices of the directions that count.

    The numbers of directions and of choices are returned with it.
    """
    choices, rows = space.choices, collect_directions(raised, space)
    if rows <= 1:
        return (choices.depth[0] if rows == 1 else 0.0), rows, 0
    count = list_choices(choices, rows)
    if count == 0:
        return 0.0, rows, 0
    _update(choices, rows, count)
    return _smooth_minimum(choices, rows, count), rows, count


@inner_kernel
def fill_way_out(raised, space):
    """Return the way out of a body [m]; fill its derivatives.

    `raised` is the height of both textures above the smooth surfaces [m]. The derivatives are the
    rates and `turn` of the `space.directions`, and `space.residuals.rate`.
    """
    choices = space.choices
    s, rows, count = _length(raised, space)
    if rows == 1:
        space.directions[choices.number[0]].rate = 1.0
    if count == 0:
        return s
    count = _keep_contributing(choices, rows, count, s)
    only = _only_active_direction(choices, rows) if count == 1 else -1
    if only >= 0:
        space.directions[choices.number[only]].rate = 1.0
        return s
    _update(choices, rows, count)
    _fill_rates(space, rows, count, s)
    return s


@inner_kernel
def _length_at_bounds(raised, space, others, one, bound):
    """Return the way out [m] with direction `one` at a bound of its depth, and others at another.

    The others are all other deferred directions.
    """
    for d in range(DIRECTIONS):
        direction = space.directions[d]
        if direction.is_deferred:
            at = bound if d == one else others
            direction.patches = 0 if at == _ABSENT else 1
            direction.depth = direction.highest if at == _HIGHEST else direction.lowest
    s = _length(raised, space)[0]
    for d in range(DIRECTIONS):
        if space.directions[d].is_deferred:
            space.directions[d].patches = 0
    return s


@inner_kernel
def depends_on_deferred(raised, space):
    """Return whether the way out depends on the deferred directions.

    It does not if it is the same without them, with all at their lower or their upper bounds, and
    with one of them at the other bound.
    """
    directions, none = space.directions, -1
    for d in range(DIRECTIONS):
        if directions[d].is_deferred and directions[d].highest == np.inf:
            return True
    s = _length_at_bounds(raised, space, _ABSENT, none, _ABSENT)
    for others in (_LOWEST, _HIGHEST):
        if abs(_length_at_bounds(raised, space, others, none, others) - s) > _SAME * s:
            return True
    for others in (_LOWEST, _HIGHEST):
        for d in range(DIRECTIONS):
            if not directions[d].is_deferred:
                continue
            other = _LOWEST + _HIGHEST - others
            if abs(_length_at_bounds(raised, space, others, d, other) - s) > _SAME * s:
                return True
    return False
