"""The curve along which two triangle meshes cross: its segments, vector area and middle.

Both are independent of how the surfaces are divided into triangles, unlike means over pairs of
triangles. By Stokes' theorem the vector area that a closed curve spans,

    S = 1/2 sum of p x q    over its segments p -> q,

is the integral of the normal over the part of one surface that is inside the other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def crossing_segments(one: Array, other: Array) -> Array:
    """Return the segments along which pairs of triangles cross.

    Parameters
    ----------
    one, other : (k, 3, 3) arrays
        Corners of both triangles of each pair, counter-clockwise as seen from outside [m].

    Returns
    -------
    (j, 2, 3) array
        Ends [m] of the segments of those pairs that cross. Each runs so that the inside of `one`
        is on its left as seen from outside `other`.
    """
    n_one, n_other = _normals(one), _normals(other)
    along = np.cross(n_other, n_one)
    length = np.linalg.norm(along, axis=1)
    skew = length > 1e-9
    one, other, n_one, n_other = one[skew], other[skew], n_one[skew], n_other[skew]
    along = along[skew] / length[skew, None]
    cut_one = _cut(one, other[:, 0], n_other, along)
    cut_other = _cut(other, one[:, 0], n_one, along)
    low = np.maximum(cut_one[0], cut_other[0])
    high = np.minimum(cut_one[1], cut_other[1])
    cross = high > low
    low, high, along = low[cross, None], high[cross, None], along[cross]
    begin, start = cut_one[0][cross, None], cut_one[2][cross]
    return np.stack([start + (t - begin) * along for t in (low, high)], axis=1)


def _normals(triangles: Array) -> Array:
    """Return the unit normals (k, 3) of triangles."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    n = np.cross(b - a, c - a)
    return np.asarray(n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-300))


def _cut(triangles: Array, place: Array, n: Array, along: Array) -> tuple[Array, Array, Array]:
    """Return where planes cut triangles: from, to [m] along `along`, and the first point (k, 3).

    A plane goes through `place` (k, 3) across `n` (k, 3). Without a cut, to is below from.
    """
    away = np.einsum("kij,kj->ki", triangles - place[:, None], n)
    far = np.roll(away, -1, axis=1)
    crosses = (away < 0.0) != (far < 0.0)
    share = away / np.where(crosses, away - far, 1.0)
    points = triangles + share[..., None] * (np.roll(triangles, -1, axis=1) - triangles)
    t = np.einsum("kij,kj->ki", points, along)
    low, high = np.where(crosses, t, np.inf), np.where(crosses, t, -np.inf)
    first = np.take_along_axis(points, np.argmin(low, axis=1)[:, None, None], axis=1)[:, 0]
    return low.min(axis=1), high.max(axis=1), first


def vector_area(segments: Array) -> Array:
    """Return the vector area (3,) [m^2] that closed curves of segments (k, 2, 3) span."""
    if not len(segments):
        return np.zeros(3)
    # About their middle, so that a segment that is missing matters little.
    p, q = np.moveaxis(segments - segments.mean(axis=(0, 1)), 1, 0)
    return np.asarray(0.5 * np.cross(p, q).sum(axis=0))


def middle_of(points: Array, n: Array) -> Array:
    """Return the centroid (3,) of the convex hull of points (k, 3), seen along a unit normal n.

    Where they lie on a line, the middle of it. Height along n is the mean.
    """
    mean = points.mean(axis=0)
    u = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
    frame = np.array([u / np.linalg.norm(u), np.cross(n, u / np.linalg.norm(u))])
    flat = (points - mean) @ frame.T
    hull = _hull(flat)
    a, b = hull, np.roll(hull, -1, axis=0)
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    size = float(np.ptp(flat, axis=0).max())
    if cross.sum() > 1e-6 * size**2:
        centre = ((a + b) * cross[:, None]).sum(axis=0) / (3.0 * cross.sum())
    else:
        centre = 0.5 * (hull.min(axis=0) + hull.max(axis=0))
        if len(hull) > 1:
            # Of the two ends of a line.
            far = hull[np.argmax(np.linalg.norm(hull - hull[0], axis=1))]
            centre = 0.5 * (hull[0] + far)
    return np.asarray(mean + centre @ frame)


def _hull(points: Array) -> Array:
    """Return the corners (j, 2) of the convex hull, counter-clockwise (Andrew's chains)."""
    rows = np.unique(points, axis=0)

    def chain(ordered: Array) -> list[Array]:
        out: list[Array] = []
        for p in ordered:
            while len(out) > 1:
                (ax, ay), (bx, by) = out[-1] - out[-2], p - out[-2]
                if ax * by - ay * bx > 0.0:
                    break
                out.pop()
            out.append(p)
        return out

    if len(rows) < 3:
        return rows
    return np.array(chain(rows)[:-1] + chain(rows[::-1])[:-1])
