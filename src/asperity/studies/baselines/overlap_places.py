"""Kernels for the place of a contact: the middle of the region where two features (nearly) touch.

A feature is a convex polygon, an edge or a vertex: the rows of an array (k, 3). Two features are
compared along a unit direction n. Over the overlap of their projections along n the gap between
them is linear; its least value is `low`. A point where the gap is low + g counts with the weight
1 - g / band, so the place of a flat contact moves steadily from the middle of the overlap to an
edge or a corner as the features are tilted.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, kernel

MOST_CORNERS = 24
"""Corners that a clipped polygon has room for, beyond those of both features."""
_ON = 1e-9
"""A corner this near to the side of a polygon is on it [m]."""


@inner_kernel
def dot(a, b):
    """Return the scalar product of two vectors (3,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner_kernel
def cross(a, b, out):
    """Write the vector product of two vectors (3,) to `out`."""
    x = a[1] * b[2] - a[2] * b[1]
    y = a[2] * b[0] - a[0] * b[2]
    z = a[0] * b[1] - a[1] * b[0]
    out[0], out[1], out[2] = x, y, z


@kernel
def turning(polygon, n):
    """Return twice the signed area of a polygon (k, 3) projected along n."""
    total = 0.0
    part = np.empty(3)
    for i in range(1, polygon.shape[0] - 1):
        cross(polygon[i] - polygon[0], polygon[i + 1] - polygon[0], part)
        total += dot(part, n)
    return total


@kernel
def _cut(values, polygon, count, out):
    """Keep the part of a polygon where `values` at its corners are at most 0; return its corners.

    `polygon` is read, `out` written, both (most, 3); Sutherland & Hodgman (1974).
    """
    kept = 0
    for i in range(count):
        j = (i + 1) % count
        if values[i] <= 0.0:
            out[kept] = polygon[i]
            kept += 1
        if (values[i] < 0.0 < values[j]) or (values[j] < 0.0 < values[i]):
            s = values[i] / (values[i] - values[j])
            for k in range(3):
                out[kept, k] = polygon[i, k] + s * (polygon[j, k] - polygon[i, k])
            kept += 1
    return kept


@kernel
def clip(feature, other, n, out):
    """Clip a feature (k, 3) by the sides of a polygon, along n; return the number of corners.

    Parameters
    ----------
    feature : (k, 3) array
        A polygon, an edge or a vertex.
    other : (m, 3) array
        A convex polygon.
    n : (3,) array
    out : (2, most, 3) array
        Scratch; the corners are in `out[0]`.
    """
    count = feature.shape[0]
    out[0, :count] = feature
    sign = 1.0 if turning(other, n) > 0.0 else -1.0
    values, wall = np.empty(out.shape[1]), np.empty(3)
    for i in range(other.shape[0]):
        side = other[(i + 1) % other.shape[0]] - other[i]
        cross(side, n, wall)
        size = math.sqrt(dot(wall, wall))
        if size == 0.0:
            continue
        for j in range(count):
            off = sign * (dot(wall, out[0, j]) - dot(wall, other[i])) / size
            # A corner on the side must not be cut off by rounding.
            values[j] = 0.0 if abs(off) < _ON else off
        count = _cut(values, out[0], count, out[1])
        out[0, :count] = out[1, :count]
        if count == 0:
            break
    return count


@kernel
def add_measures(polygon, gaps, count, low, band, sums):
    """Add area, length and number of a clipped feature, and their moments, to sums.

    Parameters
    ----------
    polygon, gaps, count : (most, 3) array, (most,) array, int
        Corners, and the gap at each [m].
    low, band : float
        [m]. A gap of low + band or more has no weight.
    sums : (3, 4) array
        Increased. Rows: weighted area, length, number. Columns: the measure, its moments.
    """
    far, one, two = -1.0, 0, 0
    for i in range(count):
        for j in range(i, count):
            size = 0.0
            for k in range(3):
                size += (polygon[i, k] - polygon[j, k]) ** 2
            if size > far:
                far, one, two = size, i, j
    weights = np.empty(count)
    for i in range(count):
        weights[i] = min(max(1.0 - (gaps[i] - low) / band, 0.0), 1.0)
    normal = np.empty(3)
    for i in range(1, count - 1):
        cross(polygon[i] - polygon[0], polygon[i + 1] - polygon[0], normal)
        third = math.sqrt(dot(normal, normal)) / 24.0
        total = weights[0] + weights[i] + weights[i + 1]
        sums[0, 0] += 4.0 * third * total
        for k in range(3):
            a, b, c = polygon[0, k], polygon[i, k], polygon[i + 1, k]
            sums[0, k + 1] += third * (
                total * (a + b + c) + weights[0] * a + weights[i] * b + weights[i + 1] * c
            )
    u, v = weights[one], weights[two]
    far = math.sqrt(max(far, 0.0))
    sums[1, 0] += 0.5 * far * (u + v)
    sums[2, 0] += 0.5 * (u + v)
    for k in range(3):
        a, b = polygon[one, k], polygon[two, k]
        sums[1, k + 1] += far / 6.0 * (u * (2.0 * a + b) + v * (a + 2.0 * b))
        sums[2, k + 1] += 0.25 * (u + v) * (a + b)


@kernel
def _crossing_place(one, other, n, out):
    """Write where two edges (2, 3) pass each other, seen along n, to `out[0]` on `one`.

    Return the number of corners: two, the overlap of parallel edges, or one. An edge that is not
    parallel to the other has its nearest point within the edge.
    """
    u, v, w, flat = one[1] - one[0], other[1] - other[0], other[0] - one[0], np.empty(3)
    for x in (u, v, w):
        along = dot(x, n)
        for k in range(3):
            x[k] -= along * n[k]
    cross(u, v, flat)
    uu, under = dot(u, u), dot(flat, n)
    if uu == 0.0:
        out[0, 0] = one[0]
        return 1
    if abs(under) < 1e-3 * math.sqrt(uu * dot(v, v)):
        s, t = dot(w, u) / uu, (dot(w, u) + dot(v, u)) / uu
        first, last = max(min(s, t), 0.0), min(max(s, t), 1.0)
        if first <= last:
            for k in range(3):
                out[0, 0, k] = one[0, k] + first * (one[1, k] - one[0, k])
                out[0, 1, k] = one[0, k] + last * (one[1, k] - one[0, k])
            return 2
        s = 0.5 * (first + last)
    else:
        cross(w, v, flat)
        s = dot(flat, n) / under
    s = min(max(s, 0.0), 1.0)
    for k in range(3):
        out[0, 0, k] = one[0, k] + s * (one[1, k] - one[0, k])
    return 1


@kernel
def touching_part(one, other, n, out, gaps):
    """Find where two features are over each other along n; return its number of corners.

    Parameters
    ----------
    one, other : (k, 3), (m, 3) arrays
        Features [m]: vertices, edges, or polygons that are nearly perpendicular to n.
    n : (3,) array
        Unit direction from `other` to `one`.
    out : (2, most, 3) array
        Scratch; the corners, on `other` where that is not a polygon, else on `one`, in `out[0]`.
    gaps : (most,) array
        Filled: distance from `other` to `one` along n at the corners [m].
    """
    normal = np.empty(3)
    if other.shape[0] >= 3:
        count, base, sign = clip(one, other, n, out), other, 1.0
    elif one.shape[0] >= 3:
        count, base, sign = clip(other, one, n, out), one, -1.0
    else:
        if one.shape[0] == 2 and other.shape[0] == 2:
            count = _crossing_place(one, other, n, out)
        elif one.shape[0] == 1:
            out[0, 0], count = one[0], 1
        else:
            out[0, 0], count = other[0], 1
        for i in range(count):
            gaps[i] = -math.inf
        return count
    normal[:] = 0.0
    part = np.empty(3)
    for i in range(1, base.shape[0] - 1):
        cross(base[i] - base[0], base[i + 1] - base[0], part)
        normal += part
    along = dot(normal, n)
    for i in range(count):
        gaps[i] = sign * dot(out[0, i] - base[0], normal) / along
    return count


@kernel
def keep_near(out, gaps, count, most):
    """Cut off the part of a region whose gap is over `most` [m]; return its number of corners.

    `out` and `gaps` are those of `touching_part`, and stay in step.
    """
    values = np.empty(count)
    outside = False
    for i in range(count):
        values[i] = gaps[i] - most
        outside = outside or values[i] > 0.0
    if not outside:
        return count
    if count == 1:
        return 0
    kept, limit = 0, gaps.size
    cut = np.empty(limit)
    for i in range(count):
        j = (i + 1) % count
        if values[i] <= 0.0:
            out[1, kept], cut[kept] = out[0, i], gaps[i]
            kept += 1
        if (values[i] < 0.0 < values[j]) or (values[j] < 0.0 < values[i]):
            s = values[i] / (values[i] - values[j])
            for k in range(3):
                out[1, kept, k] = out[0, i, k] + s * (out[0, j, k] - out[0, i, k])
            cut[kept] = most
            kept += 1
    out[0, :kept], gaps[:kept] = out[1, :kept], cut[:kept]
    return kept


@kernel
def middle_of(sums, width, out):
    """Write the middle of what was added to `sums` to `out` (3,); return its area [m^2].

    It is that of the area; of the length where there is no area, which counts with a `width` [m];
    else the mean of the points.
    """
    row, area = 2, 0.0
    if sums[0, 0] > 1e-7 * sums[1, 0] ** 2:
        row, area = 0, sums[0, 0]
    elif sums[1, 0] > 1e-9 * sums[2, 0]:
        row, area = 1, width * sums[1, 0]
    for k in range(3):
        out[k] = sums[row, k + 1] / max(sums[row, 0], 1e-300)
    return area
