"""Hard edges of a mesh, where its displaced surface is discontinuous, and the facets there.

Neighbours whose normals w and texture coordinates agree along their common edge have a continuous
displaced surface. At other edges each facet is extended beyond its border. With phi the angle
between two planes and heights within +-R, their displaced planes intersect within

    R (1 + |cos phi|) / sin phi

of the edge; a facet is extended by at most 2 R, enough for 53 degrees and more.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array, Indices, Mask
from asperity._core.structures import by_reference
from asperity.geometry.mesh.checks import SAME_PLACE, same_places

_FARTHEST = 2.0
"""Largest extension beyond a border, over the height of the texture [-]."""
_SAME_NORMAL = 1e-6
"""Difference below which unit normals count as equal."""
_FLAT = 1e-6
"""Sine of the angle below which facets count as coplanar."""


@by_reference
class Rims(NamedTuple):
    """Borders of the facets of one body."""

    points: Array
    """Corners [m], (n, 8, 3)."""
    sides: Indices
    origin: Array
    axes: Array
    """x, y and the normal of each plane, in rows, (n, 3, 3)."""
    borders: Array
    """k0, k1, k2 of each side, (n, 8, 3)."""
    w: Array
    """Normals in the body's frame, (n, 3, 3): at the origin, by x, by y."""
    place: Array
    """The same for texture coordinates [m], (n, 3, 2); zeros if they cannot differ."""
    period: Array
    """Of the texture [m], (2,); infinite if it is not periodic."""
    close: float
    """Distance below which points are equal [m]."""


@by_reference
class FacetEdges(NamedTuple):
    """Extensions and neighbours of facets at hard edges."""

    reach: Array
    """Extension of each facet beyond each of its sides [m], (n, 8)."""
    pairs: Indices
    """Facets that touch at a hard edge, in both orders, (p, 2)."""
    is_convex: Mask
    """Whether each of a pair is behind the plane of the other, (p,)."""
    has_corners: Mask
    """Whether one of a facet's pairs touches it only at a corner, (n,)."""


def facet_edges(rims: Rims, height: float) -> FacetEdges:
    """Return the edges of facets whose texture is within +-`height` [m]."""
    count = len(rims.sides)
    face, side = np.nonzero(np.arange(rims.points.shape[1]) < rims.sides[:, None])
    after = np.where(side + 1 < rims.sides[face], side + 1, 0)
    start, end = rims.points[face, side], rims.points[face, after]
    places = same_places(start, rims.close)
    number = np.full(rims.points.shape[:2], -1)
    number[face, side] = np.arange(len(face))
    one, two, first, last = _shared_sides(
        places, places[number[face, after]], start, end, rims.close
    )
    breaks = np.maximum(
        _difference(rims, face[one], face[two], first),
        _difference(rims, face[one], face[two], last),
    ) > 1.0  # fmt: skip
    inwards = -np.einsum(
        "ni,nij->nj", rims.borders[face, side, 1:], rims.axes[face, :2]
    )  # into the facet, across the side
    normal = rims.axes[:, 2]
    fall = np.einsum("ij,ij->i", inwards[one], normal[face[two]])
    reach = np.zeros(rims.points.shape[:2])
    cosine = np.abs(np.einsum("ij,ij->i", normal[face[one]], normal[face[two]]))
    far = np.where(
        np.abs(fall) > 1e-3, (1.0 + cosine) / np.maximum(np.abs(fall), 1e-3), 1.0
    )  # where only the textures differ, enough for rays at 45 degrees to the step
    far = height * np.minimum(far, _FARTHEST)
    np.maximum.at(reach, (face[one][breaks], side[one][breaks]), far[breaks])
    # Sides that are hard only in part: the neighbour at the smooth part has its own exits.
    listed = breaks | (reach[face[one], side[one]] > 0.0)
    pairs, convex = np.stack([face[one], face[two]], axis=1), breaks & (fall < -_FLAT)
    by_corner = _corner_pairs(rims, face, side, places)
    known = pairs[:, 0] * count + pairs[:, 1]
    by_corner = by_corner[~np.isin(by_corner[:, 0] * count + by_corner[:, 1], known)]
    has_corners = np.zeros(count, bool)
    has_corners[by_corner[:, 0]] = True
    return FacetEdges(
        reach, np.concatenate([pairs[listed], by_corner]),
        np.concatenate([convex[listed], np.ones(len(by_corner), bool)]), has_corners,
    )  # fmt: skip


