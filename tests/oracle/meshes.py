"""Meshes as really displaced surfaces, for the brute-force reference.

A triangle is taken as three *kites*: from a corner, by half of each of its edges, to the middle
of the triangle. A point of a kite has two parameters from 0 to 1, p along the edge to the next
corner and q along the edge to the last one. So the triangle's edges are borders of rectangles of
parameters, and are met exactly, and no parameter crowds anywhere. The corners' shares in a point
are bilinear in p and q; normals are interpolated with the same shares and made unit length. The
whole triangle takes part or not, by its facet normal.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.bodies import origin_of_map
from oracle.sheets import STEEPEST, flat_heights, matrix

if TYPE_CHECKING:
    from asperity.geometry.bodies import Body
    from asperity.geometry.mesh.mesh import Mesh

_PARTS = 4
"""Windows of a mesh are cut until each is this much smaller than the region that is looked at."""
_CUTS = 120
_SLIMMEST = 4.0
"""A triangle longer than this many times its height is a sliver."""
_HALVINGS = 6
_MOST_TRIANGLES = 100_000


Array = NDArray[np.float64]
Faces = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class MeshSurface:
    """The triangles of a mesh that face n or -n, placed in {u, v, n}, in kites.

    Attributes
    ----------
    body : Body
    corners, normals : (m, 3, 3) array
        Of each kite's triangle, its own corner first; in the body's frame [m] and [-].
    laid : (m, 3, 2) array or None
        Texture coordinates of the corners [m] where they are interpolated.
    rotation, shift : (3, 3) array, (3,) array
        From the body's frame into {u, v, n}.
    sense : float
        1 for B, whose upper surface counts, -1 for A.
    """

    body: Body
    corners: Array
    normals: Array
    laid: Array | None
    rotation: Array
    shift: Array
    sense: float

    @cached_property
    def seen(self) -> Array:
        """(m, 3, 2) array: the corners' u and v [m]."""
        return (self.corners @ self.rotation.T + self.shift)[..., :2]

    @cached_property
    def boxes(self) -> tuple[Array, Array]:
        """Lowest and highest u and v [m] of the bases of triangles, (m, 2) each."""
        return self.seen.min(axis=1), self.seen.max(axis=1)

    def at(self, face: Faces, p: Array, q: Array, displaced: bool = True) -> Array:
        """Return (..., 3) places [m]: u, v, rise; `face` is broadcast against p and q."""
        shares = _shares(p, q)
        base = _mixed(shares, self.corners, face)
        if displaced and self.body.texture is not None:
            w = _mixed(shares, self.normals, face)
            w /= np.linalg.norm(w, axis=-1, keepdims=True)
            base = base + self._heights(shares, face, base, w)[..., None] * w
        places = base @ self.rotation.T + self.shift
        places[..., 2] *= self.sense
        return places

    def _heights(self, shares: Array, face: Faces, base: Array, w: Array) -> Array:
        if self.laid is None:
            return flat_heights(self.body, base, w)
        u, v = np.moveaxis(_mixed(shares, self.laid, face), -1, 0)
        assert self.body.texture is not None
        return self.body.texture.heights(u, v)

    def outlines(self, face: Faces, ends: Array) -> Array:
        """Return the corners (2, 2, k, 2) of windows: u and v [m] by ends of p and of q.

        Bases are bilinear, so that the corners bound them.
        """
        p, q = ends[..., 0].T[:, None], ends[..., 1].T[None]
        return _mixed(_shares(p, q), self.seen, face)

    def counts(self, face: Faces, ends: Array, spacing: float) -> NDArray[np.intp]:
        """Return how many samples along p and q bring neighbours within `spacing`, (k, 2).

        Counts are rounded up by up to a seventh, so that many windows share one.
        """
        least = np.maximum(_lengths(self.outlines(face, ends)) / spacing, 1.0)
        unit = np.maximum(2.0 ** np.ceil(np.log2(least)) / 16.0, 1.0)
        return (np.ceil(least / unit) * unit).astype(np.intp) + 1

    def shadow(self) -> Array:
        """Return low and high (u, v) [m] of the shadow of all triangles; inf, -inf for none."""
        return np.array(
            [
                self.seen.min(axis=(0, 1), initial=np.inf),
                self.seen.max(axis=(0, 1), initial=-np.inf),
            ]
        )

    def over(self, region: Array, reach: float) -> tuple[Faces, Array]:
        """Return kites and the windows of them, (k, 2, 2), that may lie over `region`."""
        low, high = self.boxes
        face = np.flatnonzero(_meet(low, high, region, reach))
        ends = np.tile([[0.0, 0.0], [1.0, 1.0]], (face.size, 1, 1))
        most = float(np.max(region[1] - region[0])) / _PARTS
        for _ in range(_CUTS):
            corners = self.outlines(face, ends)
            hit = _meet(corners.min(axis=(0, 1)), corners.max(axis=(0, 1)), region, reach)
            face, ends = face[hit], ends[hit]
            lengths = _lengths(corners[:, :, hit])
            large = lengths.max(axis=-1) > most
            if not large.any():
                break
            halves = _halved(ends[large], lengths[large].argmax(axis=-1))
            face = np.concatenate([face[~large], face[large], face[large]])
            ends = np.concatenate([ends[~large], halves])
        return face, ends


