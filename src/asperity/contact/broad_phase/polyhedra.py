"""Convex bodies with few plane faces: their corners, faces and edges.

Two convex polyhedra can leave each other along the normal of a face of either, or across an edge of
each (`manifold.polyhedron_pair`). A body with many planes does not count as a polyhedron, but a
sphere, or a mesh of one, may be in contact with one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.structures import by_reference
from asperity.contact.body_arrays import Geometry
from asperity.geometry.bodies import Body
from asperity.geometry.facets.facets import Facets
from asperity.texture.packed import PackedTextures

MOST_FACES = 64
"""Maximum number of faces of a polyhedron."""
MOST_EDGES = 3 * MOST_FACES
_SAME_NORMAL = 1e-7
"""Largest difference between the normals of facets of one plane: file formats round to 32 bits."""
_SAME_PLACE = 1e-6
"""Distance between a corner and a plane that contains it, over the size of the body."""
_ROUND, _FLAT = 1e-3, 0.03
"""Largest distance of a spherical mesh's corners from the sphere, and of its facets below it, over
the radius."""
_CLOSED = 1e-4
"""Sum of the vector areas of a closed body's facets, over the sum of their areas."""

Array = NDArray[np.float64]


@by_reference
class Polyhedra(NamedTuple):
    """Corners, faces and edges of all bodies that are polyhedra, each in the frame of its body."""

    corners: Array
    """[m], (corners, 3)."""
    normals: Array
    """Unit normals of the faces, outwards, (faces, 3)."""
    along: Array
    """Unit vectors along the edges, (edges, 3)."""
    beside: Array
    """Normals of the two faces that meet in each edge, (edges, 2, 3)."""
    end: Array
    """One end of each edge [m], (edges, 3)."""
    first_corner: NDArray[np.int64]
    """Row of each body's first corner, and the number of all; (bodies + 1,)."""
    first_face: NDArray[np.int64]
    first_edge: NDArray[np.int64]
    face_of: NDArray[np.int64]
    """Row of the face that each facet of the table lies in, -1 for none; (facets,)."""
    steepness: Array
    """Bound of the slopes of a body's textures [-], (bodies,)."""
    ball: Array
    """Centre and radius of a body that is a sphere [m], (bodies, 4); the radius of others is 0."""


def polyhedra(
    facets: list[Facets], is_plane: Sequence[bool], slopes: Array, bodies: Sequence[Body]
) -> Polyhedra:
    """Collect the polyhedra among bodies with these facets.

    `is_plane` is whether all faces of a body are plane, `slopes` (bodies,) bounds the slopes of
    the textures.
    """
    parts = [
        _polyhedron(each) if plane else _no_parts(each)
        for each, plane in zip(facets, is_plane, strict=True)
    ]
    corners, normals, along, beside, end = (
        np.concatenate([part[i] for part in parts]) for i in range(5)
    )
    first = [np.cumsum([0, *(len(part[i]) for part in parts)]) for i in range(3)]
    ball = np.array([_ball(*each) for each in zip(bodies, facets, strict=True)])
    face_of = np.concatenate([
        np.where(part[5] < 0, -1, part[5] + before)
        for part, before in zip(parts, first[1][:-1], strict=True)
    ])  # fmt: skip
    return Polyhedra(
        corners, normals, along, beside, end, first[0], first[1], first[2], face_of, slopes, ball
    )


def _ball(body: Body, facets: Facets) -> tuple[float, ...]:
    """Return centre and radius of a body that is a sphere [m]; a radius of 0 for others.

    A mesh is a sphere if its corners are on one and its facets not far below it.
    """
    none = 0.0, 0.0, 0.0, 0.0
    if body.mesh is None:
        is_one = len(body.geoms) == 1 and body.geoms[0].kind == "sphere"
        return (*body.geoms[0].position, body.geoms[0].size[0]) if is_one else none
    if len(facets) <= MOST_FACES or not _is_closed(facets):
        return none
    points = body.mesh.vertices
    rows = np.column_stack([2.0 * points, np.ones(len(points))])
    found = np.linalg.lstsq(rows, np.sum(points**2, axis=1), rcond=None)[0]
    centre, radius = found[:3], float(np.sqrt(max(found[3] + found[:3] @ found[:3], 0.0)))
    off = np.abs(np.linalg.norm(points - centre, axis=1) - radius)
    below = np.einsum("ij,ij->i", facets.origin - centre, facets.axes[:, 2])
    is_one = off.max() <= _ROUND * radius and below.min() >= (1.0 - _FLAT) * radius
    return (*centre, radius) if is_one else none


