"""Storage of the neighbour lists: facet pairs, and the motion for which they stay valid."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, small_kernel
from asperity._core.records import copy_record
from asperity._core.structures import by_reference
from asperity.contact.broad_phase.facet_pairs import STACK

MAX_LISTED = 32768
"""Maximum number of pairs in a list."""
FIRST_WIDTH = 4.0
"""Skin of the first outer list, in skins of the inner list."""
FIRST_VISITS = 5000.0
"""Box pairs that the traversal for the first outer list is expected to visit."""

EMPTY, OVERFLOWED = -1, -2
"""Values of `count` and `stack_size`: no list; more pairs than there is room for."""

LIST_STATE = np.dtype(
    [
        ("max_depth", "f8"),  # largest smooth overlap of listed facets [m]
        ("reach", "f8"),  # their largest distance, along B's normal and in its plane [m]
        ("skin", "f8"),  # motion of the tool up to which the list is valid [m]
        ("count", "i8"),  # number of pairs, or EMPTY or OVERFLOWED
        ("transform", "f8", (3, 4)),  # from the tool's frame to the body's when it was built
    ],
    align=True,
)
"""Limits and state of a list of pairs with one body."""

PENDING_STATE = np.dtype(
    [
        ("stack_size", "i8"),  # box pairs still to be visited, or EMPTY or OVERFLOWED
        ("visits", "i8"),  # box pairs visited so far
        ("expected_visits", "f8"),  # box pairs that the traversal is expected to visit
        ("width", "f8"),  # skin of the list, in skins of the inner list
    ],
    align=True,
)
"""Progress of the interrupted BVH traversal that fills the pending list of one body."""


@by_reference
class PairList(NamedTuple):
    """Facet pairs of the tool with each body of the scene."""

    pairs: NDArray[np.int64]
    """Facet of the tool, facet of the body; (bodies, MAX_LISTED, 2)."""
    state: NDArray[np.void]
    """`LIST_STATE` records, (bodies,)."""
    needed_at: NDArray[np.float64]
    """Smallest `NeighbourList.travelled` at which a pair may belong to the inner list [m],
    (bodies, MAX_LISTED); (bodies, 0) in the inner list itself."""


@by_reference
class NeighbourList(NamedTuple):
    """The Verlet lists of a tool with each body of the scene; see `neighbour_list`."""

    inner: PairList
    """Tested in every tick."""
    outer: PairList
    """Wider; the inner list is rebuilt from it."""
    pending: PairList
    """The next outer list, partly filled."""
    pending_state: NDArray[np.void]
    """`PENDING_STATE` records, (bodies,)."""
    stack: NDArray[np.int64]
    """Box pairs still to be visited for the pending list, (bodies, STACK, 2)."""
    travelled: NDArray[np.float64]
    """Sum over rebuilds of the inner list of the tool's motion and the widening of the limits [m],
    (bodies,)."""


def neighbour_list(bodies: int) -> NeighbourList:
    """Allocate empty lists for a scene of `bodies` bodies."""
    lists = NeighbourList(
        inner=_pair_list(bodies, 0),
        outer=_pair_list(bodies, MAX_LISTED),
        pending=_pair_list(bodies, MAX_LISTED),
        pending_state=np.zeros(bodies, PENDING_STATE),
        stack=np.zeros((bodies, STACK, 2), np.int64),
        travelled=np.zeros(bodies),
    )
    clear_lists(lists)
    return lists


def _pair_list(bodies: int, measured: int) -> PairList:
    """Allocate a list; `measured` is its number of columns of `needed_at`."""
    return PairList(
        pairs=np.zeros((bodies, MAX_LISTED, 2), np.int64),
        state=np.zeros(bodies, LIST_STATE),
        needed_at=np.zeros((bodies, measured)),
    )


def clear_lists(lists: NeighbourList) -> None:
    """Empty all lists, so that the next tick traverses the BVH."""
    lists.inner.state["count"] = EMPTY
    lists.outer.state["count"] = EMPTY
    lists.pending_state["stack_size"] = EMPTY
    lists.pending_state["expected_visits"] = FIRST_VISITS
    lists.pending_state["width"] = FIRST_WIDTH
    lists.travelled[:] = 0.0


@inner_kernel
def copy_transform(transform, transform_out):
    """Copy a rotation and translation (3, 4)."""
    for i in range(3):
        for k in range(4):
            transform_out[i, k] = transform[i, k]


@inner_kernel
def copy_list(source, b, count, list_out):
    """Copy the first `count` pairs of body `b`, and their `LIST_STATE`, to another list."""
    copy_record(list_out.state[b], source.state[b])
    for i in range(count):
        for k in range(2):
            list_out.pairs[b, i, k] = source.pairs[b, i, k]
        list_out.needed_at[b, i] = source.needed_at[b, i]


@small_kernel
def append_pair(pairs, b, count, f, g):
    """Append a pair to those of body `b` if there is room; return `count + 1` in any case."""
    if count < MAX_LISTED:
        pairs[b, count, 0], pairs[b, count, 1] = f, g
    return count + 1
