"""Triangulation of geoms, in the geom's frame.

Boxes and planes are exact. Round geoms are approximated from within; the largest distance of their
triangles below the surface is returned with them.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity.geometry.bodies import Geom

Triangles = tuple[Array, Indices, Array, float]

_ROUND = 16
"""Triangles around a circle."""
_UNBOUNDED = 100.0
"""Half side of an unbounded plane [m]."""


def is_round(geom: Geom) -> bool:
    """Return whether any part of a geom's surface is curved."""
    return geom.kind in ("sphere", "capsule", "ellipsoid", "cylinder")


def geom_triangles(geom: Geom) -> Triangles:
    """Return vertices (n, 3) [m], faces (m, 3), corner normals (m, 3, 3), and the slack [m]."""
    if geom.kind == "box":
        return (*_box(np.asarray(geom.size)), 0.0)
    if geom.kind == "plane":
        half = [side if side > 0.0 else _UNBOUNDED for side in geom.size[:2]]
        corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * [*half, 0.0]
        normals = np.tile([0.0, 0.0, 1.0], (2, 3, 1))
        return corners, np.array([[0, 1, 2], [0, 2, 3]]), normals, 0.0
    radius = max(geom.size) if geom.kind == "ellipsoid" else geom.size[0]
    vertices, faces = _turned(_profile(geom))
    if geom.kind == "ellipsoid":
        vertices = vertices * np.asarray(geom.size)
    points = vertices[faces]
    f = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    kept = np.linalg.norm(f, axis=1) > 1e-12 * radius * radius
    faces, f = faces[kept], f[kept]
    f /= np.linalg.norm(f, axis=1)[:, None]
    # Twice the sagitta of one step, since triangles deviate in both directions.
    slack = 2.0 * radius * (1.0 - math.cos(math.pi / _ROUND))
    return vertices, faces, np.repeat(f[:, None], 3, axis=1), slack


def _box(half: Array) -> tuple[Array, Indices, Array]:
    signs = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], float)
    faces, normals = [], []
    for axis in range(3):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        for sign in (-1.0, 1.0):
            mine = np.flatnonzero(signs[:, axis] == sign)
            # Around the face, counter-clockwise as seen from outside.
            turn = np.arctan2(signs[mine, two], signs[mine, one]) * sign
            a, b, c, d = mine[np.argsort(turn)]
            faces += [[a, b, c], [a, c, d]]
            f = np.zeros(3)
            f[axis] = sign
            normals += [np.tile(f, (3, 1))] * 2
    return signs * half, np.array(faces), np.array(normals)


def _profile(geom: Geom) -> Array:
    """Return the profile from the bottom up: (distance from the axis, height)."""
    steps = np.linspace(-0.5 * math.pi, 0.5 * math.pi, _ROUND // 2 + 1)
    arc = np.stack([np.cos(steps), np.sin(steps)], axis=1)
    arc[[0, -1], 0] = 0.0
    if geom.kind == "ellipsoid":
        return arc
    if geom.kind == "sphere":
        return arc * geom.size[0]
    radius, half = geom.size[0], geom.size[1]
    if geom.kind == "cylinder":
        return np.array([[0, -half], [radius, -half], [radius, half], [0, half]], float)
    middle = len(arc) // 2
    low, high = arc[: middle + 1] * radius, arc[middle:] * radius
    shift = np.array([0.0, half])
    return np.concatenate([low - shift, high + shift])


def _turned(profile: Array) -> tuple[Array, Indices]:
    """Return a surface of revolution around z, as triangles."""
    angles = np.arange(_ROUND) * (2.0 * math.pi / _ROUND)
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    vertices = np.concatenate([np.column_stack([r * ring, np.full(_ROUND, z)]) for r, z in profile])
    faces = []
    for i in range(len(profile) - 1):
        for j in range(_ROUND):
            a, b = i * _ROUND + j, i * _ROUND + (j + 1) % _ROUND
            faces += [[a, b, b + _ROUND], [a, b + _ROUND, a + _ROUND]]
    return vertices, np.array(faces)
