"""A mesh displaced by its texture: points and normals at barycentric coordinates of triangles."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity.geometry.bodies import Body, origin_of_map
from asperity.geometry.displaced.view import coarsened
from asperity.geometry.mesh.texture_coordinates import places_on_map
from asperity.geometry.mesh.topology import crosses, edges_of, gradients, meeting_corners

_ROUND = float(np.cos(np.radians(35.0)))
"""A corner normal within this angle of its triangle's normal is used for lighting, as on a round
surface; otherwise the triangle's own normal is, as at an edge."""


class MeshRelief:
    """A body's mesh displaced by its texture, in the body's frame.

    Parameters
    ----------
    body : Body
        With a mesh.
    spacing : float
        Relief finer than this is averaged [m].
    """

    def __init__(self, body: Body, spacing: float) -> None:
        assert body.mesh is not None
        mesh = body.mesh
        self.triangles = mesh.vertices[mesh.faces]
        """Corners of the triangles [m], (m, 3, 3)."""
        self.normals = mesh.normals
        """Unit normals along which the texture displaces, at the corners, (m, 3, 3)."""
        self._places = places_on_map(body, body.texture)
        self._lit = self._lit_normals()
        self._field = body.texture
        self._origin = origin_of_map(body)
        if body.texture is None:
            return
        if self._places is not None:
            self._slopes = gradients(self.triangles, self._places)
            # Length on the texture per length on the body.
            scale = np.linalg.norm(np.cross(self._slopes[:, 0], self._slopes[:, 1]), axis=1)
            spacing *= float(np.sqrt(np.median(scale)))
        self._field = coarsened(body.texture, spacing)

    def _lit_normals(self) -> Array:
        facet = crosses(self.triangles)
        facet /= np.maximum(np.linalg.norm(facet, axis=1, keepdims=True), 1e-300)
        near = np.einsum("ijk,ik->ij", self.normals, facet) > _ROUND
        return np.where(near[:, :, None], self.normals, facet[:, None])

    def displaced(self, face: Indices, weights: Array) -> tuple[Array, Array, Array | None]:
        """Return displaced points and unit normals for lighting, (n, k, 3), and heights (n, k) [m].

        Parameters
        ----------
        face : (n,) array
            Triangles.
        weights : (n, k, 3) array
            Weights of their corners at the points.
        """
        points = weights @ self.triangles[face]
        w, lit = _unit(weights @ self.normals[face]), _unit(weights @ self._lit[face])
        if self._field is None:
            return points, lit, None
        if self._places is None:
            height, slope = self._triplanar(points, w)
        else:
            place = weights @ self._places[face]
            found = self._field.derivatives(place[..., 0], place[..., 1])
            height = found.h
            slope = np.stack([found.h_u, found.h_v], axis=-1) @ self._slopes[face]
        lit += np.einsum("ijk,ijk->ij", slope, lit)[..., None] * lit - slope
        return points + height[..., None] * w, _unit(lit), height

    def heights(self, face: Indices, weights: Array) -> tuple[Array, Array]:
        """Return heights (n, k) [m], and the cosine between displaced and smooth normal (n, k).

        Parameters are those of `displaced`; the cosine is 1 where the relief is level.
        """
        _, lit, height = self.displaced(face, weights)
        if height is None:
            return np.zeros(lit.shape[:-1]), np.ones(lit.shape[:-1])
        smooth = self.smooth_normals(face, weights)
        return height, np.asarray(np.einsum("ijk,ijk->ij", lit, smooth))

    def smooth_normals(self, face: Indices, weights: Array) -> Array:
        """Return unit normals (n, k, 3) for lighting without the slopes of the relief."""
        return _unit(weights @ self._lit[face])

    def _triplanar(self, points: Array, w: Array) -> tuple[Array, Array]:
        """Return triplanar heights and their gradients at points with unit normals w."""
        assert self._field is not None
        share = np.abs(w) ** 4
        share /= share.sum(axis=-1, keepdims=True)
        height, slope = np.zeros(points.shape[:-1]), np.zeros(points.shape)
        for axis in range(3):
            i, j = (axis + 1) % 3, (axis + 2) % 3
            there = share[..., axis] > 1e-6
            part = share[..., axis][there]
            u, v = points[there][:, i] - self._origin[0], points[there][:, j] - self._origin[1]
            found = self._field.derivatives(u, v)
            height[there] += part * found.h
            slope[there, i] += part * found.h_u
            slope[there, j] += part * found.h_v
        return height, slope

    @cached_property
    def open_edges(self) -> Indices:
        """Edges along which the displaced surface may open, (n, 2, 3).

        For each of the two sides: the triangle, and its corners at the edge's two ends.
        """
        _, places = np.unique(self.triangles.reshape(-1, 3), axis=0, return_inverse=True)
        pairs = edges_of(places.reshape(-1, 3)).pairs
        corners = np.stack(meeting_corners(places.ravel(), *pairs.T), axis=2)
        out = np.concatenate([corners[:, :, :1] // 3, corners % 3], axis=2)
        differs = np.zeros(len(out), bool)
        for of_corner in (self.normals, self._places):
            if of_corner is not None:
                sides = of_corner[out[:, :, :1], out[:, :, 1:]]
                differs |= (np.abs(sides[:, 0] - sides[:, 1]) > 1e-9).any(axis=(1, 2))
        return out[differs]


def _unit(vectors: Array) -> Array:
    lengths = np.sqrt(np.einsum("ijk,ijk->ij", vectors, vectors))
    return np.asarray(vectors / np.maximum(lengths, 1e-12)[..., None])
