"""Boxes of a best-first search, and a heap with the largest bound on top."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel
from asperity._core.structures import by_reference
from asperity.contact.narrow_phase.records import NODE, QUEUE_STATE

MAX_NODES = 131072
"""Maximum number of boxes of one search."""


@by_reference
class NodeQueue(NamedTuple):
    """Scratch memory of a best-first search, allocated once."""

    nodes: NDArray[np.void]
    """NODE records, (MAX_NODES,)."""
    heap: NDArray[np.int64]
    """Numbers of the open nodes, the one with the largest bound on top, (MAX_NODES,)."""
    keys: NDArray[np.float64]
    """Their bounds [m], (MAX_NODES,)."""
    retired: NDArray[np.int64]
    """Numbers of the nodes that a search has pruned or not divided, (MAX_NODES,)."""
    state: NDArray[np.void]
    """One QUEUE_STATE record."""


def node_queue() -> NodeQueue:
    """Return memory for a best-first search."""
    return NodeQueue(
        nodes=np.zeros(MAX_NODES, NODE),
        heap=np.zeros(MAX_NODES, np.int64),
        keys=np.zeros(MAX_NODES),
        retired=np.zeros(MAX_NODES, np.int64),
        state=np.zeros(1, QUEUE_STATE),
    )


@inner_kernel
def push(heap, keys, size, number, key):
    """Push a node onto a heap of `size` nodes, whose largest key is on top."""
    at = size
    while at > 0:
        above = (at - 1) >> 1
        if keys[above] >= key:
            break
        keys[at], heap[at] = keys[above], heap[above]
        at = above
    keys[at], heap[at] = key, number


@inner_kernel
def pop(heap, keys, size):
    """Remove the top of a heap of `size` nodes."""
    key, number = keys[size - 1], heap[size - 1]
    last = size - 1
    at = 0
    while True:
        child = 2 * at + 1
        if child >= last:
            break
        if child + 1 < last and keys[child + 1] > keys[child]:
            child += 1
        if keys[child] <= key:
            break
        keys[at], heap[at] = keys[child], heap[child]
        at = child
    keys[at], heap[at] = key, number
