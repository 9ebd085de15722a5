"""Convex solids: the pieces of a body as polytopes, or points and segments with a radius.

A body is the union of its pieces, and so a face of a piece that lies inside another is no surface
of the body: it is *virtual*, as in the surface decompositions of Ehmann & Lin (2001). Nothing may
be pushed out of a body through a virtual face. Spheres and capsules are exact: a point or a segment
and a radius. Cylinders and ellipsoids are polytopes with corners on their surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.geometry.bodies import KINDS

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
_FAR = 2.0
"""Half side of an unbounded plane's box [m]."""
_FLAT = 3e-6
"""Distance of a corner from a face that it belongs to, in sizes of the solid."""
_GAP = 1e-6
"""Pieces of a body nearer to each other than this, in sizes of a piece, are joined."""


class ConvexSolid(NamedTuple):
    """A convex polytope, or its ball of radius `radius` [m] at each of its points.

    Without faces it is a point or a segment. A row of `first` arrays and the next are the limits of
    an item's part of the array named after them.
    """

    vertices: Array
    """(n, 3) [m]"""
    normals: Array
    """Of the faces, outwards, (f, 3)."""
    real: NDArray[np.bool_]
    """Which faces are a part of the body's surface, (f,)."""
    face_first: Indices
    """(f + 1,)"""
    face_corners: Indices
    """Vertices of each face, counter-clockwise from outside."""
    edges: Indices
    """Vertices of each edge, (e, 2)."""
    near_first: Indices
    """(n + 1,)"""
    near: Indices
    """The other vertex of each edge at a vertex."""
    around_first: Indices
    """(n + 1,)"""
    around: Indices
    """Faces at each vertex."""
    radius: float
    """[m]"""

    def placed(self, rotation: Array, translation: Array) -> ConvexSolid:
        """Return the solid moved by a rotation (3, 3) and a translation (3,) [m]."""
        return self._replace(
            vertices=self.vertices @ rotation.T + translation,
            normals=np.ascontiguousarray(self.normals @ rotation.T),
        )


@dataclass(frozen=True)
class PieceSet:
    """The pieces of a body, in its frame.

    Parameters
    ----------
    solids : sequence of ConvexSolid
    joined : (n, n) bool array
        Which pieces touch or overlap.
    """

    solids: Sequence[ConvexSolid]
    joined: NDArray[np.bool_]


def _lists(count: int, owners: Indices, items: Indices) -> tuple[Indices, Indices]:
    """Return items grouped by owner, as (count + 1,) limits and the items."""
    order = np.argsort(owners, kind="stable")
    first = np.searchsorted(owners[order], np.arange(count + 1))
    return first.astype(np.int64), items[order].astype(np.int64)


def solid_of_faces(vertices: Array, faces: Sequence[Indices], radius: float = 0.0) -> ConvexSolid:
    """Return a solid of vertices (n, 3) [m] and faces, counter-clockwise from outside.

    A segment has one face without a normal: give no faces, and its edge is added.
    """
    n = len(vertices)
    sizes = np.array([len(face) for face in faces], dtype=np.int64)
    corners = np.concatenate(faces).astype(np.int64) if len(faces) else np.empty(0, np.int64)
    owner = np.repeat(np.arange(len(faces)), sizes)
    normals = np.zeros((len(faces), 3))
    sides: list[tuple[int, int]] = [(0, 1)] if n == 2 else []
    for i, face in enumerate(faces):
        x = vertices[face]
        normals[i] = np.cross(x[1:-1] - x[0], x[2:] - x[0]).sum(axis=0)
        pairs = zip(face.tolist(), np.roll(face, -1).tolist(), strict=True)
        sides += [(a, b) for a, b in pairs if a < b]
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    edges = np.array(sides, dtype=np.int64).reshape(-1, 2)
    near = _lists(n, edges.ravel(), edges[:, ::-1].ravel())
    around = _lists(n, corners, owner)
    limits = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    return ConvexSolid(
        np.ascontiguousarray(vertices, dtype=np.float64), normals, np.ones(len(faces), bool),
        limits, corners, edges, *near, *around, float(radius),
    )  # fmt: skip


