"""Kernel that joins pairs of triangles to local minima of distance, each with its place.

In flat contact all pairs of points of the overlap are equally near: one local minimum, not one for
each pair of triangles. So pairs whose regions touch are joined in the order of their distances. Two
minima are one if the way from the one to the other rises by no more than `band` above the farther
one (their persistence); else they stay two. The place of a minimum is the middle of the region
within `band` of its distance (`overlap_places`).
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import kernel
from asperity.studies.baselines.local_minima import placed_triangle
from asperity.studies.baselines.overlap_places import (
    add_measures,
    cross,
    dot,
    keep_near,
    middle_of,
    touching_part,
)

LEVEL = 0.2
"""Sine of the angle from which on a triangle or a side is not level [-]."""
_ROOM = 30
"""Corners of two clipped triangles, and scratch."""
_KEPT = 9
_TOUCH = 1e-7
"""Regions nearer than this touch [m]."""
_SAME_WAY = 0.98
"""Least cosine between the directions of pairs that are joined."""


@kernel
def _level_part(triangle, normal, thick, x, n):
    """Return the part of a triangle that may touch along n: itself, a side, or the place x."""
    if thick == 0.0 and abs(dot(normal, n)) > math.sqrt(1.0 - LEVEL * LEVEL):
        return triangle.copy()
    out, off = np.empty((2, 3)), np.empty(3)
    for k in range(3):
        out[0], out[1] = triangle[k], triangle[(k + 1) % 3]
        e = out[1] - out[0]
        length = dot(e, e)
        if length == 0.0 or abs(dot(e, n)) > LEVEL * math.sqrt(length):
            continue
        cross(e, x - out[0], off)
        if dot(off, off) < 1e-14 * length * length:
            return out
    out[0] = x
    return out[:1].copy()


@kernel
def _separated(one, other, axis):
    """Return whether two sets of corners are apart along an axis."""
    size = math.sqrt(dot(axis, axis))
    if size < 1e-12:
        return False
    low, high, below, above = math.inf, -math.inf, math.inf, -math.inf
    for k in range(one.shape[0]):
        x = dot(one[k], axis)
        low, high = min(low, x), max(high, x)
    for k in range(other.shape[0]):
        x = dot(other[k], axis)
        below, above = min(below, x), max(above, x)
    return low - above > _TOUCH * size or below - high > _TOUCH * size


@kernel
def _touch(one, other, n):
    """Return whether two convex polygons (k, 3), seen along n, touch."""
    axis = np.empty(3)
    for polygon in (one, other):
        for k in range(polygon.shape[0]):
            e = polygon[(k + 1) % polygon.shape[0]] - polygon[k]
            cross(e, n, axis)
            if _separated(one, other, axis):
                return False
            e -= dot(e, n) * n
            if polygon.shape[0] < 3 and _separated(one, other, e):
                return False
    return True


@kernel
def _root(parents, i):
    while parents[i] != i:
        parents[i] = parents[parents[i]]
        i = parents[i]
    return i


@kernel
def _regions(a, b, motion, pairs, count, polygons, gaps):
    """Fill the regions of pairs, and the gaps at their corners; return the numbers of corners."""
    sizes = np.empty(count, np.int64)
    one, out, room = np.empty((3, 3)), np.empty((2, _ROOM, 3)), np.empty(_ROOM)
    for i in range(count):
        s, t = pairs.triangles[i, 0], pairs.triangles[i, 1]
        n, normal = pairs.directions[i], motion.rotation @ a.normals[s]
        placed_triangle(motion, a.triangles[s], one)
        first = _level_part(one, normal, a.thick[s], pairs.places[i, 0], n)
        last = _level_part(b.triangles[t], b.normals[t], b.thick[t], pairs.places[i, 1], n)
        size = min(touching_part(first, last, n, out, room), _KEPT)
        thick = a.thick[s] + b.thick[t]
        for k in range(size):
            polygons[i, k] = out[0, k]
            gaps[i, k] = room[k] - thick if room[k] > -math.inf else pairs.distances[i]
        if size == 0:
            # Beside each other: only their nearest points count.
            polygons[i, 0], gaps[i, 0], size = pairs.places[i, 1], pairs.distances[i], 1
        sizes[i] = size
    return sizes


@kernel
def _touching(pairs, count, polygons, sizes):
    """Return which pairs' regions touch (k, 2), those that are joined at a small distance first."""
    low, high = np.empty((count, 3)), np.empty((count, 3))
    for i in range(count):
        low[i], high[i] = polygons[i, 0], polygons[i, 0]
        for k in range(1, sizes[i]):
            low[i], high[i] = (
                np.minimum(low[i], polygons[i, k]),
                np.maximum(high[i], polygons[i, k]),
            )
        # Regions lie on either surface: they may be apart along the line between these.
        reach = abs(pairs.distances[i]) + 1e-9
        for c in range(3):
            more = _TOUCH + reach * abs(pairs.directions[i, c])
            low[i, c] -= more
            high[i, c] += more
    order = np.argsort(low[:, 0])
    links, found = np.empty((max(8 * count, 16), 2), np.int64), 0
    for p in range(count):
        i = order[p]
        for q in range(p + 1, count):
            j = order[q]
            if low[j, 0] > high[i, 0]:
                break
            if low[j, 1] > high[i, 1] or low[i, 1] > high[j, 1]:
                continue
            if low[j, 2] > high[i, 2] or low[i, 2] > high[j, 2]:
                continue
            n = pairs.directions[i]
            if dot(n, pairs.directions[j]) < _SAME_WAY:
                continue
            if not _touch(polygons[i, : sizes[i]], polygons[j, : sizes[j]], n):
                continue
            if found == links.shape[0]:
                more_links = np.empty((2 * found, 2), np.int64)
                more_links[:found] = links
                links = more_links
            links[found, 0], links[found, 1] = i, j
            found += 1
    weights = np.empty(found)
    for k in range(found):
        weights[k] = max(pairs.distances[links[k, 0]], pairs.distances[links[k, 1]])
    return links[np.argsort(weights)]


