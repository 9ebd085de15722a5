"""Texture coordinates [m] of the corners of a body's mesh, by its mapping."""

from __future__ import annotations

import math

import numpy as np

from asperity._core.arrays import Array
from asperity.geometry.bodies import Body, origin_of_map


def places_on_texture(body: Body) -> Array | None:
    """Return the texture coordinates of every corner of a body's mesh [m], (m, 3, 2).

    None without texture, and for triplanar maps, which have three.
    """
    mesh, texture = body.mesh, body.texture
    if mesh is None or texture is None or body.mapping == "triplanar":
        return None
    if body.mapping == "uv":
        assert mesh.uv is not None
        return mesh.uv * np.asarray(texture.size) - np.asarray(body.offset, dtype=np.float64)
    offset = origin_of_map(body)
    points = mesh.vertices[mesh.faces]
    if body.mapping == "planar":
        return points[:, :, :2] - offset
    return _round_z(points, mesh.vertices, texture.size[0], texture.border == "wrap") - offset


def _round_z(points: Array, vertices: Array, length: float, wraps: bool) -> Array:
    """Return u around the z axis, at the mean distance from it, and v along it [m].

    If the texture wraps, u is scaled to a whole number of periods around the axis.
    """
    round_by = 2.0 * math.pi * float(np.mean(np.hypot(vertices[:, 0], vertices[:, 1])))
    if wraps:
        round_by = max(round(round_by / length), 1) * length
    angle = np.arctan2(points[:, :, 1], points[:, :, 0])
    # Corners of a triangle within half a turn of its first.
    angle -= 2.0 * math.pi * np.round((angle - angle[:, :1]) / (2.0 * math.pi))
    return np.stack([angle / (2.0 * math.pi) * round_by, points[:, :, 2]], axis=2)
