"""The bodies of a scene in flat arrays, as compiled kernels want them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.bodies import KINDS, MAPPINGS, Body, Geom
from asperity.geometry.poses import rotation_of
from asperity.texture.packed import PackedTextures, pack


class Geometry(NamedTuple):
    """All geoms of a scene, as kernels want them; rows are geoms."""

    kind: NDArray[np.int64]
    size: NDArray[np.float64]
    position: NDArray[np.float64]
    """In the body's frame [m], (geoms, 3)."""
    rotation: NDArray[np.float64]
    """From the geom's frame into the body's, (geoms, 3, 3)."""
    body: NDArray[np.int64]
    texture: NDArray[np.int64]
    """Of each body: which texture, -1 for none."""
    mapping: NDArray[np.int64]
    origin: NDArray[np.float64]
    """Of each body: where (u, v) = (0, 0) lies in its frame [m], (bodies, 3)."""
    around: NDArray[np.float64]
    """Of each geom: by how much a cylindrical map is stretched to go round whole times."""
    no_texture: NDArray[np.int64]
    """In the place of `texture`: -1 for each body."""


def flattened(bodies: Sequence[Body]) -> tuple[PackedTextures, Geometry]:
    """Return textures and geoms of `bodies` as arrays. A map of zeros is no texture."""
    fields = [
        body.texture
        if body.texture is not None and (body.texture.lowest or body.texture.highest)
        else None
        for body in bodies
    ]
    textures_of = np.cumsum([field is not None for field in fields]) - 1
    textures_of[[field is None for field in fields]] = -1
    textures = pack([field for field in fields if field is not None])
    return textures, _geometry_of(bodies, textures_of)


def _geometry_of(bodies: Sequence[Body], textures_of: NDArray[np.int64]) -> Geometry:
    geoms = [(geom, number) for number, body in enumerate(bodies) for geom in body.geoms]
    origins = []
    for body in bodies:
        origin = np.array([*body.offset, 0.0])
        if body.texture is not None and body.texture.border == "clamp":
            origin[:2] -= 0.5 * np.asarray(body.texture.size)
        origins.append(origin)
    return Geometry(
        np.array([KINDS.index(geom.kind) for geom, _ in geoms], dtype=np.int64),
        np.array([geom.size for geom, _ in geoms], dtype=np.float64),
        np.array([geom.position for geom, _ in geoms], dtype=np.float64),
        np.array([rotation_of(geom.quaternion) for geom, _ in geoms]),
        np.array([number for _, number in geoms], dtype=np.int64),
        np.asarray(textures_of, dtype=np.int64),
        np.array([MAPPINGS.index(body.mapping) for body in bodies], dtype=np.int64),
        np.array(origins, dtype=np.float64),
        np.array([_around(bodies[number], geom) for geom, number in geoms]),
        np.full(len(bodies), -1, dtype=np.int64),
    )


def _around(body: Body, geom: Geom) -> float:
    """Return how much a body's cylindrical map is stretched on a geom, so that it has no seam."""
    if body.mapping != "cylindrical" or body.texture is None or body.texture.border != "wrap":
        return 1.0
    times = 2.0 * math.pi * geom.size[0] / body.texture.size[0]
    return max(round(times), 1) / times