@dataclass(frozen=True, eq=False)
class MeshSheet:
    """One kite of a triangle of a `MeshSurface`."""

    surface: MeshSurface
    face: int

    @property
    def sense(self) -> float:
        """1 for B, -1 for A."""
        return self.surface.sense

    @property
    def ends(self) -> Array:
        """(2, 2) array: lowest and highest values of the two parameters."""
        return np.array([[0.0, 0.0], [1.0, 1.0]])

    def at(self, p: Array, q: Array, displaced: bool = True) -> Array:
        """Return (..., 3) places [m]: u, v, rise."""
        return self.surface.at(np.array(self.face), p, q, displaced)


def mesh_surface(body: Body, pose: Array, frame: Array, origin: Array, sense: float) -> MeshSurface:
    """Return the surface of a body with a mesh, as seen along n (`sense` 1) or -n (-1)."""
    assert body.mesh is not None
    rotation, shift = frame @ matrix(pose[3:]), frame @ (pose[:3] - origin)
    corners = np.asarray(body.mesh.vertices, dtype=np.float64)[body.mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # Without a division: triangles of no area have no normal, and take no part.
    area = np.linalg.norm(across, axis=-1)
    shown = (area > 0.0) & (sense * (across @ rotation[2]) >= STEEPEST * area)
    laid = _laid(body, body.mesh, corners)
    parts = [corners, np.asarray(body.mesh.normals, dtype=np.float64)]
    parts += [] if laid is None else [laid]
    # All is linear in a triangle (normals until they are made unit length), so it may be cut.
    triangles = _without_slivers(np.concatenate([part[shown] for part in parts], -1), rotation)
    kites = np.concatenate([np.roll(triangles, -k, axis=1) for k in range(3)])
    return MeshSurface(
        body, kites[..., :3], kites[..., 3:6], None if laid is None else kites[..., 6:],
        rotation, shift, sense,
    )  # fmt: skip


def _laid(body: Body, mesh: Mesh, corners: Array) -> Array | None:
    """Return the corners' texture coordinates [m] (m, 3, 2); None if not interpolated."""
    field = body.texture
    if field is None or body.mapping not in ("uv", "cylindrical"):
        return None
    if body.mapping == "uv":
        return np.asarray(mesh.uv) * field.size - np.asarray(body.offset)
    radius = float(np.mean(np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 1])))
    if field.border == "wrap":
        whole = max(round(2.0 * math.pi * radius / field.size[0]), 1)
        radius = whole * field.size[0] / (2.0 * math.pi)
    angle = np.arctan2(corners[..., 1], corners[..., 0])
    # A triangle across the seam is laid on one side of it.
    angle -= 2.0 * math.pi * np.round((angle - angle[:, :1]) / (2.0 * math.pi))
    return np.stack([radius * angle, corners[..., 2]], axis=-1) - origin_of_map(body)


def _without_slivers(triangles: Array, rotation: Array) -> Array:
    """Return triangles (m, 3, d), places first, those whose shadow is a sliver cut across.

    A sliver of samples as far apart as wanted along its edges has far too many across.
    """
    for _ in range(_HALVINGS):
        seen = (triangles[..., :3] @ rotation.T)[..., :2]
        edges = np.roll(seen, -1, axis=1) - seen
        lengths = np.linalg.norm(edges, axis=-1)
        area = np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])
        sliver = lengths.max(axis=1) ** 2 > _SLIMMEST * area
        if not sliver.any() or len(triangles) > _MOST_TRIANGLES:
            break
        k = lengths[sliver].argmax(axis=1)
        start, end, last = (
            np.take_along_axis(triangles[sliver], ((k + i) % 3)[:, None, None], axis=1)
            for i in range(3)
        )
        middle = 0.5 * (start + end)
        halves = [np.hstack([start, middle, last]), np.hstack([middle, end, last])]
        triangles = np.concatenate([triangles[~sliver], *halves])
    return triangles


def _shares(p: Array, q: Array) -> Array:
    """Return the shares (3, ...) of a kite's own, next and last corner in its points."""
    middle = p * q / 3.0
    to_next, to_last = 0.5 * p * (1.0 - q), 0.5 * q * (1.0 - p)
    own = (1.0 - p) * (1.0 - q) + to_next + to_last + middle
    return np.stack([own, to_next + middle, to_last + middle])


def _mixed(shares: Array, values: Array, face: Faces) -> Array:
    """Return the mean of three corners' values (m, 3, d), weighted by `shares` (3, ...)."""
    mixed: Array = sum(shares[k][..., None] * values[face, k] for k in range(3))
    return mixed


def _meet(low: Array, high: Array, region: Array, reach: float) -> NDArray[np.bool_]:
    return np.all((high + reach >= region[0]) & (low - reach <= region[1]), axis=-1)


def _lengths(outlines: Array) -> Array:
    """Return how long windows are along p and along q [m], (k, 2), from their corners."""
    edges = outlines[1] - outlines[0], outlines[:, 1] - outlines[:, 0]
    return np.stack([np.max(np.linalg.norm(edge, axis=-1), axis=0) for edge in edges], axis=-1)


def _halved(ends: Array, along: NDArray[np.intp]) -> Array:
    """Return two windows for each of `ends` (k, 2, 2), cut across parameter `along`."""
    first, second, k = ends.copy(), ends.copy(), np.arange(len(ends))
    middle = 0.5 * (ends[k, 0, along] + ends[k, 1, along])
    first[k, 1, along], second[k, 0, along] = middle, middle
    return np.concatenate([first, second])
