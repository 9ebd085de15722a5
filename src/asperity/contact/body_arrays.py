"""The geoms and textures of a scene's bodies in flat arrays, for compiled kernels."""

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
    """All geoms of a scene. Rows are geoms unless stated otherwise."""

    kind: NDArray[np.int64]
    """Index into `geometry.bodies.KINDS`, (geoms,)."""
    size: NDArray[np.float64]
    """As in MuJoCo [m], (geoms, 3)."""
    position: NDArray[np.float64]
    """In the body's frame [m], (geoms, 3)."""
    rotation: NDArray[np.float64]
    """From the geom's frame to the body's, (geoms, 3, 3)."""
    body: NDArray[np.int64]
    """Number of the body, (geoms,)."""
    texture: NDArray[np.int64]
    """Number of each body's texture, -1 for none; (bodies,)."""
    mapping: NDArray[np.int64]
    """Index of each body's texture mapping in `geometry.bodies.MAPPINGS`, (bodies,)."""
    origin: NDArray[np.float64]
    """Where (u, v) = (0, 0) of the texture lies in each body's frame [m], (bodies, 3)."""
    around: NDArray[np.float64]
    """Factor by which a cylindrical map is stretched to fit a whole number of times, (geoms,)."""
    no_texture: NDArray[np.int64]
    """-1 for each body, to be used in place of `texture` for smooth bodies; (bodies,)."""
    covered: NDArray[np.int64]
    """Faces that another geom of the same rigid body covers, a bit each; see `covered_faces`."""


def flatten_bodies(bodies: Sequence[Body]) -> tuple[PackedTextures, Geometry]:
    """Return the textures and geoms of `bodies` as arrays; a map of zeros counts as no texture."""
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
        np.zeros(len(geoms), dtype=np.int64),
    )


def _around(body: Body, geom: Geom) -> float:
    """Return the factor that stretches a cylindrical map so that it has no seam on a geom."""
    if body.mapping != "cylindrical" or body.texture is None or body.texture.border != "wrap":
        return 1.0
    times = 2.0 * math.pi * geom.size[0] / body.texture.size[0]
    return max(round(times), 1) / times
