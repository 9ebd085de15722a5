"""Convex facets of a mesh: coplanar triangles merged into polygons.

The triangulation of a flat face has no influence on its shape. So triangles that lie in one plane,
are displaced along its normal, and share one affine texture map are merged into convex polygons of
at most `MOST_SIDES` sides: contact then has the same cost and the same result however finely the
face was meshed. All other triangles are facets by themselves.

Positions on a facet are `a = (x, y)` in its plane. The displacement direction over it is
`w = (w0 + w1 x + w2 y) / |...|`, and the texture coordinates are linear in a.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array, Indices
from asperity.geometry.facets.polygons import convex_parts
from asperity.geometry.mesh import checks as mesh_checks
from asperity.geometry.mesh.topology import edges_of

MOST_SIDES = 8
_SAME = 1e-9
_ALIKE = 1e-2
"""Difference of texture maps below which triangles of a plane may have one."""
_SAME_PLACE = 1e-6
"""Distance on the texture that counts as none, over its size: eight times single precision."""
_LEAST_LENGTH = 0.2  # of w before normalisation: opposite corner normals have no mean direction


@dataclass(frozen=True, eq=False)
class Facets:
    """Convex planar pieces of a body's surface, one per row.

    Attributes
    ----------
    origin : (n, 3) array
        Position of a = (0, 0) in the body's frame [m]: the middle of the bounding rectangle.
    axes : (n, 3, 3) array
        x, y and the outward normal of its plane, in rows.
    sides : (n,) int64 array
        Number of corners.
    corners : (n, 8, 2) array
        In its plane, counter-clockwise [m].
    hard : (n, 8) array
        1 for each side (from its corner to the next) that is an edge of the surface; 0 where the
        same plane continues beyond it.
    half : (n, 2) array
        Half sides of the bounding rectangle [m].
    w : (n, 3, 3) array
        w0 [-], w1 and w2 [1/m] in rows.
    uv : (n, 2, 3) array
        u and v at a = 0 [m], and their derivatives by x and by y [-]; zeros without texture.
    region : (n,) int64 array
        Number of the region of the surface that it belongs to.
    """

    origin: Array
    axes: Array
    sides: Indices
    corners: Array
    hard: Array
    half: Array
    w: Array
    uv: Array
    region: Indices

    def __len__(self) -> int:
        return len(self.sides)

    @property
    def points(self) -> Array:
        """Corners in the body's frame [m], (n, 8, 3); those beyond `sides` repeat the last."""
        return self.origin[:, None] + self.corners @ self.axes[:, :2]

    @property
    def least(self) -> Array:
        """Smallest length of w before normalisation over the rectangle, (n,)."""
        w0, slopes = self.w[:, 0], self.w[:, 1:]
        middle = w0 / np.linalg.norm(w0, axis=1)[:, None]
        # The component along the middle direction is linear: least at a corner of the rectangle.
        least = np.einsum("ij,ij->i", w0, middle)
        least -= np.sum(np.abs(np.einsum("ijk,ik->ij", slopes, middle)) * self.half, axis=1)
        return np.maximum(least, _LEAST_LENGTH)

    @property
    def bends(self) -> Array:
        """Bounds of the first [1/m] and second [1/m^2] derivatives of the unit vector w, (n, 2)."""
        size = np.linalg.norm(self.w[:, 1:], axis=2)
        first = np.hypot(size[:, 0], size[:, 1]) / self.least
        return np.stack([first, 3.0 * first**2], axis=1)


def joined(parts: list[Facets]) -> Facets:
    """Return several sets of facets as one."""
    return Facets(
        **{f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Facets)}
    )


