"""A displaced surface as a hierarchy of meshes: filtered, simplified, and bounded.

The *dual hierarchy* of Otaduy & Lin (2003): level 0 is the full-detail mesh; every further level is
the one before it, filtered and with its shortest edges collapsed until about a quarter of its
triangles is left. A triangle of a level is at the same time a node of the bounding volume
hierarchy: its children are those triangles of the finer level that are nearest to it, and its
sphere and its box enclose it and all its descendants.

The filter is that of Taubin (*A signal processing approach to fair surface design*, SIGGRAPH 95),
along normals: it passes waves of more than about five edges and stops those of fewer than three.
Without it, a vertex that stands for a whole wave overshoots (collapsing by quadrics alone gave
0.7 mm of relief where the full surface has 0.2 mm). Corners of a body, and bodies without a
texture, are not filtered; of the latter the cheapest edges are collapsed first, so that flat faces
stay flat.

Deviations add up from level to level: with h the largest distance, in both directions, between a
level's triangle and the finer level, `s = h + s of the finer one`. So they never decrease, and are
at least as large as the Hausdorff distance from the full mesh, up to sampling at its vertices.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import KDTree

from asperity._core.arrays import Array, Indices
from asperity.baking.collapse import collapsed
from asperity.baking.nearest import fill_nearest, spread_points
from asperity.geometry.bodies import Body
from asperity.geometry.mesh.checks import same_places
from asperity.geometry.mesh.topology import crosses
from asperity.studies.baselines.displaced_surfaces import (
    DisplacedSurface,
    bounding_ball,
    displaced_surface,
    is_unbounded,
    spacing_for,
)

_SHARE, _LEAST = 4, 12
"""Triangles of a level per triangle of the next one, and the least number of a level."""
_STUCK = 0.6
"""A level with more than this share of the finer one's triangles is not kept."""
_FACING, _QUALITY = 0.2, 0.03
"""Limits of a collapse; see `baking.collapse`."""
_PASS, _STOP, _TIMES = 0.5, -0.53, 4
"""Taubin's weights lambda and mu, and how often both are applied."""
_CORNER = 0.8
"""Least cosine between a vertex's normal and its triangles'; below it lies an edge of the body."""
_SAME = 1e-9
"""Points nearer than this are welded [m]."""
_PER_WAVE, _SMOOTH_POINTS = 12.0, 4_000
"""Sufficient number of points per shortest wave, and of a body without texture."""
_CANDIDATES = 8


class LevelTree(NamedTuple):
    """The triangles of all levels of a body, the finest level first; each is a node."""

    triangles: Array
    """(n, 3, 3) [m]"""
    normals: Array
    """(n, 3), unit, outwards."""
    deviations: Array
    """s: largest distance from the full mesh [m], (n,)."""
    sizes: Array
    """1 / r^2: twice the triangle's area [m^2], (n,)."""
    middles: Array
    """Centres of spheres that enclose a triangle and its descendants [m], (n, 3)."""
    radii: Array
    """Their radii [m], (n,)."""
    first: Indices
    """Place of a triangle's first child in `children`, (n + 1,)."""
    children: Indices
    """Children of all triangles, concatenated."""


class _Mesh(NamedTuple):
    """Triangles of distinct points."""

    points: Array
    """(n, 3) [m]"""
    faces: Indices
    """(m, 3)"""


@dataclass(frozen=True, eq=False)
class MeshLevels:
    """A body at all its levels of detail."""

    tree: LevelTree
    starts: Indices
    """First triangle of each level, and the number of all, (levels + 1,)."""
    deviations: Array
    """Largest s of each level [m], (levels,)."""
    thickness: float
    """Smallest side of the box around the body [m]; infinite for a plane."""

    @property
    def count(self) -> int:
        """Number of levels."""
        return len(self.deviations)

    def triangles(self, level: int) -> Array:
        """Return the corners of a level's triangles [m], (m, 3, 3)."""
        return self.tree.triangles[self.starts[level] : self.starts[level + 1]]

    def edge(self, level: int) -> float:
        """Return the typical edge of a level [m]: that of its mean square cell."""
        return float(np.sqrt(self.tree.sizes[self.starts[level] : self.starts[level + 1]].mean()))


def full_mesh(body: Body, points: int) -> DisplacedSurface:
    """Return a body's displaced surface at full detail, with at most about `points` points."""
    if is_unbounded(body):
        return displaced_surface(body, 0.5 * bounding_ball(body)[1])
    if not body.fields:
        return displaced_surface(body, spacing_for(body, min(points, _SMOOTH_POINTS)))
    finest = min(field.shortest_wavelength for field in body.fields) / _PER_WAVE
    return displaced_surface(body, max(spacing_for(body, points), finest))


