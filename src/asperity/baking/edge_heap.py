"""A binary heap of the edges of a mesh, the cheapest on top, for compiled kernels.

An edge is a row (u, v, stamp) of `heap`, its cost the entry of `keys`; the stamp shows whether the
edge has changed since it was stored.
"""

from __future__ import annotations

from asperity._core.kernels import kernel


@kernel
def push(heap, keys, size, cost, u, v, stamp):
    """Store an edge and return the new size; the arrays must have room for it."""
    i = size
    while i > 0:
        parent = (i - 1) // 2
        if keys[parent] <= cost:
            break
        keys[i] = keys[parent]
        heap[i] = heap[parent]
        i = parent
    keys[i] = cost
    heap[i, 0], heap[i, 1], heap[i, 2] = u, v, stamp
    return size + 1


@kernel
def pop(heap, keys, size, out):
    """Move the cheapest edge into `out` and return the new size."""
    out[0], out[1], out[2] = heap[0, 0], heap[0, 1], heap[0, 2]
    size -= 1
    key, u, v, stamp = keys[size], heap[size, 0], heap[size, 1], heap[size, 2]
    i = 0
    while True:
        child = 2 * i + 1
        if child >= size:
            break
        if child + 1 < size and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= key:
            break
        keys[i] = keys[child]
        heap[i] = heap[child]
        i = child
    keys[i] = key
    heap[i, 0], heap[i, 1], heap[i, 2] = u, v, stamp
    return size
