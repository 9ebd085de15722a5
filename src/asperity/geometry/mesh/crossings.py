"""Detection of triangles of a surface that intersect each other.

Two triangles cross where a side of one pierces the other. Candidates are found by sweeping their
bounding boxes along one axis. Triangles that share a vertex, only touch, or are coplanar are not
counted.
"""

from __future__ import annotations

import numpy as np

from asperity._core.arrays import Array, Indices, Mask
from asperity.geometry.mesh.checks import extents_of

MAX_FACES = 20_000
"""Largest number of triangles for which crossings are searched."""
_MAX_PAIRS = 40_000_000
_CHUNK = 500_000
_TOUCH = 1e-6


def crossing_triangles(triangles: Array, at: Indices) -> int | None:
    """Return the number of triangles (m, 3, 3) that cross another; None for too large a mesh.

    Parameters
    ----------
    triangles : (m, 3, 3) array
    at : (m, 3) array
        Places of the corners.
    """
    if len(triangles) > MAX_FACES:
        return None
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    # The sweep along the axis with the relatively shortest boxes finds the fewest pairs.
    spread = np.maximum(extents_of(triangles.reshape(-1, 3)), 1e-300)
    axis = int(np.argmin((high - low).mean(axis=0) / spread))
    order = np.argsort(low[:, axis], kind="stable")
    triangles, at, low, high = triangles[order], at[order], low[order], high[order]
    after = np.searchsorted(low[:, axis], high[:, axis], side="right")
    count = after - np.arange(len(after)) - 1
    if count.sum() > _MAX_PAIRS:
        return None
    crossed = np.zeros(len(triangles), dtype=bool)
    touch = _TOUCH * spread.max()
    ends = np.cumsum(count)
    begin = 0
    while begin < len(count):
        done = ends[begin - 1] if begin else 0
        end = max(begin + 1, int(np.searchsorted(ends, done + _CHUNK)))
        first = np.repeat(np.arange(begin, end), count[begin:end])
        within = np.arange(len(first)) - np.repeat(
            ends[begin:end] - count[begin:end] - done, count[begin:end]
        )
        second = first + 1 + within
        near = (low[first] <= high[second]).all(axis=1) & (low[second] <= high[first]).all(axis=1)
        first, second = first[near], second[near]
        apart = (at[first][:, :, None] != at[second][:, None]).all(axis=(1, 2))
        first, second = first[apart], second[apart]
        cross = _cross(triangles[first], triangles[second], touch)
        crossed[first[cross]] = crossed[second[cross]] = True
        begin = end
    return int(crossed.sum())


def _cross(a: Array, b: Array, touch: float) -> Mask:
    """Return which pairs of triangles pierce each other by more than `touch`."""
    over_b, over_a = _above(b, a), _above(a, b)
    parted = [(side.min(axis=1) < -touch) & (side.max(axis=1) > touch) for side in (over_a, over_b)]
    found = parted[0] & parted[1]
    which = np.flatnonzero(found)
    a, b, over_a, over_b = a[which], b[which], over_a[which], over_b[which]
    found[which] = _pierces(a, over_b, b, touch) | _pierces(b, over_a, a, touch)
    return found


def _above(plane: Array, points: Array) -> Array:
    """Return the signed distances of corners (n, 3, 3) from the planes of triangles (n, 3, 3)."""
    normal = np.cross(plane[:, 1] - plane[:, 0], plane[:, 2] - plane[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = normal / np.where(length > 0.0, length, 1.0)
    return np.einsum("ijk,ik->ij", points - plane[:, :1], normal)


def _pierces(lines: Array, over: Array, plane: Array, touch: float) -> Mask:
    """Return whether a side of `lines` passes through the inside of `plane`; `over` as `_above`."""
    found = np.zeros(len(lines), dtype=bool)
    normal = np.cross(plane[:, 1] - plane[:, 0], plane[:, 2] - plane[:, 0])
    for k in range(3):
        p, q = lines[:, k], lines[:, (k + 1) % 3]
        dp, dq = over[:, k], over[:, (k + 1) % 3]
        parted = (np.minimum(dp, dq) < -touch) & (np.maximum(dp, dq) > touch)
        rise = np.where(parted, dp - dq, 1.0)
        x = p + (dp / rise)[:, None] * (q - p)
        inside = parted
        for c in range(3):
            side = plane[:, (c + 1) % 3] - plane[:, c]
            inward = np.cross(normal, side)
            length = np.linalg.norm(inward, axis=1)
            depth = np.einsum("ij,ij->i", x - plane[:, c], inward)
            inside = inside & (depth > touch * length)
        found |= inside
    return found