def solid_of_points(points: Array) -> ConvexSolid:
    """Return the convex hull of points (n, 3) [m], its coplanar facets merged into faces."""
    from scipy.spatial import ConvexHull  # slow to import

    hull = ConvexHull(points)
    size = float(np.ptp(points, axis=0).max())
    normals, offsets = hull.equations[:, :3], hull.equations[:, 3]
    left = np.ones(len(normals), bool)
    planes: list[tuple[Array, Indices]] = []
    for i in np.argsort(-_areas(points[hull.simplices]), kind="stable"):
        if not left[i]:
            continue
        # All corners on the plane of the largest facet left belong to its face.
        off = points[hull.vertices] @ normals[i] + offsets[i]
        on = hull.vertices[np.abs(off) <= _FLAT * size]
        same = np.isin(hull.simplices, on).all(axis=1) & (normals @ normals[i] > 0.5)
        left &= ~same
        left[i] = False
        planes.append((normals[i], on))
    faces = [_ring(points, normal, on) for normal, on in planes]
    faces = [face for face in faces if len(face) >= 3]
    # A corner of fewer than three faces lies within an edge or a face.
    counts = np.bincount(np.concatenate(faces), minlength=len(points))
    faces = [face[counts[face] >= 3] for face in faces]
    faces = [face for face in faces if len(face) >= 3]
    used, number = np.unique(np.concatenate(faces), return_inverse=True)
    limits = np.cumsum([len(face) for face in faces])[:-1]
    return solid_of_faces(points[used], np.split(number.astype(np.int64), limits))


def _areas(triangles: Array) -> Array:
    sides = triangles[:, 1:] - triangles[:, :1]
    return np.asarray(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1))


def _ring(points: Array, normal: Array, on: Indices) -> Indices:
    """Return the corners `on` of a face in their order, without those within its sides."""
    x = points[on] - points[on].mean(axis=0)
    u = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    u /= np.linalg.norm(u)
    v = np.cross(normal, u)
    order = np.argsort(np.arctan2(x @ v, x @ u), kind="stable")
    x = x[order]
    before, after = x - np.roll(x, 1, axis=0), np.roll(x, -1, axis=0) - x
    lengths = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    turns = np.cross(before, after) @ normal
    return np.asarray(on[order][turns > 1e-9 * lengths], dtype=np.int64)


def box_solid(half: Array) -> ConvexSolid:
    """Return a box of half sides (3,) [m]."""
    corners = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    return solid_of_points(corners * half)


def _around_axis(radii: Array, heights: Array, sides: int) -> Array:
    """Return points (n, 3) of a surface of revolution around z."""
    angle = 2.0 * np.pi * np.arange(sides) / sides
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    rings = [
        np.column_stack([r * circle, np.full(sides, z)])
        for r, z in zip(radii, heights, strict=True)
    ]
    return np.concatenate(rings)


