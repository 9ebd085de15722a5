"""Unit normals at the corners of triangles, along which a texture displaces them.

A displaced surface opens wherever corners at one vertex have different normals. So all triangles
around a vertex share one normal, weighted by their angles there (Thuermer and Wuethrich, J.
Graphics Tools 3, 43 (1998)), except across hard edges. Sharing is decided fan by fan: around a
vertex, corners are joined from triangle to triangle over edges that are not hard, so a crease that
ends within a surface separates nothing at its end.

The normal is interpolated over a whole triangle, so a rounded rim would tilt the flat face beside
it, by as much as its triangles are large. So a flat face overrules the far smaller facets round it.
"""

from __future__ import annotations

import numpy as np

from asperity._core.arrays import Array, Indices, Mask
from asperity.geometry.mesh.checks import count_of, extents_of, facet_heights, joined
from asperity.geometry.mesh.topology import Edges, crosses, edges_of, meeting_corners, next_corner

FLAT = 1e-6
"""Facets whose unit normals differ by less are coplanar [rad]: the accuracy of float32 files."""
HARD_ANGLE = 44.0
"""Edges that turn by more are hard unless something else is said [degrees].

Below the 45 degrees of a chamfer and of a prism of eight sides, above the 41.8 of the coarsest
sphere, an icosahedron: what has eight sides or fewer is a prism, what has nine or more is round.
"""
_NEARLY_FLAT = 1e-3
"""Facets whose normals differ by less are of one flat face: files have few digits [rad]."""
_OVERRULED, _EQUAL = 1 / 8, 1 / 4
"""Shares of a flat face's area up to which a facet beside it has no influence on their common
normal, and from which on it has all; rows of quads on a sphere differ by 1/3 at most."""
_SLIVER = 1e-6
_CROWD = 64


def flat_normals(
    triangles: Array, edges: Edges, flat_up_to: float = FLAT
) -> tuple[Array, Indices, Mask]:
    """Return the normals of facets, exactly equal within a plane; their planes; and the slivers.

    Parameters
    ----------
    triangles : (m, 3, 3) array
    edges : Edges
    flat_up_to : float
        Difference of the unit normals of neighbours up to which they are coplanar [rad].

    Returns
    -------
    normals : (m, 3) array
    plane : (m,) array
        Index of the connected coplanar set of each facet.
    sliver : (m,) array
        Facets so thin that their normals are dominated by rounding of their vertices.
    """
    product = crosses(triangles)
    area = np.linalg.norm(product, axis=1)
    normals = product / area[:, None]
    size = float(extents_of(triangles.reshape(-1, 3)).max())
    sliver = facet_heights(triangles) < _SLIVER * size
    f, g = edges.pairs.T // 3
    flat = np.linalg.norm(normals[f] - normals[g], axis=1) < flat_up_to
    flat &= ~sliver[f] & ~sliver[g]
    plane = joined(len(normals), f[flat], g[flat])
    mean = _unit(_sums(plane, product, plane.max() + 1))[plane]
    # A very finely curved surface is one chain of coplanar pairs, but no plane.
    bent = np.linalg.norm(mean - normals, axis=1) > 2.0 * flat_up_to
    bent = np.isin(plane, plane[bent])
    plane = np.where(bent, plane.max() + 1 + np.arange(len(plane)), plane)
    return np.where(bent[:, None], normals, mean), plane, sliver


