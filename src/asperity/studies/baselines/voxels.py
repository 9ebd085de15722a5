"""Triangles to voxels, and the voxels inside to layers by their distance from the surface."""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, kernel


@kernel
def mark_triangles(points, faces, corner, size, marked_out):
    """Mark the voxels in which a triangle has a sample; samples are at most half a voxel apart.

    Parameters
    ----------
    points, faces : (n, 3), (m, 3) arrays
        Corners [m], and the three of each triangle.
    corner : (3,) array
        Low corner of the first voxel [m].
    size : float
        Side of a voxel [m].
    marked_out : (x, y, z) array of bool
        Marked voxels are set; the others are left as they are.
    """
    for n in range(faces.shape[0]):
        a, b, c = faces[n, 0], faces[n, 1], faces[n, 2]
        longest = 0.0
        for p, q in ((a, b), (b, c), (c, a)):
            side = 0.0
            for i in range(3):
                side += (points[q, i] - points[p, i]) ** 2
            longest = max(longest, side)
        parts = max(math.ceil(2.0 * math.sqrt(longest) / size), 1)
        for i in range(parts + 1):
            for j in range(parts + 1 - i):
                u, v = i / parts, j / parts
                w = 1.0 - u - v
                x = w * points[a, 0] + u * points[b, 0] + v * points[c, 0] - corner[0]
                y = w * points[a, 1] + u * points[b, 1] + v * points[c, 1] - corner[1]
                z = w * points[a, 2] + u * points[b, 2] + v * points[c, 2] - corner[2]
                marked_out[int(x / size), int(y / size), int(z / size)] = True


@inner_kernel
def _shorten(before, squares):
    """Shorten the squared distances of a layer, (rows, z), by way of its other rows.

    Parameters
    ----------
    before : (rows or more, z) array of int32
        A copy of them.
    squares : (rows, z) array of int32
        Changed.
    """
    rows, high = squares.shape
    for x in range(rows):
        # No farther than the distance can still become smaller.
        farthest = 0
        for z in range(high):
            farthest = max(farthest, before[x, z])
        k = 1
        while k * k < farthest:
            if x >= k:
                for z in range(high):
                    squares[x, z] = min(squares[x, z], before[x - k, z] + k * k)
            if x + k < rows:
                for z in range(high):
                    squares[x, z] = min(squares[x, z], before[x + k, z] + k * k)
            k += 1


@kernel
def fill_layers(inside, squares, codes_out):
    """Add to the codes of voxels inside 1 + their distance from those outside, in whole voxels.

    Parameters
    ----------
    inside : (x, y, z) array of bool
        False on all borders.
    squares : (x, y, z) array of int32
        Room for the squared distances.
    codes_out : (x, y, z) array of uint8
        At most 255 in the end.
    """
    wide, deep, high = inside.shape
    # Along z by counting; then each axis improves on the one before, no farther than it can.
    for x in range(wide):
        for y in range(deep):
            away = 0
            for z in range(high):
                away = away + 1 if inside[x, y, z] else 0
                squares[x, y, z] = away * away
            away = 0
            for z in range(high - 1, -1, -1):
                away = away + 1 if inside[x, y, z] else 0
                squares[x, y, z] = min(squares[x, y, z], away * away)
    before = np.empty((max(wide, deep), high), np.int32)
    for x in range(wide):
        before[:deep] = squares[x]
        _shorten(before, squares[x])
    for y in range(deep):
        before[:wide] = squares[:, y]
        _shorten(before, squares[:, y])
    for x in range(wide):
        for y in range(deep):
            for z in range(high):
                if inside[x, y, z]:
                    layer = math.sqrt(squares[x, y, z])
                    codes_out[x, y, z] = min(1 + math.floor(layer + 0.5), 255)
