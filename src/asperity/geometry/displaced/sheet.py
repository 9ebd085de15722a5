"""Sheets: displaced points with normals, as a grid or as patches of triangles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import kernel

Array = NDArray[np.float64]
Whole = NDArray[np.int64]


class Sheet(NamedTuple):
    """Displaced points with unit normals.

    Without `corners` the points are a grid. With `corners` each row of points is a patch of
    triangles.
    """

    points: Array
    """[m], (a, b, 3)."""
    normals: Array
    """Unit normals for lighting, (a, b, 3)."""
    corners: Whole | None = None
    """Points of each triangle of a patch, the same in all patches, (n, 3)."""
    height: Array | None = None
    """Height of the texture at the points [m], (a, b); None: no texture."""
    face: Whole | None = None
    """Of a mesh: triangle on which each row of points lies, (a,)."""
    weights: Array | None = None
    """Of a mesh: weights of the triangle's corners at the points, (a, b, 3)."""

    def triangles(self) -> Whole:
        """Return triangles (m, 3) as indices of the points, counted row by row."""
        rows, columns = self.points.shape[:2]
        if self.corners is None:
            return grid_triangles(rows, columns)
        first = columns * np.arange(rows)[:, None, None]
        return (self.corners[None] + first).reshape(-1, 3).astype(np.int64)


def grid_triangles(rows: int, columns: int) -> Whole:
    """Return two triangles for each cell of a grid of points, (m, 3)."""
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij")
    a = (i * columns + j).ravel()
    b, c, d = a + 1, a + columns, a + columns + 1
    return np.concatenate([np.stack([a, c, d], axis=1), np.stack([a, d, b], axis=1)])


def facing_outwards(points: Array, normals: Array, faces: Whole) -> Whole:
    """Return triangles oriented so that each faces the mean normal of its corners.

    Parameters
    ----------
    points, normals : (n, 3) arrays
    faces : (m, 3) array
    """
    a, b, c = np.moveaxis(points[faces], 1, 0)
    facing = np.sum(np.cross(b - a, c - a) * normals[faces].sum(axis=1), axis=1)
    return np.where(facing[:, None] < 0.0, faces[:, ::-1], faces)


@kernel
def displace(base, w, height, rotation, position, points, normals):
    """Displace a grid of points and transform it to world axes; normals follow from neighbours.

    Parameters
    ----------
    base, w : (a, b, 3) arrays
        Points of the smooth surface [m] and their unit normals, in the body's frame.
    height : (a, b) array
        Of the texture [m].
    rotation : (3, 3) array
    position : (3,) array
        Of the body's frame in the world [m].
    points, normals : (a, b, 3) arrays
        Filled.
    """
    rows, columns = height.shape
    for i in range(rows):
        for j in range(columns):
            for k in range(3):
                total = position[k]
                for m in range(3):
                    total += rotation[k, m] * (base[i, j, m] + height[i, j] * w[i, j, m])
                points[i, j, k] = total
    out = np.empty(3)
    for i in range(rows):
        up, down = min(i + 1, rows - 1), max(i - 1, 0)
        for j in range(columns):
            right, left = min(j + 1, columns - 1), max(j - 1, 0)
            ax = points[up, j, 0] - points[down, j, 0]
            ay = points[up, j, 1] - points[down, j, 1]
            az = points[up, j, 2] - points[down, j, 2]
            bx = points[i, right, 0] - points[i, left, 0]
            by = points[i, right, 1] - points[i, left, 1]
            bz = points[i, right, 2] - points[i, left, 2]
            nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
            for k in range(3):
                out[k] = (
                    rotation[k, 0] * w[i, j, 0]
                    + rotation[k, 1] * w[i, j, 1]
                    + rotation[k, 2] * w[i, j, 2]
                )
            length = np.sqrt(nx * nx + ny * ny + nz * nz)
            side = nx * out[0] + ny * out[1] + nz * out[2]
            if length < 1e-30 or side == 0.0:  # the pole of a ball
                nx, ny, nz, length, side = out[0], out[1], out[2], 1.0, 1.0
            scale = np.sign(side) / length
            normals[i, j, 0], normals[i, j, 1], normals[i, j, 2] = (
                nx * scale,
                ny * scale,
                nz * scale,
            )