def _shared_sides(
    start_at: Indices, end_at: Indices, start: Array, end: Array, close: float
) -> tuple[Indices, Indices, Array, Array]:
    """Return pairs of sides with a common part, in both orders, and the ends of that part."""
    low, high = np.minimum(start_at, end_at), np.maximum(start_at, end_at)
    _, edge, times = np.unique(
        low * (int(high.max()) + 1) + high, return_inverse=True, return_counts=True
    )
    order = np.argsort(edge, kind="stable")
    groups = np.split(order, np.cumsum(times)[:-1])
    one = [np.array([i, j]) for group in groups if len(group) > 1 for i in group for j in group
           if i != j]  # fmt: skip
    pairs = np.array(one, dtype=np.int64).reshape(-1, 2)
    first, last = start[pairs[:, 0]], end[pairs[:, 0]]
    # The other sides may have parts in common, where large polygons end.
    left = np.flatnonzero(times[edge] == 1)
    more = [(pairs, first, last)]
    for i in left:
        along = end[i] - start[i]
        length = float(np.linalg.norm(along))
        along = along / length
        ends = np.stack([start[left], end[left]], axis=1) - start[i]
        t = ends @ along
        off = np.linalg.norm(ends - t[..., None] * along, axis=2).max(axis=1)
        low, high = np.maximum(t.min(axis=1), 0.0), np.minimum(t.max(axis=1), length)
        on = (off < 10.0 * close) & (high - low > 10.0 * close) & (left != i)
        found = np.stack([np.full(on.sum(), i), left[on]], axis=1)
        more.append((found, start[i] + low[on, None] * along, start[i] + high[on, None] * along))
    pairs, first, last = (np.concatenate(part) for part in zip(*more, strict=True))
    return pairs[:, 0], pairs[:, 1], first, last


def _difference(rims: Rims, one: Indices, two: Indices, points: Array) -> Array:
    """Return the difference of two facets at common points, over the tolerance, (n,)."""
    normals, places = [], []
    for facet in (one, two):
        flat = np.einsum("nj,nij->ni", points - rims.origin[facet], rims.axes[facet, :2])
        at = np.concatenate([np.ones((len(flat), 1)), flat], axis=1)
        w = np.einsum("ni,nij->nj", at, rims.w[facet])
        normals.append(w / np.linalg.norm(w, axis=1, keepdims=True))
        places.append(np.einsum("ni,nij->nj", at, rims.place[facet]))
    away = places[0] - places[1]
    whole = np.isfinite(rims.period)
    away[:, whole] -= rims.period[whole] * np.round(away[:, whole] / rims.period[whole])
    # Texture coordinates have single precision.
    most = 10.0 * max(rims.close, SAME_PLACE * float(np.abs(rims.place[:, 0]).max(initial=0.0)))
    return np.asarray(
        np.maximum(
            np.abs(normals[0] - normals[1]).max(axis=1) / _SAME_NORMAL,
            np.abs(away).max(axis=1) / most,
        )
    )


def _corner_pairs(rims: Rims, face: Indices, side: Indices, places: Indices) -> Array:
    """Return facets that differ at a common corner, each behind the other's plane, (p, 2)."""
    order = np.argsort(places, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(places[order])) + 1)
    pairs = np.array(
        [(i, j) for group in groups for i in group for j in group if face[i] != face[j]],
        dtype=np.int64,
    ).reshape(-1, 2)
    one, two = pairs.T
    corner = rims.points[face, side]
    differ = _difference(rims, face[one], face[two], corner[one]) > 1.0
    one, two = one[differ], two[differ]
    convex = _is_behind(rims, face, side, one, two) & _is_behind(rims, face, side, two, one)
    return np.unique(np.stack([face[one[convex]], face[two[convex]]], axis=1), axis=0)


def _is_behind(rims: Rims, face: Indices, side: Indices, one: Indices, two: Indices) -> Mask:
    """Return whether both sides of facets at corners `one` are behind the planes of `two`."""
    sides, normal = rims.sides[face[one]], rims.axes[face[two], 2]
    corner, out = rims.points[face[one], side[one]], np.ones(len(one), bool)
    for step in (1, -1):
        away = rims.points[face[one], (side[one] + step) % sides] - corner
        away /= np.linalg.norm(away, axis=1, keepdims=True)
        out &= np.einsum("ij,ij->i", away, normal) <= _FLAT
    return out
