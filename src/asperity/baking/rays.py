"""Ray casting from the low-resolution surface to the full one.

A ray along the normal of the low-resolution surface may meet the full surface several times: the
far side of a thin wall, the opposite side of a slot, an overhang. The relevant hit is the nearest
within a range, the cage, whose normal has a positive component along the ray. Embree finds
triangles in single precision; the distances to their planes are then computed in double precision.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError

LEAST_FACING = 0.05
"""Least cosine between a hit's normal and the ray: slopes up to 20."""
_MOST_PASSED = 12
"""Largest number of triangles that a ray passes on its way to a valid hit."""
_SKIN = 2e-6
"""Distance behind a triangle at which a ray continues, in sizes of the mesh: a few roundings of
Embree."""
_AT_ONCE = 250_000


class FullSurface:
    """A mesh for ray casting.

    Parameters
    ----------
    triangles : (m, 3, 3) array
        Corners [m], counter-clockwise as seen from outside.

    Raises
    ------
    AsperityError
        embreex is not installed (`pip install 'asperity[bake]'`); one line.
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
        """Return the signed distance of the surface along rays [m], (n,); NaN where there is none.

        Parameters
        ----------
        points, along : (n, 3) arrays
            Origins of the rays [m], and their unit directions, outwards.
        cage : float or (n,) array
            Range in either direction [m].
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
        """Return the distance of the surface seen from points in a direction [m]; NaN: none.

        Parameters
        ----------
        points : (n, 3) array
            [m].
        way : (3,) array
            Unit direction.
        """
        # From farther away: Embree might miss a surface at the point itself.
        start = (points - self._origin) / self._size - 0.1 * way
        ways = np.tile(way.astype(np.float32), (len(points), 1))
        face = np.asarray(self._scene.run(start.astype(np.float32), ways))
        normal = self._normal[face]
        facing = normal @ way
        facing = np.where(np.abs(facing) > 1e-9, facing, 1e-9)
        away = np.einsum("ij,ij->i", normal, self._corner[face] - start) / facing - 0.1
        return np.where(face >= 0, away * self._size, np.nan)

    def _first(self, origin: Array, along: Array, cage: Array, sense: float) -> Array:
        """Return the signed distance of the first valid hit on one side of each point."""
        found = np.full(len(origin), np.nan)
        live = np.arange(len(origin))
        # From slightly behind the point, to include a surface at the point itself.
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
            # A triangle seen edge-on gives no useful distance: pass it.
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