@kernel
def minima_of(a, b, motion, pairs, count, band):
    """Join pairs to local minima; return places (k, 2, 3), directions (k, 3) and distances (k,).

    The places are the middle of the region on the surface of `a` and on that of `b`.

    Parameters
    ----------
    a, b, motion
        As for `near_pairs`.
    pairs, count : NearPairs, int
    band : float
        Distances that differ by less count as equal [m], above 0.
    """
    polygons, gaps = np.empty((count, _KEPT, 3)), np.empty((count, _KEPT))
    sizes = _regions(a, b, motion, pairs, count, polygons, gaps)
    links = _touching(pairs, count, polygons, sizes)
    parents, births = np.arange(count), pairs.distances[:count].copy()
    for k in range(links.shape[0]):
        i, j = links[k, 0], links[k, 1]
        height = max(pairs.distances[i], pairs.distances[j])
        i, j = _root(parents, i), _root(parents, j)
        if i != j and height - max(births[i], births[j]) <= band:
            if births[j] < births[i]:
                i, j = j, i
            parents[j] = i
    lead = np.full(count, -1)
    for i in range(count):
        root = _root(parents, i)
        if pairs.strict[i] and (lead[root] < 0 or pairs.distances[i] < pairs.distances[lead[root]]):
            lead[root] = i
    number, total = np.full(count, -1), 0
    for i in range(count):
        if lead[i] >= 0:
            number[i], total = total, total + 1
    places, directions, distances = np.empty((total, 2, 3)), np.empty((total, 3)), np.empty(total)
    middle = np.empty(3)
    sums, out = np.zeros((total, 3, 4)), np.empty((2, _ROOM, 3))
    room = np.empty(_ROOM)
    for i in range(count):
        root = _root(parents, i)
        if lead[root] < 0:
            continue
        least, size = births[root], sizes[i]
        out[0, :size], room[:size] = polygons[i, :size], gaps[i, :size]
        size = keep_near(out, room, size, least + band)
        if size > 0:
            add_measures(out[0], room, size, least, band, sums[number[root]])
    for i in range(count):
        if lead[i] >= 0:
            k = number[i]
            directions[k], distances[k] = pairs.directions[lead[i]], births[i]
            middle[:] = pairs.places[lead[i], 1]
            if sums[k, 2, 0] > 0.0:
                middle_of(sums[k], 0.0, middle)
            n = directions[k]
            s, t = pairs.triangles[lead[i], 0], pairs.triangles[lead[i], 1]
            levels = (-a.thick[s], b.thick[t])
            for side in range(2):
                level = levels[side] + dot(n, pairs.places[lead[i], side]) - dot(n, middle)
                for c in range(3):
                    places[k, side, c] = middle[c] + level * n[c]
    return places, directions, distances
