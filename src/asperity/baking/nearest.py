"""Nearest triangle of a surface, and the distance to it."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial import KDTree

from asperity._core.arrays import Array, Indices
from asperity._core.kernels import kernel
from asperity.geometry.mesh.topology import crosses

_SAMPLES = 200_000
_AT_ONCE = 100_000
_CANDIDATES, _MORE_CANDIDATES = 6, 48
_UNCERTAIN = 0.02
"""Distances above this share of the sample spacing are computed again with more candidates."""


class Nearest:
    """Nearest-triangle queries to a surface.

    Candidates are the triangles with the nearest samples of points spread over all of them. A
    distance may be too large by a small fraction of the distance between samples, never too small.

    Parameters
    ----------
    triangles : (m, 3, 3) array
        Their corners [m].
    """

    def __init__(self, triangles: Array) -> None:
        self._triangles = np.ascontiguousarray(triangles)
        area = 0.5 * np.linalg.norm(crosses(triangles), axis=1).sum()
        self._wide = 2.0 * math.sqrt(max(area, 1e-300) / _SAMPLES)
        spread, self._owner = spread_points(triangles, self._wide)
        self._tree = KDTree(spread)

    def to(self, points: Array) -> tuple[Indices, Array]:
        """Return the nearest triangle to each point (n, 3) and its distance [m]."""
        best, away = np.zeros(len(points), dtype=np.int64), np.zeros(len(points))
        for start in range(0, len(points), _AT_ONCE):
            part = slice(start, start + _AT_ONCE)
            self._fill_nearest(points[part], _CANDIDATES, best[part], away[part])
            # Among crowded slivers the nearest triangle may not be among the first few candidates.
            uncertain = np.flatnonzero(away[part] > _UNCERTAIN * self._wide)
            face, again = np.zeros(len(uncertain), dtype=np.int64), np.zeros(len(uncertain))
            self._fill_nearest(points[part][uncertain], _MORE_CANDIDATES, face, again)
            best[part][uncertain], away[part][uncertain] = face, again
        return best, away

    def _fill_nearest(
        self, points: Array, candidates: int, face_out: Indices, away_out: Array
    ) -> None:
        """Fill the nearest of the triangles whose samples are nearest to each point."""
        candidates = min(candidates, len(self._owner))
        found = np.asarray(self._tree.query(points, k=candidates, workers=-1)[1]).reshape(
            len(points), candidates
        )
        fill_nearest(self._triangles, points, self._owner[found], face_out, away_out)


@kernel
def fill_nearest(triangles, points, near, face_out, away_out):
    """Fill the nearest of the triangles in `near` (n, k) to each point, and its distance."""
    for i in range(len(points)):
        least, best = np.inf, near[i, 0]
        for j in range(near.shape[1]):
            square = _square_distance(triangles[near[i, j]], points[i])
            if square < least:
                least, best = square, near[i, j]
        face_out[i], away_out[i] = best, np.sqrt(least)


@kernel
def _square_distance(triangle, point):
    """Return the squared distance of a point from a triangle."""
    aa, ab, bb, pa, pb = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        a, b = triangle[1, k] - triangle[0, k], triangle[2, k] - triangle[0, k]
        p = point[k] - triangle[0, k]
        aa, ab, bb = aa + a * a, ab + a * b, bb + b * b
        pa, pb = pa + p * a, pb + p * b
    det = aa * bb - ab * ab
    if det > 1e-14 * aa * bb:
        s, t = (bb * pa - ab * pb) / det, (aa * pb - ab * pa) / det
        if s >= 0.0 and t >= 0.0 and s + t <= 1.0:
            square = 0.0
            for k in range(3):
                at = (1.0 - s - t) * triangle[0, k] + s * triangle[1, k] + t * triangle[2, k]
                square += (point[k] - at) ** 2
            return square
    least = np.inf
    for i in range(3):
        start, end = triangle[i], triangle[(i + 1) % 3]
        along, length = 0.0, 0.0
        for k in range(3):
            along += (point[k] - start[k]) * (end[k] - start[k])
            length += (end[k] - start[k]) ** 2
        s = min(max(along / max(length, 1e-300), 0.0), 1.0)
        square = 0.0
        for k in range(3):
            square += (point[k] - start[k] - s * (end[k] - start[k])) ** 2
        least = min(least, square)
    return least


def spread_points(triangles: Array, wide: float) -> tuple[Array, Indices]:
    """Return the centres of parts of the triangles, none longer than `wide`, and their triangles.

    A triangle is bisected at its longest side, so parts of a sliver are short slivers.
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