def mesh_facets(
    vertices: Array, faces: Indices, normals: Array, uv: Array | None, region: Indices | None = None
) -> Facets:
    """Return the facets of a mesh.

    Parameters
    ----------
    vertices : (n, 3) array
        [m]
    faces : (m, 3) int array
        Triangles with an area, counter-clockwise.
    normals : (m, 3, 3) array
        Unit normals at the corners.
    uv : (m, 3, 2) array or None
        Texture coordinates of the corners [m].
    region : (m,) int array, optional
        Number of the region of each triangle; those of different regions are not merged.
    """
    points = vertices[faces]
    if uv is None:
        uv = np.zeros((len(faces), 3, 2))
    if region is None:
        region = np.zeros(len(faces), dtype=np.int64)
    single = replace(_triangles(points, normals, uv), region=region)
    groups, planes = _plane_groups(faces, points, normals, single)
    alone, polygons = [], []
    for members in _members(planes):
        numbers = np.unique(groups[members])
        whole = _with_one_map(single, points, uv, members) if len(numbers) > 1 else None
        if whole is not None:
            polygons.append(_polygons(whole, 0, points[members]))
            continue
        for number in numbers:
            same = members[groups[members] == number]
            if len(same) == 1:
                alone.append(same[0])
            else:
                polygons.append(_polygons(single, int(same[0]), points[same]))
    return joined([taken(single, np.array(sorted(alone), dtype=np.int64)), *polygons])


def _members(groups: Indices) -> list[Indices]:
    """Return the triangles of each group, in the order of their numbers."""
    order = np.argsort(groups, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(groups[order])) + 1)


def _with_one_map(single: Facets, points: Array, uv: Array, members: Indices) -> Facets | None:
    """Return the first of some triangles of a plane, with a texture map that fits all, if any does.

    Texture coordinates from files and from unwrapping have single precision, so that the maps of
    neighbouring triangles differ by more than rounding; what is felt does not.
    """
    first = taken(single, members[:1])
    flat = (points[members].reshape(-1, 3) - first.origin[0]) @ first.axes[0, :2].T
    wanted = uv[members].reshape(-1, 2)
    ones = np.column_stack([np.ones(len(flat)), flat])
    fitted = np.linalg.lstsq(ones, wanted, rcond=None)[0]
    size = float(np.max(np.abs(uv)))
    if np.max(np.abs(ones @ fitted - wanted)) > _SAME_PLACE * size:
        return None
    return replace(first, uv=fitted.T[None])


def _triangles(points: Array, normals: Array, uv: Array) -> Facets:
    """Return each triangle as a facet, x along its longest side."""
    lengths = np.linalg.norm(np.roll(points, -1, axis=1) - points, axis=2)
    first = np.argmax(lengths, axis=1)
    turn = (first[:, None] + np.arange(3)) % 3
    rows = np.arange(len(points))[:, None]
    points, normals, uv = points[rows, turn], normals[rows, turn], uv[rows, turn]
    x = points[:, 1] - points[:, 0]
    f = np.cross(x, points[:, 2] - points[:, 0])
    x /= np.linalg.norm(x, axis=1)[:, None]
    f /= np.linalg.norm(f, axis=1)[:, None]
    axes = np.stack([x, np.cross(f, x), f], axis=1)
    flat = np.einsum("ijk,ilk->ijl", points - points[:, :1], axes[:, :2])
    low, high = flat.min(axis=1), flat.max(axis=1)
    middle = 0.5 * (low + high)
    corners = flat - middle[:, None]
    origin = points[:, 0] + np.einsum("ij,ijk->ik", middle, axes[:, :2])
    # Linear functions of a that interpolate the corners' values.
    ones = np.concatenate([np.ones_like(corners[:, :, :1]), corners], axis=2)
    linear = np.linalg.solve(ones, np.concatenate([normals, uv], axis=2))
    w = linear[:, :, :3].copy()
    level = np.all(np.abs(normals - axes[:, None, 2]) < 1e-7, axis=(1, 2))
    w[level] = 0.0
    w[level, 0] = axes[level, 2]
    same = np.all(np.abs(normals - normals[:, :1]) < _SAME, axis=(1, 2))
    w[same, 1:] = 0.0
    return Facets(
        origin, axes, np.full(len(points), 3), _padded(corners), np.ones((len(points), MOST_SIDES)),
        0.5 * (high - low), w, np.swapaxes(linear[:, :, 3:], 1, 2).copy(),
        np.zeros(len(points), dtype=np.int64),
    )  # fmt: skip


def _padded(corners: Array) -> Array:
    more = np.repeat(corners[:, -1:], MOST_SIDES - corners.shape[1], axis=1)
    return np.concatenate([corners, more], axis=1)


