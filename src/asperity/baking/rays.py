"""The full surface as the renderer will look for it: along lines through the low-resolution one.

A line through a point of the low-resolution surface may meet the full one several times: the far
side of a thin wall, the opposite side of a slot, an overhang. The one that is meant faces the way
the line goes (its normal has a positive part along it) and is the nearest of those within a
bound, the cage. Embree finds triangles in single precision; the distance to their planes is then
computed in double precision, so it is not the worse for it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError

Array = NDArray[np.float64]
LEAST_FACING = 0.05
"""Cosine between a hit's normal and the line below which it does not count: slopes of 20."""
_MOST_PASSED = 12
"""Triangles that a ray passes through, at most, on its way to one that counts."""
_SKIN = 2e-6
"""How far behind a triangle a ray goes on, in sizes of the mesh: a few roundings of Embree's."""
_AT_ONCE = 250_000


class FullSurface:
    """A mesh to be looked for along lines.

    Parameters
    ----------
    triangles : (m, 3, 3) array
        Corners [m], counter-clockwise as seen from outside.

    Raises
    ------
    AsperityError
        embreex not installed (`pip install 'asperity[bake]'`). One line.
    """

    def __init__(self, triangles: Array) -> None:
        scenes, meshes = _embree()
        self._origin = 0.5 * (triangles.min(axis=(0, 1)) + triangles.max(axis=(0, 1)))
        self._size = float(np.ptp(triangles, axis=(0, 1)).max())
        scaled = (triangles - self._origin) / self._size
        self._corner = scaled[:, 0].copy()
        normal = np.cross(scaled[:, 1] - scaled[:, 0], scaled[:, 2] - scaled[:, 0])
        self._normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        self._scene = scenes.EmbreeScene()
        corners = np.ascontiguousarray(scaled.reshape(-1, 3), dtype=np.float32)
        indices = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
        meshes.TriangleMesh(scene=self._scene, vertices=corners, indices=indices)

    def heights(self, points: Array, along: Array, cage: Array | float) -> Array:
        """Return how far away the full surface is along lines [m]; NaN where it is not found.

        Parameters
        ----------
        points, along : (n, 3) arrays
            Where the lines begin [m], and their unit directions, outwards.
        cage : float or (n,) array
            How far away it is looked for, either way [m].
        """
        out = np.full(len(points), np.nan)
        cage = np.broadcast_to(np.asarray(cage, dtype=np.float64), len(points))
        for start in range(0, len(points), _AT_ONCE):
            part = slice(start, start + _AT_ONCE)
            origin = (points[part] - self._origin) / self._size
            above, below = (
                self._first(origin, along[part], cage[part] / self._size, sense)
                for sense in (1.0, -1.0)
            )
            nearer = np.where(np.abs(above) <= np.abs(below), above, below)
            nearer = np.where(np.isnan(above), below, np.where(np.isnan(below), above, nearer))
            out[part] = nearer * self._size
        return out

    def seen(self, points: Array, way: Array) -> Array:
        """Return how far away the surface is that is seen from points along `way`; NaN: none.

        Parameters
        ----------
        points : (n, 3) array
            [m].
        way : (3,) array
            Unit direction.
        """
        # From farther away: Embree might miss a surface in the point itself.
        start = (points - self._origin) / self._size - 0.1 * way
        ways = np.tile(way.astype(np.float32), (len(points), 1))
        face = np.asarray(self._scene.run(start.astype(np.float32), ways))
        normal = self._normal[face]
        facing = normal @ way
        facing = np.where(np.abs(facing) > 1e-9, facing, 1e-9)
        away = np.einsum("ij,ij->i", normal, self._corner[face] - start) / facing - 0.1
        return np.where(face >= 0, away * self._size, np.nan)

    def _first(self, origin: Array, along: Array, cage: Array, sense: float) -> Array:
        """Return the signed distance of the first hit that counts on one side of each point."""
        found = np.full(len(origin), np.nan)
        live = np.arange(len(origin))
        # From a little behind the point: a surface through the point itself is met, too.
        gone = np.full(len(origin), -_SKIN)
        for _ in range(_MOST_PASSED):
            way = sense * along[live]
            start = origin[live] + gone[live, None] * way
            face = np.asarray(self._scene.run(start.astype(np.float32), way.astype(np.float32)))
            hit = face >= 0
            live, face = live[hit], face[hit]
            normal, w = self._normal[face], along[live]
            facing = np.einsum("ij,ij->i", normal, w)
            steep = np.where(np.abs(facing) > 1e-9, facing, 1e-9)
            offset = np.einsum("ij,ij->i", normal, self._corner[face] - origin[live])
            away = sense * offset / steep
            near = away <= cage[live]
            counts = near & (facing > LEAST_FACING)
            found[live[counts]] = sense * away[counts]
            on = near & ~counts
            # A triangle seen edge-on has no distance worth its name: past it in any case.
            gone[live[on]] = np.maximum(away[on], gone[live[on]]) + _SKIN
            live = live[on]
            if not len(live):
                break
        return found


def _embree() -> tuple[Any, Any]:
    try:
        from embreex import mesh_construction, rtcore_scene
    except ImportError:
        raise AsperityError(
            "baking needs embreex, which is not installed; valid: pip install 'asperity[bake]'"
        ) from None
    return rtcore_scene, mesh_construction
