"""Kernels for the overlap of two surfaces of triangles, seen along a direction.

Two triangles that face each other along n overlap where, in projection along n, one is above the
other: the *overlap* at a point is how far a's must rise along n to leave b's. It is linear over
the polygon that the projections share; area, volume and centroid are integrated exactly, so they
depend on the surfaces and not on how these are divided into triangles.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, kernel

_FACING = 0.2
"""Least cosine between a triangle's normal and the direction that it faces."""
_OPPOSITE = 0.5
"""Least cosine between a triangle's normal and that opposite to another's for both to part along
their mean. A side wall does not part from the slopes of a texture."""


@kernel
def near_pairs(a, b, motion, pairs, ways, reach):
    """Return of pairs of nodes (n, 2) whether descendants may overlap, (n,).

    Parameters
    ----------
    a, b : LevelTree
    motion : RigidMotion
        From the frame of `a` into that of `b`.
    pairs : (n, 2) int64 array
    ways : (m, 3) array
        Directions, unit, in b's frame, along one of which they overlap; none if none is known.
    reach : float
        Largest overlap [m].
    """
    out = np.zeros(len(pairs), np.bool_)
    apart = np.empty(3)
    for p in range(len(pairs)):
        i, j = pairs[p, 0], pairs[p, 1]
        square = 0.0
        for k in range(3):
            apart[k] = b.middles[j, k] - motion.translation[k]
            for m in range(3):
                apart[k] -= motion.rotation[k, m] * a.middles[i, m]
            square += apart[k] ** 2
        both = a.radii[i] + b.radii[j]
        if square > (both + reach) ** 2:
            continue
        out[p] = len(ways) == 0
        for w in range(len(ways)):
            rise = 0.0
            for k in range(3):
                rise += apart[k] * ways[w, k]
            aside = square - rise * rise
            # A direction of a finer level may lean by 30 degrees from that of this one.
            if -both < rise < both + reach and aside < (both + 0.5 * reach) ** 2:
                out[p] = True
    return out


@inner_kernel
def _axes(n, out):
    """Write two unit vectors perpendicular to n, and n, to the rows of `out`."""
    low = 0
    for k in range(1, 3):
        if abs(n[k]) < abs(n[low]):
            low = k
    size = 0.0
    for k in range(3):
        out[0, k] = (1.0 if k == low else 0.0) - n[low] * n[k]
        size += out[0, k] ** 2
    for k in range(3):
        out[0, k] /= math.sqrt(size)
        out[2, k] = n[k]
    for k in range(3):
        one, two = (k + 1) % 3, (k + 2) % 3
        out[1, k] = n[one] * out[0, two] - n[two] * out[0, one]


@inner_kernel
def _along(axes, triangle, out):
    for i in range(3):
        for k in range(3):
            out[i, k] = 0.0
            for m in range(3):
                out[i, k] += axes[k, m] * triangle[i, m]


@inner_kernel
def _moved(motion, triangle, out):
    for i in range(3):
        for k in range(3):
            out[i, k] = motion.translation[k]
            for m in range(3):
                out[i, k] += motion.rotation[k, m] * triangle[i, m]


@inner_kernel
def _turned(motion, v, out):
    for k in range(3):
        out[k] = 0.0
        for m in range(3):
            out[k] += motion.rotation[k, m] * v[m]


@inner_kernel
def _cut(polygon, count, x, y, h, c, spare):
    """Keep the part of a polygon where `x u + y v + h overlap + c >= 0`; return its corners.

    Rows are (u, v, height of b, overlap).
    """
    kept = 0
    for i in range(count):
        one, other = polygon[i], polygon[(i + 1) % count]
        at = x * one[0] + y * one[1] + h * one[3] + c
        then = x * other[0] + y * other[1] + h * other[3] + c
        if at >= 0.0:
            for k in range(4):
                spare[kept, k] = one[k]
            kept += 1
        if (at < 0.0) != (then < 0.0):
            share = at / (at - then)
            for k in range(4):
                spare[kept, k] = one[k] + share * (other[k] - one[k])
            kept += 1
    for i in range(kept):
        for k in range(4):
            polygon[i, k] = spare[i, k]
    return kept


@inner_kernel
def _shared(a, b, cap, polygon, spare):
    """Write the polygon over which a triangle overlaps another by 0 to `cap`; return its corners.

    Both are given along `_axes`. Rows of `polygon` and `spare`, (12, 4), are those of `_cut`.
    """
    for k in range(2):
        if max(a[0, k], a[1, k], a[2, k]) <= min(b[0, k], b[1, k], b[2, k]):
            return 0
        if max(b[0, k], b[1, k], b[2, k]) <= min(a[0, k], a[1, k], a[2, k]):
            return 0
    if min(a[0, 2], a[1, 2], a[2, 2]) >= max(b[0, 2], b[1, 2], b[2, 2]):
        return 0
    ux, uy, uz = a[1, 0] - a[0, 0], a[1, 1] - a[0, 1], a[1, 2] - a[0, 2]
    vx, vy, vz = a[2, 0] - a[0, 0], a[2, 1] - a[0, 1], a[2, 2] - a[0, 2]
    twice = ux * vy - uy * vx
    if twice == 0.0:
        return 0
    # Height of a's plane over (u, v), and from it the overlap at the corners of b.
    along, across = (uz * vy - uy * vz) / twice, (ux * vz - uz * vx) / twice
    for i in range(3):
        polygon[i, 0], polygon[i, 1], polygon[i, 2] = b[i, 0], b[i, 1], b[i, 2]
        below = a[0, 2] + along * (b[i, 0] - a[0, 0]) + across * (b[i, 1] - a[0, 1])
        polygon[i, 3] = b[i, 2] - below
    count = 3
    side = 1.0 if twice > 0.0 else -1.0
    for i in range(3):
        one, other = a[i], a[(i + 1) % 3]
        x, y = -side * (other[1] - one[1]), side * (other[0] - one[0])
        count = _cut(polygon, count, x, y, 0.0, -x * one[0] - y * one[1], spare)
        if count < 3:
            return 0
    count = _cut(polygon, count, 0.0, 0.0, 1.0, 0.0, spare)
    if count < 3:
        return 0
    return _cut(polygon, count, 0.0, 0.0, -1.0, cap, spare)