def steepness(textures: PackedTextures, geometry: Geometry, bodies: int) -> Array:
    """Return bounds of the slopes of the bodies' textures [-], (bodies,)."""
    out = np.zeros(bodies)
    for body, surface in zip(geometry.body, geometry.surface, strict=True):
        if geometry.texture[surface] >= 0:
            texture = textures.maps[geometry.texture[surface]]
            # Landau's inequality for |height| <= h and |curvature| <= c.
            slope = np.sqrt(2.0 * texture["max_abs_height"] * texture["max_curvature"])
            out[body] = max(out[body], slope)
    return out


_Parts = tuple[Array, Array, Array, Array, Array, NDArray[np.int64]]


def _no_parts(facets: Facets) -> _Parts:
    """Return the empty parts of a body that is not a polyhedron."""
    face_of = np.full(len(facets), -1)
    return (*np.zeros((3, 0, 3)), np.zeros((0, 2, 3)), np.zeros((0, 3)), face_of)


def _polyhedron(facets: Facets) -> _Parts:
    """Return corners, normals, edges, normals beside them and ends, and each facet's face."""
    if len(facets) < 4:
        return _no_parts(facets)
    there = np.arange(facets.points.shape[1]) < facets.sides[:, None]
    size = float(np.ptp(facets.points[there], axis=0).max())
    offset = np.einsum("ij,ij->i", facets.origin, facets.axes[:, 2]) / size
    all_planes, face_of = np.column_stack([facets.axes[:, 2], offset]), np.full(len(facets), -1)
    planes: list[Array] = []
    while (face_of < 0).any():
        plane = all_planes[np.argmax(face_of < 0)]
        if len(planes) == MOST_FACES:
            return _no_parts(facets)
        off = np.abs(all_planes - plane)
        is_same = (off[:, :3].max(axis=1) <= _SAME_NORMAL) & (off[:, 3] <= _SAME_PLACE)
        face_of[is_same & (face_of < 0)] = len(planes)
        planes.append(plane)
    normals = np.array(planes)[:, :3]
    corners = _distinct(facets.points[there], size)
    over = corners @ normals.T - size * np.array(planes)[:, 3]
    if over.max() > _SAME_PLACE * size or not _is_closed(facets):
        return _no_parts(facets)
    along, beside, end = _edges(corners, normals, np.abs(over) <= _SAME_PLACE * size)
    if len(along) > MOST_EDGES:
        return _no_parts(facets)
    return corners, normals, along, beside, end, face_of


def _distinct(points: Array, size: float) -> Array:
    """Return points without duplicates."""
    _, first = np.unique(np.round(points / (_SAME_PLACE * size)), axis=0, return_index=True)
    return points[np.sort(first)]


def _is_closed(facets: Facets) -> bool:
    """Return whether facets may enclose a volume: their vector areas sum to 0."""
    following = (np.arange(facets.corners.shape[1]) + 1) % facets.sides[:, None]
    x, y = facets.corners[..., 0], facets.corners[..., 1]
    after_x, after_y = (np.take_along_axis(c, following, axis=1) for c in (x, y))
    there = np.arange(facets.corners.shape[1]) < facets.sides[:, None]
    area = 0.5 * np.sum(np.where(there, x * after_y - y * after_x, 0.0), axis=1)
    total = np.linalg.norm(area @ facets.axes[:, 2])
    return bool(total <= _CLOSED * np.abs(area).sum())


def _edges(corners: Array, normals: Array, on: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
    """Return the directions of the edges, the normals beside them, and one end of each.

    `on` is whether each corner (row) is on each face (column).
    """
    along, beside, end = [], [], []
    for one in range(len(normals)):
        for two in range(one):
            shared = corners[on[:, one] & on[:, two]]
            direction = np.cross(normals[one], normals[two])
            if len(shared) >= 2 and np.linalg.norm(direction) > _SAME_NORMAL:
                along.append(direction / np.linalg.norm(direction))
                beside.append([normals[one], normals[two]])
                end.append(shared[0])
    return np.reshape(along, (-1, 3)), np.reshape(beside, (-1, 2, 3)), np.reshape(end, (-1, 3))
