"""What is left of the overlap of one direction once the tool has left by another.

Across a convex edge the same overlap is seen from two sides, and leaving by one side leaves nothing
of the other. The walls of a groove are two contacts, and both have to be left. Which of the two it
is follows from the geometry alone: the tool is moved out along direction c, until the bodies,
raised by the height of their textures, are apart there, and the volume of what is then left of
direction d is compared to what it was. The *residual* rises smoothly from 0 to 1 with that ratio.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import clear, inner_kernel
from asperity._core.stack import stack_array
from asperity.contact.broad_phase.facet_bvh import DIRECTIONS
from asperity.contact.manifold.overlap_region import clip_pair, piece_volume
from asperity.contact.manifold.region_gradient import add_piece_gradient
from asperity.contact.manifold.separation import smooth_step, smooth_step_slope

_GONE, _STAYS = 0.05, 0.25
"""Parts of the volume between which a residual rises from 0 to 1."""
_ANYWHERE = 1e3
"""Depth that no pair of facets exceeds [m]."""


class Residuals(NamedTuple):
    """What is left of each direction once the tool has left by another."""

    value: NDArray[np.float64]
    """Residual of the direction of the row, given that of the column; nan if unknown; (6, 6)."""
    slope: NDArray[np.float64]
    """Its derivative by the ratio of the volumes, (6, 6)."""
    rate: NDArray[np.float64]
    """Derivative of the way out by the residual [m], (6, 6)."""


def residuals() -> Residuals:
    """Allocate memory for the residuals of one body."""
    return Residuals(*(np.zeros((DIRECTIONS, DIRECTIONS)) for _ in range(3)))


@inner_kernel
def _fill_shift(region, direction, c, reach):
    """Fill how far the tool moves to leave by direction `c`; return the distance [m]."""
    away = max(region.sums[c].deepest + reach, 0.0)
    for k in range(3):
        region.shift[k] = away * direction.normal[k]
    return away


@inner_kernel
def fill_residual(table, count, d, c, reach, space):
    """Fill the residual of direction `d`, given that the tool leaves by direction `c`.

    `count` is the number of pairs of facets, `reach` the height of both textures [m].
    """
    region, found = space.region, space.residuals
    _fill_shift(region, space.directions[c], c, reach)
    left = 0.0
    for i in range(count):
        f, g = region.facets.pairs[i, 0], region.facets.pairs[i, 1]
        if table.shares[g, d] == 0.0:
            continue
        piece = clip_pair(table, f, g, reach, reach, _ANYWHERE, region)
        if piece[1] >= 3:
            left += table.shares[g, d] * piece_volume(piece, reach, region)
    clear(region.shift)
    x = (left / region.sums[d].volume - _GONE) / (_STAYS - _GONE)
    found.value[d, c] = smooth_step(x)
    found.slope[d, c] = smooth_step_slope(x) / (_STAYS - _GONE)


@inner_kernel
def add_residual_gradient(table, count, pair, reach, centre, space, gradient_io):
    """Add how the way out changes with the tool's motion by a residual.

    Parameters
    ----------
    count : int
        Number of pairs of facets.
    pair : tuple of int
        Directions d and c: see `fill_residual`.
    reach : float
        Height of both textures [m].
    centre : (3,) array
        About which the tool turns, B's frame [m].
    space : FacetSpace
        The derivatives by the normal of direction c and by the volume of d are added to.
    gradient_io : (6,) array
        By translation and rotation, B's frame.
    """
    d, c = pair
    region, found, direction = space.region, space.residuals, space.directions[c]
    rate = found.rate[d, c] * found.slope[d, c]
    if rate == 0.0:
        return
    away = _fill_shift(region, direction, c, reach)
    volume, left = region.sums[d].volume, 0.0
    q, gradient = stack_array((6,)), stack_array((6,))
    clear(q)
    clear(gradient)
    for i in range(count):
        f, g = region.facets.pairs[i, 0], region.facets.pairs[i, 1]
        if table.shares[g, d] == 0.0:
            continue
        piece = clip_pair(table, f, g, reach, reach, _ANYWHERE, region)
        if piece[1] < 3:
            continue
        left += table.shares[g, d] * piece_volume(piece, reach, region)
        q[0] = rate * table.shares[g, d] / volume
        add_piece_gradient(table, (f, g), piece, reach, q, centre, region, gradient)
    clear(region.shift)
    space.directions[d].volume_rate -= rate * left / (volume * volume)
    for k in range(6):
        gradient_io[k] += gradient[k]
    by_away, sums = 0.0, region.sums[c]
    for k in range(3):
        direction.turn[k] += away * gradient[k]
        by_away += direction.normal[k] * gradient[k]
    if away == 0.0:
        return
    m, p = sums.deepest_slope, sums.deepest_point
    for k in range(3):
        one, two = (k + 1) % 3, (k + 2) % 3
        gradient_io[k] -= by_away * m[k]
        gradient_io[3 + k] -= by_away * (
            (p[one] - centre[one]) * m[two] - (p[two] - centre[two]) * m[one]
        )