def build_levels(surface: DisplacedSurface, *, filters: bool) -> MeshLevels:
    """Return the levels of a surface.

    Parameters
    ----------
    surface : DisplacedSurface
        The full-detail mesh.
    filters : bool
        Whether to filter a level before its edges are collapsed, the shortest first; otherwise the
        cheapest first.
    """
    mesh = _welded(surface)
    meshes = [mesh]
    middle, size = mesh.points.mean(axis=0), float(np.ptp(mesh.points, axis=0).max())
    while len(mesh.faces) > _LEAST:
        smooth = _filtered(mesh) if filters else mesh.points
        points, faces = collapsed(
            (smooth - middle) / size, mesh.faces, max(len(mesh.faces) // _SHARE, _LEAST),
            facing=_FACING, quality=_QUALITY, shortest=filters,
        )  # fmt: skip
        if len(faces) > _STUCK * len(mesh.faces):
            break
        mesh = _Mesh(points * size + middle, faces)
        meshes.append(mesh)
    return _tree(meshes)


def _welded(surface: DisplacedSurface) -> _Mesh:
    """Return a surface with coincident points joined, without triangles that vanish by it."""
    places = same_places(surface.points, _SAME)
    _, first, number = np.unique(places, return_index=True, return_inverse=True)
    faces = number.ravel()[surface.faces]
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    used, corners = np.unique(faces[whole], return_inverse=True)
    return _Mesh(surface.points[first][used], corners.reshape(-1, 3).astype(np.int64))


def _filtered(mesh: _Mesh) -> Array:
    """Return the points after Taubin's filter along their normals."""
    points, faces = mesh
    count, following = len(points), np.roll(faces, -1, axis=1)
    ends = np.concatenate([faces.ravel(), following.ravel()])
    others = np.concatenate([following.ravel(), faces.ravel()])
    near = csr_array((np.ones(len(ends)), (ends, others)), shape=(count, count))
    near.data[:] = 1.0
    share = 1.0 / near.sum(axis=1)
    facet = crosses(points[faces])
    normals = np.zeros((count, 3))
    for corner in range(3):
        for k in range(3):
            normals[:, k] += np.bincount(faces[:, corner], facet[:, k], minlength=count)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    facet /= np.maximum(np.linalg.norm(facet, axis=1, keepdims=True), 1e-300)
    least = np.ones(count)
    for corner in range(3):
        cosine = np.einsum("ij,ij->i", facet, normals[faces[:, corner]])
        np.minimum.at(least, faces[:, corner], cosine)
    share = np.where(least > _CORNER, share, 0.0)
    moved = points.copy()
    for weight in (_PASS, _STOP) * _TIMES:
        away = share[:, None] * (near @ moved) - (share > 0.0)[:, None] * moved
        moved += weight * np.einsum("ij,ij->i", away, normals)[:, None] * normals
    return moved


def _tree(levels: list[_Mesh]) -> MeshLevels:
    """Return the hierarchy of the triangles of all levels, the finest first."""
    starts = np.cumsum([0, *(len(mesh.faces) for mesh in levels)])
    triangles = np.concatenate([mesh.points[mesh.faces] for mesh in levels])
    deviations, parents = np.zeros(len(triangles)), np.full(len(triangles), -1)
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    for level in range(1, len(levels)):
        here = slice(starts[level], starts[level + 1])
        below = slice(starts[level - 1], starts[level])
        deviations[here], nearest = _compared(levels[level], levels[level - 1], deviations[below])
        parents[below] = starts[level] + nearest
        np.minimum.at(low, parents[below], low[below])
        np.maximum.at(high, parents[below], high[below])
    cross = crosses(triangles)
    twice = np.linalg.norm(cross, axis=1)
    order = np.argsort(parents, kind="stable")
    order = order[parents[order] >= 0]
    first = np.searchsorted(parents[order], np.arange(len(triangles) + 1))
    tree = LevelTree(
        triangles, cross / np.maximum(twice, 1e-300)[:, None], deviations, twice,
        0.5 * (low + high), 0.5 * np.linalg.norm(high - low, axis=1),
        first.astype(np.int64), order.astype(np.int64),
    )  # fmt: skip
    most = [deviations[starts[i] : starts[i + 1]].max() for i in range(len(levels))]
    sides = np.ptp(levels[0].points, axis=0)
    thickness = float(sides.min()) if sides.min() > 0.0 else math.inf
    return MeshLevels(tree, starts.astype(np.int64), np.maximum.accumulate(most), thickness)


def _compared(coarse: _Mesh, fine: _Mesh, before: Array) -> tuple[Array, Indices]:
    """Return the deviation of each coarse triangle [m], and the one nearest to each fine triangle.

    `before` are the deviations of the fine triangles.
    """
    away = np.zeros(len(coarse.faces))
    near = _Near(coarse)
    # From corners of the fine level to the coarse one; deviations add up.
    face, distance = near.to(fine.points)
    for corner in fine.faces.T:
        np.maximum.at(away, face[corner], before + distance[corner])
    parents, _ = near.among(face[fine.faces], fine.points[fine.faces].mean(axis=1))
    # Back from corners and centres of the coarse level, about as dense as the fine one's corners.
    near = _Near(fine)
    face, distance = near.to(coarse.points)
    back = (before[face] + distance)[coarse.faces].max(axis=1)
    face, distance = near.to(coarse.points[coarse.faces].mean(axis=1))
    away = np.maximum(away, np.maximum(back, before[face] + distance))
    # A descendant may be nearest in its corners to other triangles.
    np.maximum.at(away, parents, before)
    return away, parents


class _Near:
    """The nearest of some triangles, among those with the nearest of points spread over them."""

    def __init__(self, mesh: _Mesh) -> None:
        self._triangles = mesh.points[mesh.faces]
        area = 0.5 * float(np.linalg.norm(crosses(self._triangles), axis=1).sum())
        wide = 2.0 * np.sqrt(area / max(len(mesh.faces), 500))
        spread, self._owner = spread_points(self._triangles, float(wide))
        self._tree = KDTree(spread, compact_nodes=False, balanced_tree=False)

    def to(self, points: Array) -> tuple[Indices, Array]:
        """Return the number of the triangle nearest to each point (n, 3) and its distance [m]."""
        count = min(_CANDIDATES, len(self._owner))
        found = self._tree.query(points, k=count)[1].reshape(len(points), count)
        return self.among(self._owner[found], points)

    def among(self, candidates: Indices, points: Array) -> tuple[Indices, Array]:
        """Return the same, of the triangles in `candidates` (n, k)."""
        face, away = np.zeros(len(points), np.int64), np.zeros(len(points))
        fill_nearest(self._triangles, points, candidates, face, away)
        return face, away