def smooth_normals(
    vertices: Array, faces: Indices, at: Indices, hard_angle: float | None, notes: list[str],
    *, note_hard: bool = True,
) -> Array:  # fmt: skip
    """Return the corners' normals (m, 3, 3), computed from the triangles.

    Parameters
    ----------
    vertices : (n, 3) array
    faces : (m, 3) array
    at : (m, 3) array
        Places of the corners.
    hard_angle : float or None
        Edges whose normals differ by more are hard [rad]; None: no edge is hard.
    notes : list of str
        Extended.
    note_hard : bool
        Whether it is noted that there are hard edges.
    """
    triangles = vertices[faces]
    edges = edges_of(at)
    facets, plane, sliver = flat_normals(triangles, edges)
    limit = -2.0 if hard_angle is None else np.cos(hard_angle)
    group = _fans(at, edges, facets, sliver, limit, notes if note_hard else [])
    weights = _angles(triangles)
    # The middle corner of a sliver has an angle of nearly pi and a normal made of rounding.
    alone = _sums(group, np.where(sliver[:, None], 0.0, weights).ravel(), group.max() + 1) == 0.0
    weights = np.where(sliver[:, None] & ~alone[group].reshape(-1, 3), 0.0, weights)
    weights *= _shares_beside_flat(triangles, edges, group)
    weighted = (weights[:, :, None] * facets[:, None]).reshape(-1, 3)
    total = _sums(group, weighted, group.max() + 1)
    lost = np.linalg.norm(total, axis=1) < 1e-6 * _sums(group, weights.ravel(), group.max() + 1)
    lost |= ~np.isfinite(total).all(axis=1) | ~total.any(axis=1)
    normals = _unit(np.where(lost[:, None], 1.0, total))
    _level(normals, group, np.repeat(plane, 3), weights.ravel() > 0.0, np.repeat(facets, 3, axis=0))
    corners = normals[group].reshape(-1, 3, 3)
    lost_corners = lost[group].reshape(-1, 3)
    if lost.any():
        places = count_of(lost.sum(), "place")
        notes.append(f"at {places} the triangles' normals cancel: each keeps its own there")
    return np.where(lost_corners[:, :, None], facets[:, None], snapped(corners, facets))


def _shares_beside_flat(triangles: Array, edges: Edges, group: Indices) -> Array:
    """Return how much each corner counts in its fan (m, 3): 0 far smaller than a flat face to 1.

    Areas are those of whole flat faces, so that it does not matter how these are meshed. A flat
    face has at least two triangles: in a curved surface of single triangles all count. So do
    facets that turn by more than an edge that is soft by default: displaced along the normal of a
    flat face they would move within their own plane.
    """
    facets, face, sliver = flat_normals(triangles, edges, _NEARLY_FLAT)
    area = np.bincount(face, np.linalg.norm(crosses(triangles), axis=1))[face]
    flat = (np.bincount(face)[face] > 1) & ~sliver
    ruling = np.repeat(np.where(flat, area, 0.0), 3)
    ruler = np.zeros(group.max() + 1, dtype=np.int64)
    order = np.argsort(ruling, kind="stable")
    ruler[group[order]] = order // 3  # the last one of each fan: the largest
    largest = np.where(flat, area, 0.0)[ruler[group]]
    ratio = np.repeat(area, 3) / np.maximum(largest, 1e-300)
    shares = np.clip((ratio - _OVERRULED) / (_EQUAL - _OVERRULED), 0.0, 1.0)
    cosine = np.einsum("ij,ij->i", np.repeat(facets, 3, axis=0), facets[ruler[group]])
    return np.where(cosine < np.cos(np.radians(HARD_ANGLE)), 1.0, shares).reshape(-1, 3)


def snapped(corners: Array, facets: Array) -> Array:
    """Return corner normals (m, 3, 3); those within a plane exactly equal to the plane's (m, 3)."""
    near = np.linalg.norm(corners - facets[:, None], axis=2) < FLAT
    return np.where(near[:, :, None], facets[:, None], corners)


def _level(normals: Array, group: Indices, plane: Indices, counts: Mask, facets: Array) -> None:
    """Give fans within one plane exactly the plane's normal, slivers included."""
    low, high = (np.full(len(normals), k) for k in (np.iinfo(np.int64).max, -1))
    np.minimum.at(low, group[counts], plane[counts])
    np.maximum.at(high, group[counts], plane[counts])
    level = counts & (low == high)[group]
    normals[group[level]] = facets[level]


