"""Sheets: displaced points with normals, as a grid or as patches of triangles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity.geometry.poses import rotation_of


class Sheet(NamedTuple):
    """Displaced points with unit normals.

    Without `corners` the points are a grid. With `corners` each row of points is a patch of
    triangles.
    """

    points: Array
    """[m], (a, b, 3)."""
    normals: Array
    """Unit normals for lighting, (a, b, 3)."""
    corners: Indices | None = None
    """Points of each triangle of a patch, the same in all patches, (n, 3)."""
    height: Array | None = None
    """Height of the texture at the points [m], (a, b); None: no texture."""
    face: Indices | None = None
    """Of a mesh: triangle on which each row of points lies, (a,)."""
    weights: Array | None = None
    """Of a mesh: weights of the triangle's corners at the points, (a, b, 3)."""

    def placed(self, pose: Array) -> Sheet:
        """Return the sheet in world axes, if it is in the frame of a body at a pose (7,)."""
        turn = rotation_of(pose[3:]).T
        return self._replace(points=self.points @ turn + pose[:3], normals=self.normals @ turn)

    def triangles(self) -> Indices:
        """Return triangles (m, 3) as indices of the points, counted row by row."""
        rows, columns = self.points.shape[:2]
        if self.corners is None:
            return grid_triangles(rows, columns)
        first = columns * np.arange(rows)[:, None, None]
        return (self.corners[None] + first).reshape(-1, 3).astype(np.int64)


def grid_triangles(rows: int, columns: int) -> Indices:
    """Return two triangles for each cell of a grid of points, (m, 3)."""
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij")
    a = (i * columns + j).ravel()
    b, c, d = a + 1, a + columns, a + columns + 1
    return np.concatenate([np.stack([a, c, d], axis=1), np.stack([a, d, b], axis=1)])


def facing_outwards(points: Array, normals: Array, faces: Indices) -> Indices:
    """Return triangles oriented so that each faces the mean normal of its corners.

    Parameters
    ----------
    points, normals : (n, 3) arrays
    faces : (m, 3) array
    """
    a, b, c = np.moveaxis(points[faces], 1, 0)
    facing = np.sum(np.cross(b - a, c - a) * normals[faces].sum(axis=1), axis=1)
    return np.where(facing[:, None] < 0.0, faces[:, ::-1], faces)


def displace(base: Array, w: Array, height: Array) -> tuple[Array, Array]:
    """Return a grid of displaced points [m], and their unit normals, which follow from neighbours.

    Parameters
    ----------
    base, w : (a, b, 3) arrays
        Points of the smooth surface [m] and their unit normals.
    height : (a, b) array
        Of the texture [m].
    """
    points = base + height[..., None] * w
    normals = np.cross(np.gradient(points, axis=0), np.gradient(points, axis=1))
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    side = np.sum(normals * w, axis=-1, keepdims=True)
    pole = (length < 1e-30) | (side == 0.0)  # of a ball
    return points, np.where(pole, w, normals * np.sign(side) / np.where(pole, 1.0, length))