@inner_kernel
def _integrate(polygon, count, axes, out):
    """Add a polygon to area, volume, volume times place (3), and largest overlap, `out[:6]`."""
    for i in range(1, count - 1):
        p, q, r = polygon[0], polygon[i], polygon[i + 1]
        area = 0.5 * abs(
            (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
        )  # fmt: skip
        total = p[3] + q[3] + r[3]
        out[0] += area
        out[1] += area * total / 3.0
        for c in range(3):
            # The place is half way between the two surfaces.
            x = p[c] - (0.5 * p[3] if c == 2 else 0.0)
            y = q[c] - (0.5 * q[3] if c == 2 else 0.0)
            z = r[c] - (0.5 * r[3] if c == 2 else 0.0)
            moment = total * (x + y + z) + p[3] * x + q[3] * y + r[3] * z
            for k in range(3):
                out[2 + k] += area / 12.0 * moment * axes[c, k]
    for i in range(count):
        out[5] = max(out[5], polygon[i, 3])


@kernel
def pair_directions(a, b, motion, pairs, cap):
    """Return the direction in which each pair of triangles parts, and the overlap along it, (n, 4).

    The direction, unit, is that of b's normal less a's, in b's frame; the overlap a volume [m^3]. A
    pair that does not face each other has the direction 0 or the volume 0.

    Parameters
    ----------
    a, b, motion, pairs
        As for `near_pairs`.
    cap : float
        Larger overlaps do not count [m].
    """
    out = np.zeros((len(pairs), 4))
    axes, normal = np.empty((3, 3)), np.empty(3)
    whole, one, other = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    polygon, spare, sums = np.empty((12, 4)), np.empty((12, 4)), np.empty(6)
    for p in range(len(pairs)):
        i, j = pairs[p, 0], pairs[p, 1]
        _turned(motion, a.normals[i], normal)
        size, facing = 0.0, 0.0
        for k in range(3):
            out[p, k] = b.normals[j, k] - normal[k]
            size += out[p, k] ** 2
            facing -= normal[k] * b.normals[j, k]
        if size < 1e-12:
            out[p, :3] = 0.0
            continue
        for k in range(3):
            out[p, k] /= math.sqrt(size)
        if facing < _OPPOSITE:
            continue
        _axes(out[p, :3], axes)
        _moved(motion, a.triangles[i], whole)
        _along(axes, whole, one)
        _along(axes, b.triangles[j], other)
        count = _shared(one, other, cap, polygon, spare)
        if count >= 3:
            sums[:] = 0.0
            _integrate(polygon, count, axes, sums)
            out[p, 3] = sums[1]
    return out


@kernel
def overlap_along(a, b, motion, pairs, n, cap):
    """Return sums over pairs of triangles that overlap along n, (10,).

    Area [m^2], volume [m^3], place in b's frame times volume (3), largest overlap [m]; then for a
    and for b, area times deviation [m^3] and area times deviation times size [m^5].

    Parameters
    ----------
    a, b, motion, pairs, cap
        As for `pair_directions`.
    n : (3,) array
        Unit, in b's frame.
    """
    out = np.zeros(10)
    axes, normal = np.empty((3, 3)), np.empty(3)
    whole, one, other = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    polygon, spare = np.empty((12, 4)), np.empty((12, 4))
    _axes(n, axes)
    for p in range(len(pairs)):
        i, j = pairs[p, 0], pairs[p, 1]
        _turned(motion, a.normals[i], normal)
        below, above = 0.0, 0.0
        for k in range(3):
            below -= normal[k] * n[k]
            above += b.normals[j, k] * n[k]
        if below < _FACING or above < _FACING:
            continue
        _moved(motion, a.triangles[i], whole)
        _along(axes, whole, one)
        _along(axes, b.triangles[j], other)
        count = _shared(one, other, cap, polygon, spare)
        if count < 3:
            continue
        before = out[0]
        _integrate(polygon, count, axes, out)
        area = out[0] - before
        out[6] += area * a.deviations[i]
        out[7] += area * a.deviations[i] * a.sizes[i]
        out[8] += area * b.deviations[j]
        out[9] += area * b.deviations[j] * b.sizes[j]
    return out