def solid_of_kind(kind: str, size: Array, sides: int) -> ConvexSolid:
    """Return a simple solid in its frame.

    Parameters
    ----------
    kind : {"plane", "sphere", "capsule", "ellipsoid", "cylinder", "box"}
    size : (3,) array
        As for `Geom` [m].
    sides : int
        Number of sides of a cylinder, and corners around an ellipsoid.
    """
    if kind == "sphere":
        return solid_of_faces(np.zeros((1, 3)), [], size[0])
    if kind == "capsule":
        ends = np.array([[0.0, 0.0, -size[1]], [0.0, 0.0, size[1]]])
        return solid_of_faces(ends, [], size[0])
    if kind == "box":
        return box_solid(size)
    if kind == "plane":
        half = np.where(size[:2] > 0.0, size[:2], _FAR)
        solid = box_solid(np.array([*half, 0.5 * _FAR]))
        return solid.placed(np.eye(3), np.array([0.0, 0.0, -0.5 * _FAR]))
    if kind == "cylinder":
        return solid_of_points(_around_axis(size[[0, 0]], size[1] * np.array([-1, 1]), sides))
    latitude = np.pi * (np.arange(sides // 2 + 1) / (sides // 2) - 0.5)
    return solid_of_points(size * _around_axis(np.cos(latitude), np.sin(latitude), sides))


def solid_of_geom(model: mujoco.MjModel, geom: int, sides: int) -> ConvexSolid:
    """Return a geom of a model in its body's frame; `sides` as for `solid_of_kind`."""
    kind = mujoco.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_").lower()
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
    if kind == "mesh":
        mesh = int(model.geom_dataid[geom])
        begin, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        solid = solid_of_points(model.mesh_vert[begin : begin + count].astype(np.float64))
    elif kind in KINDS:
        solid = solid_of_kind(kind, np.array(model.geom_size[geom]), sides)
    else:
        raise AsperityError(f"a geom of type {kind} is no convex piece; valid: {', '.join(KINDS)}")
    return solid.placed(turn.reshape(3, 3), np.array(model.geom_pos[geom]))


def inside_solid(solid: ConvexSolid, points: Array, slack: float) -> NDArray[np.bool_]:
    """Return which points (n, 3) lie in a solid, or outside it by at most `slack` [m]."""
    if not len(solid.normals):
        ends = solid.vertices[[0, -1]]
        along = ends[1] - ends[0]
        s = np.clip((points - ends[0]) @ along / max(along @ along, 1e-300), 0.0, 1.0)
        away = np.linalg.norm(points - ends[0] - s[:, None] * along, axis=1)
        return np.asarray(away <= solid.radius + slack)
    anchors = solid.vertices[solid.face_corners[solid.face_first[:-1]]]
    off = points @ solid.normals.T - np.einsum("ij,ij->i", anchors, solid.normals)
    return np.asarray(off.max(axis=1) <= slack)


def pieces_of(solids: Sequence[ConvexSolid]) -> PieceSet:
    """Return the pieces of one body: their virtual faces marked, and which of them are joined.

    A face is virtual if its middle and places near its corners all lie in other pieces.
    """
    count = len(solids)
    joined = np.eye(count, dtype=bool)
    middles = np.array([solid.vertices.mean(axis=0) for solid in solids])
    radii = np.array([
        np.linalg.norm(solid.vertices - middle, axis=1).max() + solid.radius
        for solid, middle in zip(solids, middles, strict=True)
    ])  # fmt: skip
    away = np.linalg.norm(middles[:, None] - middles, axis=2) - radii[:, None] - radii
    marked: list[ConvexSolid] = []
    for i, solid in enumerate(solids):
        slack = _GAP * radii[i]
        points, face = _points_on(solid, slack)
        covered = np.zeros(len(points), bool)
        for j in np.flatnonzero(away[i] <= 2.0 * slack).tolist():
            if j != i:
                there = inside_solid(solids[j], points, slack)
                covered |= there
                joined[i, j] |= there.any()
        real = np.ones(len(solid.normals), bool)
        if len(points):
            real = np.bincount(face, ~covered, len(real)) > 0
        marked.append(solid._replace(real=real))
    return PieceSet(marked, joined | joined.T)


def _points_on(solid: ConvexSolid, out: float) -> tuple[Array, Indices]:
    """Return points (n, 3) `out` [m] over the faces of a solid, and the face of each.

    The middle of a face, and places just within its corners, where the faces of neighbours end too.
    """
    sizes = np.diff(solid.face_first)
    face = np.repeat(np.arange(len(sizes)), sizes)
    corners = solid.vertices[solid.face_corners]
    middles = np.stack(
        [np.bincount(face, corners[:, k], len(sizes)) / np.maximum(sizes, 1) for k in range(3)], 1
    )
    points = np.concatenate([middles[face] + 0.99 * (corners - middles[face]), middles])
    face = np.concatenate([face, np.arange(len(sizes))])
    return points + out * solid.normals[face], face
