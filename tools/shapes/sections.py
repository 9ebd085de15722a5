"""Bodies drawn through cross-sections: polygons, lofts, lathes, and the convex pieces of these.

All sections of a loft have the same number of corners, and their sides keep their directions; so
the facets between two sections are flat trapezoids, and the solid between them is their hull. A
run of sections is convex when the distance of each side from the axis is a concave function of
the place along the axis; so convex pieces are found without a search.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
CONCAVE = 1e-12
"""By how much a run's distances may fail to be concave [m]: rounding."""


def polygon(angles: ArrayLike, distances: ArrayLike) -> Array:
    """Return the corners (n, 2) of a convex polygon given by its sides.

    Parameters
    ----------
    angles : (n,)
        Directions of the outward normals of its sides [rad], rising.
    distances : (n,)
        Of the sides from the origin [m]. Corner k lies between sides k and k + 1.
    """
    angles = np.asarray(angles, dtype=np.float64)
    sides = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    h = np.asarray(distances, dtype=np.float64)
    pairs = np.stack([sides, np.roll(sides, -1, axis=0)], axis=1)
    right = np.stack([h, np.roll(h, -1)], axis=1)
    return np.linalg.solve(pairs, right[..., None])[..., 0]


def circle(radius: float, corners: int) -> Array:
    """Return a regular polygon (n, 2) [m] that strays from a circle equally to both sides.

    The middle of its side 0 lies on the first axis; corner k at the angle of k + 1/2 sides.
    """
    half = math.pi / corners
    outer = 2.0 * radius / (1.0 + math.cos(half))
    angles = half * (2.0 * np.arange(corners) + 1.0)
    return outer * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def oval(semi_u: float, semi_v: float, corners: int) -> Array:
    """Return a polygon (n, 2) [m] round an ellipse; its sides have the circle's directions."""
    angles = 2.0 * math.pi * np.arange(corners) / corners
    return polygon(angles, np.hypot(semi_u * np.cos(angles), semi_v * np.sin(angles)))


def placed(section: Array, station: float, axis: str) -> Array:
    """Return a section (n, 2) as points (n, 3) [m] across the "x" or "z" axis, at `station`."""
    along = np.full(len(section), station)
    columns = (along, *section.T) if axis == "x" else (*section.T, along)
    return np.stack(columns, axis=1)


def loft(sections: Sequence[tuple[float, Array]], axis: str) -> Array:
    """Return the rings (s, n, 3) [m] of (station, section) pairs along an axis."""
    return np.stack([placed(section, station, axis) for station, section in sections])


def lathe(profile: Sequence[tuple[float, float]], corners: int, axis: str) -> Array:
    """Return the rings (s, n, 3) [m] of a turned body from its (station, radius) pairs."""
    return loft([(station, circle(radius, corners)) for station, radius in profile], axis)


def closed(rings: Array) -> Array:
    """Return rings (s, n, ..) with their first corner repeated at the end, (s, n + 1, ..)."""
    return np.concatenate([rings, rings[:, :1]], axis=1)


def convex_pieces(rings: Array, axis: str, ends: Sequence[Array] = ()) -> list[Array]:
    """Return a loft cut into convex solids, as few as one pass along it finds.

    Parameters
    ----------
    rings : (s, n, 3)
        Sections across `axis`, counter-clockwise about it [m], at rising stations.
    axis : {"x", "z"}
    ends : sequence of (3,), optional
        Tips beyond the last and first section, each added to the piece nearest to it.

    Returns
    -------
    list of (k, 3)
        Corners of the solids.
    """
    along = 0 if axis == "x" else 2
    flat = np.delete(rings, along, axis=2)
    sides = np.roll(flat[0], -1, axis=0) - flat[0]
    outwards = np.stack([sides[:, 1], -sides[:, 0]], axis=1)
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    distances = np.einsum("snk,nk->sn", flat, outwards)
    steps = np.diff(rings[:, 0, along])
    slopes = np.diff(distances, axis=0) / steps[:, None]
    pieces, first = [], 0
    for strip in range(1, len(slopes)):
        rise = (slopes[strip] - slopes[strip - 1]) * min(steps[strip], steps[strip - 1])
        if np.any(rise > CONCAVE):
            pieces.append(rings[first : strip + 1].reshape(-1, 3))
            first = strip
    pieces.append(rings[first:].reshape(-1, 3))
    for tip in ends:
        last = tip[along] > rings[0, 0, along]
        pieces[-1 if last else 0] = np.concatenate([pieces[-1 if last else 0], tip[None]])
    return pieces
