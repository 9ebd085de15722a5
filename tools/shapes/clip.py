"""Convex solids cut by planes."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
TOUCHING = 1e-10
"""Corners nearer to a plane than this lie in it [m]."""


def clipped(points: Array, planes: Iterable[tuple[Array, float]]) -> Array:
    """Return the corners (k, 3) of what planes leave of a convex solid [m].

    Parameters
    ----------
    points : (n, 3)
        Corners of the solid [m].
    planes : iterable of (normal, offset)
        Kept is where `normal . p <= offset`.
    """
    from scipy.spatial import ConvexHull  # slow to import

    for normal, offset in planes:
        above = points @ normal - offset
        beyond, within = above > TOUCHING, above < -TOUCHING
        if not beyond.any():
            continue
        # Any line from a corner within to one beyond crosses the plane inside the solid, and
        # among the crossings are those of its edges: the hull needs no more.
        a, b = points[within][:, None], points[beyond][None]
        share = above[within][:, None] / (above[within][:, None] - above[beyond][None])
        crossings = (a + share[..., None] * (b - a)).reshape(-1, 3)
        points = np.concatenate([points[~beyond], crossings])
        scaled = (points - points.mean(axis=0)) / np.ptp(points)
        points = points[ConvexHull(scaled).vertices]
    return points
