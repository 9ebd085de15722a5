"""A mesh displaced by its texture: points and normals at barycentric coordinates of triangles."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.bodies import Body
from asperity.geometry.displaced.view import coarsened
from asperity.geometry.mesh.texture_coordinates import places_on_texture

Array = NDArray[np.float64]
Whole = NDArray[np.int64]
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
        self._places = places_on_texture(body)
        self._lit = self._lit_normals()
        self._field = body.texture
        self._origin = np.asarray(body.offset, dtype=np.float64)
        if body.texture is None:
            return
        if body.texture.border == "clamp":
            self._origin = self._origin - 0.5 * np.asarray(body.texture.size)
        if self._places is not None:
            self._slopes = self._place_slopes(self._places)
            # Length on the texture per length on the body.
            scale = np.linalg.norm(np.cross(self._slopes[:, 0], self._slopes[:, 1]), axis=1)
            spacing *= float(np.sqrt(np.median(scale)))
        self._field = coarsened(body.texture, spacing)

    def _lit_normals(self) -> Array:
        a, b, c = np.moveaxis(self.triangles, 1, 0)
        facet = np.cross(b - a, c - a)
        facet /= np.maximum(np.linalg.norm(facet, axis=1, keepdims=True), 1e-300)
        near = np.einsum("ijk,ik->ij", self.normals, facet) > _ROUND
        return np.where(near[:, :, None], self.normals, facet[:, None])

    def _place_slopes(self, places: Array) -> Array:
        """Return gradients (m, 2, 3) of texture coordinates (m, 3, 2) [m] on each triangle."""
        p, q = (self.triangles[:, i] - self.triangles[:, 0] for i in (1, 2))
        normal = np.cross(p, q)
        square = np.maximum(np.sum(normal**2, axis=1), 1e-300)[:, None]
        dual = np.stack([np.cross(q, normal) / square, np.cross(normal, p) / square], axis=1)
        steps = places[:, 1:] - places[:, :1]  # along p and q
        return np.asarray(np.swapaxes(steps, 1, 2) @ dual)

    def displaced(self, face: Whole, weights: Array) -> tuple[Array, Array, Array | None]:
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

    def heights(self, face: Whole, weights: Array) -> tuple[Array, Array]:
        """Return heights (n, k) [m], and the cosine between displaced and smooth normal (n, k).

        Parameters are those of `displaced`; the cosine is 1 where the relief is level.
        """
        _, lit, height = self.displaced(face, weights)
        if height is None:
            return np.zeros(lit.shape[:-1]), np.ones(lit.shape[:-1])
        smooth = self.smooth_normals(face, weights)
        return height, np.asarray(np.einsum("ijk,ijk->ij", lit, smooth))

    def smooth_normals(self, face: Whole, weights: Array) -> Array:
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
    def open_edges(self) -> Whole:
        """Edges along which the displaced surface may open, (n, 2, 3).

        For each of the two sides: the triangle, and its corners at the edge's two ends.
        """
        places = np.unique(self.triangles.reshape(-1, 3), axis=0, return_inverse=True)[1]
        at = places.reshape(-1, 3)
        face = np.repeat(np.arange(len(at)), 3)
        start = np.tile(np.arange(3), len(at))
        stop = (start + 1) % 3
        ends = np.sort(np.stack([at[face, start], at[face, stop]], axis=1), axis=1)
        order = np.lexsort((ends[:, 1], ends[:, 0]))
        pair = np.flatnonzero((ends[order][1:] == ends[order][:-1]).all(axis=1))
        one, two = order[pair], order[pair + 1]
        # On the other side the ends may be in the opposite order.
        alike = at[face[one], start[one]] == at[face[two], start[two]]
        first, last = np.where(alike, start[two], stop[two]), np.where(alike, stop[two], start[two])
        out = np.stack(
            [
                np.stack([face[one], start[one], stop[one]], axis=1),
                np.stack([face[two], first, last], axis=1),
            ],
            axis=1,
        )
        return out[self._differs(out)]

    def _differs(self, edges: Whole) -> NDArray[np.bool_]:
        """Return at which edges normals or texture coordinates differ between the sides."""
        differs = np.zeros(len(edges), bool)
        for of_corner in (self.normals, self._places):
            if of_corner is None:
                continue
            for end in (1, 2):
                one, two = (of_corner[edges[:, k, 0], edges[:, k, end]] for k in (0, 1))
                differs |= np.abs(one - two).max(axis=1) > 1e-9
        return differs


def _unit(vectors: Array) -> Array:
    lengths = np.sqrt(np.einsum("ijk,ijk->ij", vectors, vectors))
    return np.asarray(vectors / np.maximum(lengths, 1e-12)[..., None])