def _fans(
    at: Indices, edges: Edges, facets: Array, sliver: Mask, limit: float, notes: list[str]
) -> Indices:
    """Return the index of the fan of each corner (3 m,); the corners of one share a normal."""
    h, g = edges.pairs.T
    cosine = np.einsum("ij,ij->i", facets[h // 3], facets[g // 3])
    soft = (cosine >= limit - 1e-12) | sliver[h // 3] | sliver[g // 3]
    if not soft.all():
        hard = count_of(np.count_nonzero(~soft), "hard edge")
        notes.append(f"the displaced surface opens at {hard}")
    start, end = meeting_corners(at.ravel(), h, g)
    over = np.concatenate([start[soft], end[soft]])
    # Cracks and T-junctions split fans: one that ends at borders may continue another.
    whole = joined(at.size, *np.concatenate([start, end]).T)
    over = np.concatenate([over, _over_borders(at.ravel(), edges, facets, whole, limit)])
    return joined(at.size, over[:, 0], over[:, 1])


def _over_borders(
    places: Indices, edges: Edges, facets: Array, whole: Indices, limit: float
) -> Indices:
    """Return pairs of corners at borders that meet at a vertex but share no edge."""
    half = np.flatnonzero(edges.borders)
    corners = np.unique(np.concatenate([half, next_corner(half)]))
    corners = corners[np.argsort(places[corners], kind="stable")]
    found = [np.zeros((0, 2), dtype=np.int64)]
    for step in range(1, min(_CROWD, len(corners))):
        a, b = corners[:-step], corners[step:]
        met = places[a] == places[b]
        if not met.any():
            break
        met &= whole[a] != whole[b]
        met &= np.einsum("ij,ij->i", facets[a // 3], facets[b // 3]) >= limit - 1e-12
        found.append(np.stack([a[met], b[met]], axis=1))
    return np.concatenate(found)


def _angles(triangles: Array) -> Array:
    """Return the angles at the corners of triangles [rad], (m, 3, 3) -> (m, 3)."""
    ahead = np.roll(triangles, -1, axis=1) - triangles
    back = np.roll(triangles, 1, axis=1) - triangles
    across = np.linalg.norm(np.cross(ahead, back), axis=2)
    return np.arctan2(across, np.einsum("ijk,ijk->ij", ahead, back))


def _sums(group: Indices, values: Array, count: int) -> Array:
    """Return the sums of values (n,) or (n, 3) over groups."""
    if values.ndim == 1:
        return np.bincount(group, values, count).astype(np.float64)
    return np.stack([np.bincount(group, column, count) for column in values.T], axis=1)


def _unit(vectors: Array) -> Array:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(lengths > 0.0, lengths, 1.0)


def given_normals(
    vertices: Array, faces: Indices, at: Indices, normals: Array, notes: list[str]
) -> Array:
    """Return given normals at unit length, pointing to the side that their triangles face."""
    edges = edges_of(at)
    facets, _, sliver = flat_normals(vertices[faces], edges)
    largest = np.abs(normals).max(axis=2, keepdims=True)
    unit = _unit(normals / np.where(largest > 0.0, largest, 1.0))
    none = np.all(unit == 0.0, axis=2)
    if none.any():
        notes.append(f"{count_of(none.sum(), 'given normal')} of no length: the facet's taken")
    unit = np.where(none[:, :, None], facets[:, None], unit)
    cosine = np.einsum("ijk,ik->ij", unit, facets)
    behind = (cosine.sum(axis=1) < 0.0) & ~sliver
    if behind.any():
        notes.append(
            f"given normals of {count_of(behind.sum(), 'triangle')} pointed inwards: turned round"
        )
        unit = np.where(behind[:, None, None], -unit, unit)
        cosine = np.where(behind[:, None], -cosine, cosine)
    steep = np.count_nonzero((cosine <= 0.0) & ~sliver[:, None])
    if steep:
        notes.append(f"{count_of(steep, 'given normal')} more than 90 degrees off the triangle's")
    _note_partings(at, edges, unit, notes)
    return snapped(unit, facets)


def _note_partings(at: Indices, edges: Edges, unit: Array, notes: list[str]) -> None:
    flat = unit.reshape(-1, 3)
    parted = np.zeros(len(edges.pairs), dtype=bool)
    for ends in meeting_corners(at.ravel(), *edges.pairs.T):
        parted |= np.linalg.norm(flat[ends[:, 0]] - flat[ends[:, 1]], axis=1) > 1e-3
    if parted.any():
        notes.append(
            f"given normals differ across {100 * parted.mean():.3g} % of the edges, where the "
            "displaced surface opens; hard_angle=180 computes smooth ones"
        )
