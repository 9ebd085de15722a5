"""Points of a drawn surface that move with the vertices of a deformable one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity.contact.deformable.surface import DeformableSurface
from asperity.geometry.poses import rotation_of

if TYPE_CHECKING:
    from scipy.spatial import KDTree

_NEAREST, _CHUNK = 8, 50_000
"""Number of nearest triangles among which that of a point is chosen; points handled at a time."""
_ASIDE = 0.5
"""Penalty for a triangle with another normal, over its size."""


class BentShape:
    """Points on or near a deformable surface, each attached to one of its triangles.

    A point keeps its barycentric coordinates in its triangle, and its height above it.

    Parameters
    ----------
    surface : DeformableSurface
    pose : (7,)
        Of the frame of the surface's mesh in the world.
    points, normals : (n, 3)
        [m], and unit vectors; world axes.
    """

    def __init__(
        self, surface: DeformableSurface, pose: Array, points: Array, normals: Array
    ) -> None:
        from scipy.spatial import KDTree  # slow to import, and the page starts with this module

        self._surface, self._at, self._turn = surface, pose[:3], rotation_of(pose[3:])
        local, facing = (points - self._at) @ self._turn, normals @ self._turn
        n = len(points)
        self._face: Indices = np.empty(n, np.int64)
        self._weights = np.empty((n, 3))
        tree = KDTree(surface.mesh.vertices[surface.mesh.faces].mean(axis=1))
        for first in range(0, n, _CHUNK):
            part = slice(first, first + _CHUNK)
            self._face[part], self._weights[part] = self._attach(tree, local[part], facing[part])
        self._rest = self._smooth(surface.mesh.vertices, surface.mesh.normals)
        above = local - self._rest[0]
        self._height = np.einsum("ij,ij->i", above, self._rest[1])
        self._beside = above - self._height[:, None] * self._rest[1]
        self._lit = facing

    def _attach(self, tree: KDTree, points: Array, normals: Array) -> tuple[Indices, Array]:
        """Return the triangle of each point, and its barycentric coordinates there."""
        mesh = self._surface.mesh
        near = tree.query(points, k=min(_NEAREST, len(mesh.faces)))[1].reshape(len(points), -1)
        corners = mesh.vertices[mesh.faces]
        edges = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
        local = np.einsum(
            "nkij,nkj->nki", np.linalg.pinv(edges)[near], points[:, None] - corners[near, 0]
        )
        weights = np.concatenate([1.0 - local.sum(axis=2, keepdims=True), local], axis=2)
        weights = np.maximum(weights, 0.0)
        weights /= weights.sum(axis=2, keepdims=True)
        away = np.einsum("nkc,nkci->nki", weights, corners[near]) - points[:, None]
        turned = 1.0 - np.einsum("nki,ni->nk", self._surface.normals[near], normals)
        size = np.linalg.norm(edges, axis=1).max(axis=1)[near]
        best = (np.linalg.norm(away, axis=2) + _ASIDE * size * turned).argmin(axis=1)
        rows = np.arange(len(points))
        return near[rows, best], weights[rows, best]

    def _smooth(self, vertices: Array, normals: Array) -> tuple[Array, Array]:
        """Return the points on the smooth surface, and its unit normals there."""
        corners = vertices[self._surface.mesh.faces[self._face]]
        normal = np.einsum("nc,nci->ni", self._weights, normals[self._face])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        return np.einsum("nc,nci->ni", self._weights, corners), normal

    def moved(self, displacements: Array) -> tuple[Array, Array]:
        """Return points and unit normals (n, 3) for displacements of the vertices (v, 3) [m]."""
        vertices = self._surface.mesh.vertices + displacements
        point, normal = self._smooth(vertices, self._surface.corner_normals(vertices))
        local = point + self._height[:, None] * normal + self._beside
        lit = self._lit + normal - self._rest[1]
        lit /= np.linalg.norm(lit, axis=1, keepdims=True)
        return local @ self._turn.T + self._at, lit @ self._turn.T
