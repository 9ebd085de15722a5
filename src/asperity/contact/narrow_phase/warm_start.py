"""Which pairs of charts may hold the deepest place of a contact: few of those that meet.

The tool moves little in a tick, so where the parts of a contact were deepest they are about as
deep again. That is looked up first, and pairs that cannot reach it are left out: where a tool leans
mostly by the highest points of both facets, before the part over which they meet is cut out.
"""

from __future__ import annotations

import numpy as np

from asperity._core.kernels import inner_kernel
from asperity.contact.narrow_phase.bounds.borders import beyond_rows
from asperity.contact.narrow_phase.bounds.plane_pairs import pair_bound, summit_bound
from asperity.contact.narrow_phase.branch_and_bound import TIE
from asperity.contact.narrow_phase.displaced_surface import parameters_under
from asperity.contact.narrow_phase.newton_ascent import is_within
from asperity.contact.narrow_phase.overlap import ON_X, ON_Y, F, X, Y, overlap_at
from asperity.contact.narrow_phase.penetration import LOOK_COVERS, LOOK_SIZE, PAIR, walks_on_a
from asperity.contact.narrow_phase.surface_patch import RECTANGLE, O, Q


@inner_kernel
def is_there(cx, cy, u, v):
    """Return whether a place of the contact frame lies on both charts."""
    x, y = parameters_under(cx, u, v)
    if not (cx[RECTANGLE] <= x <= cx[RECTANGLE + 1]):
        return False
    if not (cx[RECTANGLE + 2] <= y <= cx[RECTANGLE + 3]) or beyond_rows(cx, x, y, 0.0, 0.0):
        return False
    x, y = parameters_under(cy, u, v)
    if not (cy[RECTANGLE] <= x <= cy[RECTANGLE + 1]):
        return False
    return cy[RECTANGLE + 2] <= y <= cy[RECTANGLE + 3] and not beyond_rows(cy, x, y, 0.0, 0.0)


@inner_kernel
def from_lines(a, b, at, lines):
    """Return how far a place lies from the lines that split a footprint [m].

    Of the place it is the base point on A that counts.
    """
    x, y = (at[X], at[Y]) if walks_on_a(a, b) else (at[ON_X], at[ON_Y])
    u, v = a[O] + a[Q] * x + a[Q + 1] * y, a[O + 1] + a[Q + 2] * x + a[Q + 3] * y
    return (
        lines[0, 0] * u + lines[0, 1] * v + lines[0, 2],
        lines[1, 0] * u + lines[1, 1] * v + lines[1, 2],
    )


@inner_kernel
def depths_before(textures, pairs, stride, places, parts, lines, radius, space, depths_out):
    """Fill how deep the parts of a footprint are at least: as deep as where they were deepest.

    -inf where that is not known.

    Parameters
    ----------
    pairs : int
        How many rows of `space.looks` there are.
    places : (n, 2) array
        In (u, v), nan if unknown.
    parts : (n, 2) array
        On which side of either line each part is, 1 or -1; 0: on both.
    """
    count = parts.shape[0]
    for p in range(count):
        depths_out[p] = -np.inf
    for row in range(pairs):
        look = space.looks[row]
        for p in range(count):
            u, v = places[p, 0], places[p, 1]
            if not (
                look[LOOK_COVERS] <= u <= look[LOOK_COVERS + 1]
                and look[LOOK_COVERS + 2] <= v <= look[LOOK_COVERS + 3]
            ):
                continue
            pair = int(look[PAIR])
            a, b = space.charts_a[pair // stride], space.charts_b[pair % stride]
            cx, cy = (a, b) if walks_on_a(a, b) else (b, a)
            if not is_there(cx, cy, u, v):
                continue
            x, y = parameters_under(cx, u, v)
            overlap_at(textures, cx, cy, x, y, space.work, space.at)
            if not space.at[F] > depths_out[p] or not is_within(cx, cy, space.at, space.work):
                continue
            first, second = from_lines(a, b, space.at, lines)
            if parts[p, 0] * first >= -radius and parts[p, 1] * second >= -radius:
                depths_out[p] = space.at[F]


@inner_kernel
def keep_promising(textures, pairs, stride, enough, space):
    """Bound pairs of charts, and keep those that may be deeper than `enough` [m], or as deep.

    Fills rows of `space.looks`, whose numbers of pairs are given; returns how many are left.
    """
    looks, kept = space.looks, np.int64(0)
    for row in range(pairs):
        pair = int(looks[row, PAIR])
        a, b = space.charts_a[pair // stride], space.charts_b[pair % stride]
        if summit_bound(textures, a, b) <= enough - TIE:
            continue
        cx, cy = (a, b) if walks_on_a(a, b) else (b, a)
        look = looks[kept]
        pair_bound(textures, cx, cy, space.work, look)
        # Those that do not meet are -inf deep.
        if look[0] <= enough - TIE:
            continue
        look[PAIR] = pair
        for k in range(LOOK_COVERS, LOOK_SIZE):
            look[k] = looks[row, k]
        kept += 1
    return kept