def taken(facets: Facets, which: NDArray) -> Facets:
    """Return the facets of a mask, or those with given indices, in that order."""
    return Facets(**{f.name: getattr(facets, f.name)[which] for f in fields(Facets)})


def _plane_groups(
    faces: Indices, points: Array, normals: Array, single: Facets
) -> tuple[Indices, Indices]:
    """Return two indices for each triangle: equal for those of one planar piece, and of one plane.

    Those of one planar piece have the same texture map as well.
    """
    corners = _merged_places(points.reshape(-1, 3)).reshape(-1, 3)
    i, j = edges_of(corners).pairs.T // 3
    level = np.all(np.abs(normals - single.axes[:, None, 2]) < 1e-7, axis=(1, 2))
    f = single.axes[:, 2]
    close = level[i] & level[j] & np.all(np.abs(f[i] - f[j]) < 1e-7, axis=1)
    span = float(np.max(np.ptp(points.reshape(-1, 3), axis=0)))
    off = np.abs(np.einsum("ij,ij->i", single.origin[j] - single.origin[i], f[i]))
    close &= (off < 1e-8 * span) & (single.region[i] == single.region[j])
    turn = np.abs(_in_space(single, i) - _in_space(single, j)).max(axis=(1, 2))
    there = np.abs(_at_origin(single, i) - _at_origin(single, j)).max(axis=1)
    same = close & (turn < 1e-7) & (there < 1e-7 * span)
    alike = close & (turn < _ALIKE) & (there < _ALIKE * span)
    count = len(faces)
    return mesh_checks.joined(count, i[same], j[same]), mesh_checks.joined(
        count, i[alike], j[alike]
    )


def _merged_places(places: Array) -> Indices:
    """Return an index for each position, equal for positions that coincide (to rounding)."""
    span = max(float(np.max(np.ptp(places, axis=0))), 1e-300)
    _, number = np.unique(np.round(places / (1e-9 * span)), axis=0, return_inverse=True)
    return np.asarray(number, dtype=np.int64).ravel()


def _in_space(facets: Facets, which: NDArray) -> Array:
    """Return the gradient of (u, v) in the body's frame, (k, 2, 3)."""
    return facets.uv[which, :, 1:] @ facets.axes[which, :2]


def _at_origin(facets: Facets, which: NDArray) -> Array:
    """Return (u, v) of the affine map extrapolated to the origin of the body's frame, (k, 2)."""
    slope = _in_space(facets, which)
    return facets.uv[which, :, 0] - np.einsum("ijk,ik->ij", slope, facets.origin[which])


def _polygons(single: Facets, one: int, points: Array) -> Facets:
    """Return the convex facets of triangles that form one planar piece with facet `one`."""
    axes, origin = single.axes[one], single.origin[one]
    flat = (points - origin) @ axes[:2].T
    parts = convex_parts(flat, MOST_SIDES)
    made = [_polygon(single, one, corners, hard) for corners, hard in parts]
    return joined(made)


def _polygon(single: Facets, one: int, corners: Array, hard: Array) -> Facets:
    """Return a facet with corners given in the plane of facet `one`, x along its longest side."""
    sides = np.roll(corners, -1, axis=0) - corners
    along = sides[np.argmax(np.hypot(sides[:, 0], sides[:, 1]))]
    along = along / math.hypot(*along)
    turn = np.array([along, [-along[1], along[0]]])
    placed = corners @ turn.T
    low, high = placed.min(axis=0), placed.max(axis=0)
    middle = 0.5 * (low + high)
    shift = middle @ turn
    axes = single.axes[one].copy()
    axes[:2] = turn @ axes[:2]
    uv = single.uv[one].copy()
    uv[:, 0] += uv[:, 1:] @ shift
    uv[:, 1:] = uv[:, 1:] @ turn.T
    count = len(corners)
    edge = np.ones(MOST_SIDES)
    edge[:count] = hard
    return Facets(
        (single.origin[one] + shift @ single.axes[one, :2])[None],
        axes[None],
        np.array([count]),
        _padded((placed - middle)[None]),
        edge[None],
        (0.5 * (high - low))[None],
        single.w[one][None],
        uv[None],
        single.region[one][None],
    )
