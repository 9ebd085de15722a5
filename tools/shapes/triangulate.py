"""Triangles for a flat face with holes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError

Array = NDArray[np.float64]


def triangulated(loops: Sequence[Array]) -> NDArray[np.int64]:
    """Return counter-clockwise triangles (m, 3) between an outline and holes in it.

    A Delaunay triangulation holds every side of a convex outline, and of holes whose corners lie
    on an empty circle; for other outlines it may lack a side, which is refused.

    Parameters
    ----------
    loops : sequence of (n, 2)
        The outline, then the holes, running either way round.
    """
    from scipy.spatial import Delaunay  # slow to import

    points = np.concatenate(list(loops))
    # In units near 1, as Qhull's tolerances expect.
    scaled = (points - points.mean(axis=0)) / np.ptp(points)
    triangles: NDArray[np.int64] = Delaunay(scaled).simplices.astype(np.int64)
    middles = points[triangles].mean(axis=1)
    kept = _inside(loops[0], middles)
    for hole in loops[1:]:
        kept &= ~_inside(hole, middles)
    triangles = triangles[kept]
    edges = points[triangles[:, 1:]] - points[triangles[:, :1]]
    clockwise = np.linalg.det(edges) < 0.0
    triangles[clockwise] = triangles[clockwise][:, ::-1]
    expected = len(points) + 2 * len(loops) - 4
    if len(triangles) != expected:
        raise AsperityError(
            f"a face of {len(points)} corners and {len(loops) - 1} holes needs {expected} "
            f"triangles, found {len(triangles)}; its outline must be convex, holes round"
        )
    return triangles


def _inside(loop: Array, points: Array) -> NDArray[np.bool_]:
    """Return which points (m, 2) lie in a polygon: an odd number of its sides is to their right."""
    a, b = loop[:, None], np.roll(loop, -1, axis=0)[:, None]
    spans = (a[..., 1] > points[:, 1]) != (b[..., 1] > points[:, 1])
    rise = np.where(spans, b[..., 1] - a[..., 1], 1.0)
    crossing = a[..., 0] + (points[:, 1] - a[..., 1]) * (b[..., 0] - a[..., 0]) / rise
    right = spans & (points[:, 0] < crossing)
    return np.asarray(right.sum(axis=0) % 2 == 1)
