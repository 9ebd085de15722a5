"""Texture coordinates [m] of the corners of a body's mesh, by its mapping."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from asperity._core.arrays import Array
from asperity.geometry.bodies import Body, map_origin
from asperity.geometry.mesh.mesh import Mesh

if TYPE_CHECKING:
    from asperity.texture.sampled_map import SampledMap


def places_on_map(body: Body, laid: SampledMap | None) -> Array | None:
    """Return the coordinates on a map of every corner of a body's mesh [m], (m, 3, 2).

    None without a mesh or a map, and for triplanar maps, which have three.
    """
    mesh = body.mesh
    if mesh is None or laid is None or body.mapping == "triplanar":
        return None
    if body.mapping == "uv":
        assert mesh.uv is not None
        return mesh.uv * np.asarray(laid.size) - np.asarray(body.offset, dtype=np.float64)
    offset = map_origin(laid, body.offset)
    points = mesh.vertices[mesh.faces]
    if body.mapping == "planar":
        return points[:, :, :2] - offset
    angle = np.arctan2(points[:, :, 1], points[:, :, 0])
    # Corners of a triangle within half a turn of its first.
    angle -= 2.0 * math.pi * np.round((angle - angle[:, :1]) / (2.0 * math.pi))
    length = length_round(mesh, laid)
    return np.stack([angle / (2.0 * math.pi) * length, points[:, :, 2]], axis=2) - offset


def length_round(mesh: Mesh, laid: SampledMap) -> float:
    """Return how long a map is once round the z axis of a mesh, at the mean distance from it [m].

    If the map wraps, it is a whole number of its periods.
    """
    vertices, length = mesh.vertices, laid.size[0]
    around = 2.0 * math.pi * float(np.mean(np.hypot(vertices[:, 0], vertices[:, 1])))
    return max(round(around / length), 1) * length if laid.border == "wrap" else around
