"""Meshes that stand for scans, with what is true of them known."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from asperity.geometry.mesh.mesh import Mesh, mesh_from_arrays

Array = NDArray[np.float64]
AMPLITUDE = 1e-4
AXES = np.array([0.020, 0.016, 0.012])
"""Of the ellipsoid [m]."""


def ripples(points: Array) -> Array:
    """Return heights [m] at points (n, 3): waves through space of 5 mm, so that no seam shows."""
    x, y, z = (2.0 * np.pi / 5e-3) * points.T
    return AMPLITUDE * (np.sin(x + 0.3) * np.sin(0.8 * y) + 0.5 * np.sin(0.9 * z + 1.0)) / 1.5


def ellipsoid(subdivisions: int = 2) -> Mesh:
    """Return a low-resolution ellipsoid of 20 times 4 to the power of `subdivisions` triangles."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions, radius=1.0)
    points, faces = np.asarray(ball.vertices) * AXES, np.asarray(ball.faces)
    return mesh_from_arrays(points, faces, hard_angle=180.0)


def displaced_finely(
    low: Mesh, heights: Callable[[Array], Array], divisions: int
) -> tuple[Array, NDArray[np.int64]]:
    """Return vertices and faces of a mesh divided and moved along its interpolated normals."""
    n = divisions
    i, j = (a.ravel() for a in np.indices((n + 1, n + 1)))
    i, j = i[i + j <= n], j[i + j <= n]
    number = np.full((n + 2, n + 2), -1)
    number[i, j] = np.arange(len(i))
    up, down = i + j < n, i + j < n - 1
    corners = np.concatenate(
        [
            np.stack([number[i, j], number[i + 1, j], number[i, j + 1]], axis=1)[up],
            np.stack([number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]], axis=1)[down],
        ]
    )
    weights = np.stack([n - i - j, i, j], axis=1) / n
    base = (weights @ low.vertices[low.faces]).reshape(-1, 3)
    along = (weights @ low.normals).reshape(-1, 3)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    faces = corners[None] + len(i) * np.arange(len(low.faces))[:, None, None]
    _, first, one = np.unique(np.round(base / 1e-9), axis=0, return_index=True, return_inverse=True)
    moved = (base + heights(base)[:, None] * along)[first]
    return moved, one.reshape(-1)[faces.reshape(-1, 3)]


def write(path: Path, vertices: Array, faces: NDArray[np.int64]) -> Path:
    """Write a mesh to a file of the kind that its name says."""
    trimesh.Trimesh(vertices, faces, process=False).export(path)
    return path
