"""Bodies as the flat arrays that the kernels of a skin work on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array
from asperity.contact.body_arrays import Geometry, flatten_bodies
from asperity.contact.soft.sheets import BOX, PLANE, REACH, Solids
from asperity.geometry.bodies import MAPPINGS, Body
from asperity.geometry.poses import rotation_of
from asperity.texture.packed import PackedTextures


def solids_of(bodies: Sequence[Body], poses: Sequence[Array]) -> Solids:
    """Return the geoms and textures of bodies at their poses (7,)."""
    textures, geometry = flatten_bodies(bodies)
    return Solids(textures, geometry, _reach(textures, geometry), _frames(geometry, poses))


def smooth(solids: Solids) -> Solids:
    """Return the same solids without textures."""
    geometry = solids.geometry
    return solids._replace(
        geometry=geometry._replace(texture=geometry.no_texture),
        reach=np.zeros(len(geometry.kind), REACH),
    )


def _reach(textures: PackedTextures, geometry: Geometry) -> NDArray[np.void]:
    """Return bounds of the textures on each geom, `REACH` records."""
    out = np.zeros(len(geometry.kind), REACH)
    for g, surface in enumerate(geometry.surface):
        k, mapping = int(geometry.texture[surface]), MAPPINGS[geometry.mapping[surface]]
        if k < 0:
            continue
        found = textures.maps[k]
        # Three maps are blended: their weights change along the surface, too.
        factors = {"triplanar": 2.0, "cylindrical": max(1.0, float(geometry.around[g]))}
        factor = factors.get(mapping, 1.0)
        slope = float(found["max_slope"]) * factor
        bend = float(found["max_curvature"]) * factor**2
        if geometry.kind[g] not in (PLANE, BOX):
            bend += 4.0 * (1.0 + slope) / min(size for size in geometry.size[g] if size > 0.0)
        out[g] = -found["max_abs_surface"], max(found["highest"], 0.0), slope, bend
    return out


def _frames(geometry: Geometry, poses: Sequence[Array]) -> Array:
    """Return the frames of geoms in the world, (geoms, 3, 4)."""
    out = np.empty((len(geometry.kind), 3, 4))
    for g, body in enumerate(geometry.body):
        turn = rotation_of(poses[body][3:])
        out[g, :, :3] = turn @ geometry.rotation[g]
        out[g, :, 3] = turn @ geometry.position[g] + poses[body][:3]
    return out
