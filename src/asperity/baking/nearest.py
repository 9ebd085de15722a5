"""The nearest place of a surface of triangles, and how far away it is."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from asperity._core.kernels import kernel
from asperity.geometry.mesh.topology import crosses

Array = NDArray[np.float64]
_SAMPLES = 200_000
_AT_ONCE = 100_000
_LOOKS, _MORE_LOOKS = 6, 48
_DOUBTED = 0.02
"""Of the longest part of a triangle: distances above it are looked at again."""


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
        area = 0.5 * np.linalg.norm(crosses(triangles), axis=1).sum()
        self._wide = 2.0 * math.sqrt(max(area, 1e-300) / _SAMPLES)
        spread, self._owner = _spread(triangles, self._wide)
        self._tree = KDTree(spread)

    def to(self, points: Array) -> tuple[NDArray[np.int64], Array]:
        """Return the nearest triangle to each point (n, 3), and its distance [m]."""
        best, away = np.zeros(len(points), dtype=np.int64), np.zeros(len(points))
        for start in range(0, len(points), _AT_ONCE):
            part = slice(start, start + _AT_ONCE)
            self._look(points[part], _LOOKS, best[part], away[part])
            # Where needles crowd, the nearest triangle may not be among the first few.
            doubt = np.flatnonzero(away[part] > _DOUBTED * self._wide)
            face, again = np.zeros(len(doubt), dtype=np.int64), np.zeros(len(doubt))
            self._look(points[part][doubt], _MORE_LOOKS, face, again)
            best[part][doubt], away[part][doubt] = face, again
        return best, away

    def _look(
        self, points: Array, looks: int, face_out: NDArray[np.int64], away_out: Array
    ) -> None:
        """Fill in the nearest of the triangles with the samples nearest to each point."""
        looks = min(looks, len(self._owner))
        found = np.asarray(self._tree.query(points, k=looks)[1]).reshape(len(points), looks)
        _nearest(self._triangles, points, self._owner[found], face_out, away_out)


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


def _spread(triangles: Array, wide: float) -> tuple[Array, NDArray[np.int64]]:
    """Return the middles of the triangles' parts, none longer than `wide`, and whose part each is.

    A triangle is halved across its longest side: parts of a needle are short needles.
    """
    owner = np.arange(len(triangles))
    points, owners = [], []
    while len(owner):
        sides = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
        whole = sides.max(axis=1) <= wide
        points.append(triangles[whole].mean(axis=1))
        owners.append(owner[whole])
        triangles, owner, sides = triangles[~whole], owner[~whole], sides[~whole]
        turn = (np.argmax(sides, axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(triangles, turn[:, :, None], axis=1), 1, 0)
        middle = 0.5 * (a + b)
        triangles = np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
        owner = np.tile(owner, 2)
    return np.concatenate(points), np.concatenate(owners)
