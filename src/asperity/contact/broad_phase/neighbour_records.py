"""What is noted of facets that were near: pairs of them in rings, and for how long they hold."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.broad_phase.facet_pairs import STACK

MAX_NOTED = 8192
OUTER = 4.0
"""So many times as far as those of the inner ring facets of the outer one are looked for."""
FIRST_VISITS = 5000.0
"""Pairs of boxes that the first outer ring is thought to take."""

# Of `PairList.holds`.
NEAR, REACH, SPARE, COUNT = 0, 1, 2, 3
# Of `NotedFacets.progress`.
TOP, VISITS, USUAL, TIMES = 0, 1, 2, 3
NONE, TOO_MANY = -1.0, -2.0
"""Instead of a count, or of how much there is to be gone through: why there is none."""


class PairList(NamedTuple):
    """Pairs of facets of a tool and of each body of the scene, and for how long they hold."""

    pairs: NDArray[np.int64]
    """(bodies, n, 2)"""
    holds: NDArray[np.float64]
    """For what depths, and how far sideways [m]; until the tool has moved so far [m]; how many
    there are, or why there are none. (bodies, 4)"""
    way: NDArray[np.float64]
    """From the tool's frame to the body's when they were noted, (bodies, 3, 4)."""
    beyond: NDArray[np.float64]
    """How far the tool will have moved, at least, when a pair may be one of the inner ring [m],
    (bodies, n); of the inner ring itself nothing."""


class NotedFacets(NamedTuple):
    """What facets of a tool were near each body of the scene, and for how long that holds."""

    inner: PairList
    outer: PairList
    coming: PairList
    """The next outer ring, as far as it is there."""
    progress: NDArray[np.float64]
    """Of the next outer ring: how many pairs of boxes are still to be gone through, how many were,
    and how many were for the last one; and how many times as far it reaches. (bodies, 4)"""
    stack: NDArray[np.int64]
    """Those pairs of boxes, (bodies, 512, 2)."""
    travelled: NDArray[np.float64]
    """How far the tool has moved from note to note, and what is near has widened [m], (bodies,)."""


def noted_facets(bodies: int) -> NotedFacets:
    """Return room for the facets near so many bodies; none are noted."""
    noted = NotedFacets(
        inner=_ring(bodies, 0),
        outer=_ring(bodies, MAX_NOTED),
        coming=_ring(bodies, MAX_NOTED),
        progress=np.zeros((bodies, 4)),
        stack=np.zeros((bodies, STACK, 2), np.int64),
        travelled=np.zeros(bodies),
    )
    note_nothing(noted)
    return noted


def _ring(bodies: int, measured: int) -> PairList:
    """Return a ring with no pairs in it, for so many of which is known when they may be near."""
    return PairList(
        np.zeros((bodies, MAX_NOTED, 2), np.int64),
        np.zeros((bodies, 4)),
        np.zeros((bodies, 3, 4)),
        np.zeros((bodies, measured)),
    )


def note_nothing(noted: NotedFacets) -> None:
    """Forget what facets were near."""
    noted.inner.holds[:, COUNT] = NONE
    noted.outer.holds[:, COUNT] = NONE
    noted.progress[:, TOP] = NONE
    noted.progress[:, USUAL], noted.progress[:, TIMES] = FIRST_VISITS, OUTER
    noted.travelled[:] = 0.0


@inner_kernel
def keep_way(way, way_out):
    """Copy rotation and shift (3, 4)."""
    for i in range(3):
        for k in range(4):
            way_out[i, k] = way[i, k]


@inner_kernel
def keep_ring(ring, b, count, ring_out):
    """Let a body have `count` pairs of one ring in another."""
    for k in range(4):
        ring_out.holds[b, k] = ring.holds[b, k]
    for i in range(count):
        for k in range(2):
            ring_out.pairs[b, i, k] = ring.pairs[b, i, k]
        ring_out.beyond[b, i] = ring.beyond[b, i]
    keep_way(ring.way[b], ring_out.way[b])


@small_kernel
def keep_pair(pairs, b, kept, f, g):
    """Put a pair among those of a body, if there is room; return how many are wanted by now."""
    if kept < MAX_NOTED:
        pairs[b, kept, 0], pairs[b, kept, 1] = f, g
    return kept + 1
