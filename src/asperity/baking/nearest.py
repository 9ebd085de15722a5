"""The nearest place of a surface of triangles, and how far away it is."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from asperity.compiled import kernel
from asperity.geometry.mesh_topology import crosses

Array = NDArray[np.float64]
_SAMPLES = 200_000
_AT_ONCE = 100_000
_LOOKS = 6
_MOST_DIVISIONS = 60


class Nearest:
    """A surface that is asked for its nearest places.

    Looked at are the triangles with the nearest of samples spread over all of them. A distance may
    come out too large, by a small part of the distance between samples, never too small.

    Parameters
    ----------
    triangles : (m, 3, 3) array
        Their corners [m].
    """

    def __init__(self, triangles: Array) -> None:
        self._triangles = np.ascontiguousarray(triangles)
        spread, self._owner = _spread(triangles)
        self._tree = KDTree(spread)

    def to(self, points: Array) -> tuple[NDArray[np.int64], Array]:
        """Return the nearest triangle to each point (n, 3), and its distance [m]."""
        best, away = np.zeros(len(points), dtype=np.int64), np.zeros(len(points))
        looks = min(_LOOKS, len(self._owner))
        for start in range(0, len(points), _AT_ONCE):
            part = slice(start, start + _AT_ONCE)
            near = self._owner[self._tree.query(points[part], k=looks)[1].reshape(-1, looks)]
            _nearest(self._triangles, points[part], near, best[part], away[part])
        return best, away


@kernel
def _nearest(triangles, points, near, face_out, away_out):
    """Fill in the nearest of the triangles in `near` (n, k) to each point, and its distance."""
    for i in range(len(points)):
        least, best = np.inf, near[i, 0]
        for j in range(near.shape[1]):
            square = _square_distance(triangles[near[i, j]], points[i])
            if square < least:
                least, best = square, near[i, j]
        face_out[i], away_out[i] = best, np.sqrt(least)


@kernel
def _square_distance(triangle, point):
    """Return the squared distance of a point from a triangle: its inside, or the nearest side."""
    a, b = triangle[1] - triangle[0], triangle[2] - triangle[0]
    p = point - triangle[0]
    aa, ab, bb = np.sum(a * a), np.sum(a * b), np.sum(b * b)
    pa, pb = np.sum(p * a), np.sum(p * b)
    det = aa * bb - ab * ab
    if det > 1e-14 * aa * bb:
        s, t = (bb * pa - ab * pb) / det, (aa * pb - ab * pa) / det
        if s >= 0.0 and t >= 0.0 and s + t <= 1.0:
            return np.sum((p - s * a - t * b) ** 2)
    least = np.inf
    for k in range(3):
        start, side = triangle[k], triangle[(k + 1) % 3] - triangle[k]
        off = point - start
        s = min(max(np.sum(off * side) / max(np.sum(side * side), 1e-300), 0.0), 1.0)
        least = min(least, np.sum((off - s * side) ** 2))
    return least


def _spread(triangles: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return samples on triangles, more on larger ones, and the triangle of each."""
    sides = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2).max(axis=1)
    area = 0.5 * np.linalg.norm(crosses(triangles), axis=1).sum()
    apart = math.sqrt(max(area, 1e-300) / _SAMPLES)
    divisions = np.clip(np.ceil(sides / (2.0 * apart)), 1, _MOST_DIVISIONS).astype(np.int64)
    points, owner = [], []
    for n in np.unique(divisions):
        which = np.flatnonzero(divisions == n)
        i, j = (a.ravel() for a in np.indices((n, n)))
        i, j = i[i + j < n], j[i + j < n]
        # The middles of the parts that a triangle is evenly divided into, those that stand upright.
        weights = np.stack([n - i - j - 2.0 / 3.0, i + 1.0 / 3.0, j + 1.0 / 3.0], axis=1) / n
        points.append((weights @ triangles[which]).reshape(-1, 3))
        owner.append(np.repeat(which, len(weights)))
    return np.concatenate(points), np.concatenate(owner)
