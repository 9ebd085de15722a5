"""Patchwork of triangles from which the shapes are built.

The texture moves a surface along its corner normals, so these decide where the displaced surface
stays closed. Every triangle has a smoothing group and a rank. A corner's normal is the mean of the
facet normals, weighted by the facets' angles, over those triangles of the highest rank that meet
there within the group. So a flat face (high rank) keeps its own normal to its very border, and the
narrow chamfer or round beside it (low rank) carries the turn. Edges between groups are hard.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.shapes.shape import Shape
from tools.shapes.triangulate import triangulated

Array = NDArray[np.float64]
WELD = 1e-9
"""Corners nearer than about this are one vertex [m]."""
GAP = 1e-3
"""Between charts [m]."""
ROUND, CURVED, FLAT = 0, 1, 2
"""Ranks: what carries the turn of the normals, what keeps its own, what is truly flat."""


def triangle_areas(shape: Shape) -> Array:
    """Return the area of each triangle [m^2], (m,)."""
    a, b, c = np.moveaxis(shape.vertices[shape.faces], 1, 0)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def detail_triangles(
    shape: Shape, pixel_size: float | tuple[float, float], faces: slice | None = None
) -> float:
    """Return how many triangles a mesh would need to show what the texture shows: two a texel.

    Parameters
    ----------
    shape : Shape
    pixel_size : float or (float, float)
        Of the texture [m].
    faces : slice, optional
        The triangles that are textured; all if not given.
    """
    pixel_u, pixel_v = np.broadcast_to(pixel_size, 2)
    area = triangle_areas(shape)[slice(None) if faces is None else faces].sum()
    return float(2.0 * area / (pixel_u * pixel_v))


def plane_axes(normal: Array, u_axis: Sequence[float] | None = None) -> Array:
    """Return two unit axes (2, 3) in a plane, right-handed with its unit `normal`."""
    if u_axis is None:
        u_axis = np.eye(3)[int(np.argmin(np.abs(normal)))].tolist()
    first = np.asarray(u_axis, dtype=np.float64)
    first = first - (first @ normal) * normal
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])


class Patchwork:
    """Triangles in the making: patches are added, then `shape` welds them, and checks nothing.

    Texture coordinates are given in metres. Triangles of one `chart` keep their places to each
    other; `shape` lays the charts side by side along v.
    """

    def __init__(self) -> None:
        self._corners: list[Array] = []
        self._uv: list[Array] = []
        self._facets: list[Array] = []
        self._tags: list[tuple[str, str, int]] = []

    def add(
        self,
        corners: Array,
        uv: Array,
        chart: str,
        *,
        smooth: str = "",
        rank: int = ROUND,
        normal: Array | None = None,
    ) -> None:
        """Add triangles.

        Parameters
        ----------
        corners : (m, 3, 3)
            [m].
        uv : (m, 3, 2)
            [m].
        chart : str
        smooth : str
            Their smoothing group.
        rank : {ROUND, CURVED, FLAT}
        normal : (3,), optional
            Of all of them, exactly; from their corners if not given.
        """
        a, b, c = np.moveaxis(corners, 1, 0)
        facets = np.cross(b - a, c - a)
        facets = facets / np.linalg.norm(facets, axis=1, keepdims=True)
        if normal is not None:
            facets = np.broadcast_to(normal, facets.shape)
        self._corners.append(corners)
        self._uv.append(uv)
        self._facets.append(facets)
        self._tags += [(chart, smooth, rank)] * len(corners)

    def grid(
        self,
        points: Array,
        uv: Array,
        chart: str,
        *,
        smooth: str = "",
        rank: int = ROUND,
        normal: Array | None = None,
    ) -> None:
        """Add two triangles for each cell of `points` (rows, columns, 3), `uv` (.., 2) [m].

        Seen from outside columns run to the right and rows upwards.
        """
        self.add(cells(points), cells(uv), chart, smooth=smooth, rank=rank, normal=normal)

    def fan(
        self, centre: Array, ring: Array, uv: Array, chart: str, *, smooth: str, rank: int
    ) -> None:
        """Add triangles from `centre`, at uv (0, 0), to a closed `ring`, counter-clockwise."""
        after, uv_after = np.roll(ring, -1, axis=0), np.roll(uv, -1, axis=0)
        corners = np.stack([np.broadcast_to(centre, ring.shape), ring, after], axis=1)
        uvs = np.stack([np.zeros_like(uv), uv, uv_after], axis=1)
        self.add(corners, uvs, chart, smooth=smooth, rank=rank)

    def flat(
        self,
        loops: Sequence[Array],
        normal: Sequence[float],
        chart: str,
        *,
        smooth: str = "",
        u_axis: Sequence[float] | None = None,
    ) -> None:
        """Add a flat face with holes, mapped as it lies.

        Parameters
        ----------
        loops : sequence of (n, 3)
            The outline, then the holes [m].
        normal : (3,)
            Unit, outwards.
        chart, smooth : str
        u_axis : (3,), optional
            The direction of u in the face.
        """
        up = np.asarray(normal, dtype=np.float64)
        axes = plane_axes(up, u_axis)
        uv = [loop @ axes.T for loop in loops]
        triangles = triangulated(uv)
        points, places = np.concatenate(list(loops)), np.concatenate(uv)
        self.add(points[triangles], places[triangles], chart, smooth=smooth, rank=FLAT, normal=up)

    def shape(self, pieces: Sequence[Array], uv_size: tuple[float, float]) -> Shape:
        """Return the patches welded into one mesh, with `pieces` and texture coordinates."""
        corners = np.concatenate(self._corners)
        keys = np.round(corners.reshape(-1, 3) / WELD)
        _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        vertices = corners.reshape(-1, 3)[first]
        faces = inverse.reshape(-1, 3).astype(np.int64)
        uv = self._placed_uv() / np.asarray(uv_size)
        normals = self._normals(vertices, faces)
        return Shape(vertices, faces, normals, uv, tuple(pieces), uv_size)

    def _placed_uv(self) -> Array:
        uv = np.concatenate(self._uv).astype(np.float64)
        charts = np.array([chart for chart, _, _ in self._tags])
        start = 0.0
        for chart in dict.fromkeys(charts.tolist()):
            own = charts == chart
            low, high = uv[own].min(axis=(0, 1)), uv[own].max(axis=(0, 1))
            uv[own] += np.array([0.0, start]) - low
            start += high[1] - low[1] + GAP
        return uv

    def _normals(self, vertices: Array, faces: NDArray[np.int64]) -> Array:
        facets = np.concatenate(self._facets)
        angles = corner_angles(vertices[faces])
        meeting: dict[tuple[int, str], list[tuple[int, int, int]]] = defaultdict(list)
        for triangle, (_, smooth, rank) in enumerate(self._tags):
            for corner in range(3):
                place = (int(faces[triangle, corner]), smooth)
                meeting[place].append((rank, triangle, corner))
        normals = np.empty((len(faces), 3, 3))
        for found in meeting.values():
            highest = max(rank for rank, _, _ in found)
            best = [(t, c) for rank, t, c in found if rank == highest]
            normal = facets[best[0][0]]
            # Equal normals stay equal to the last bit: a sum would round.
            if any(not np.array_equal(facets[t], normal) for t, _ in best):
                normal = sum((angles[t, c] * facets[t] for t, c in best), np.zeros(3))
                normal = normal / np.linalg.norm(normal)
            for _, triangle, corner in found:
                normals[triangle, corner] = normal
        return normals


def cells(grid: Array) -> Array:
    """Return two triangles for each cell of a grid (rows, columns, ..), (m, 3, ..)."""
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    both = np.stack([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)], axis=2)
    return both.reshape(-1, 3, grid.shape[-1])


def corner_angles(corners: Array) -> Array:
    """Return the angles [rad] at the corners (m, 3, 3) of triangles, (m, 3)."""
    onwards = np.roll(corners, -1, axis=1) - corners
    back = np.roll(corners, 1, axis=1) - corners
    across = np.linalg.norm(np.cross(onwards, back), axis=2)
    return np.arctan2(across, np.einsum("mci,mci->mc", onwards, back))
