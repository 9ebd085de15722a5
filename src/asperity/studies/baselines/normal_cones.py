r"""Bounding volume hierarchies of triangles with a sphere and a normal cone at every node.

Johnson & Cohen (2001), *Spatialized normal cone hierarchies*. Two nodes can hold points p and q at
a local minimum of distance only if some line between their spheres lies within both cones: with the
vector a between the centres, radii r and s, and half angles alpha and beta of the cones,

    angle(a, axis_A) <= alpha + gamma,   angle(-a, axis_B) <= beta + gamma,
    sin gamma = (r + s) / |a| .

The cone of a triangle contains the normals of all triangles that share a corner with it, because
the normals at an edge lie between those of its two triangles. A sphere or a capsule is one
degenerate triangle, a point or a segment with a radius, whose cone holds all directions.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.mesh.topology import edges_of
from asperity.studies.baselines.displaced_surfaces import DisplacedSurface

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
_SAME = 1e-9
"""Points nearer than this are welded [m]."""


class Tree(NamedTuple):
    """A full binary tree; its leaves are triangles, in their order.

    Node k has the children 2 k + 1 and 2 k + 2; the last level of nodes are the leaves.
    """

    triangles: Array
    """(m, 3, 3) [m]"""
    normals: Array
    """(m, 3), unit; 0 of a point or a segment."""
    thick: Array
    """(m,) radius of a sphere or a capsule around a point or a segment, else 0 [m]."""
    corners: Indices
    """(m, 3) number of each corner; corners in one place have one number."""
    goes_on: NDArray[np.bool_]
    """(m, 3) which sides have no neighbour, but the body goes on beyond them."""
    first: Indices
    """(m + 1,) index of the first neighbour of each triangle."""
    neighbours: Indices
    """Triangles that share a corner with each triangle, concatenated."""
    middles: Array
    """(nodes, 3) [m]"""
    radii: Array
    """(nodes,) [m]; -1 of an empty node."""
    axes: Array
    """(nodes, 3), unit."""
    angles: Array
    """(nodes,) [rad]"""
    leaves: int
    """Number of leaves, a power of two."""


def tree_of(surface: DisplacedSurface, thick: Array | None = None, *, closed: bool = True) -> Tree:
    """Return the tree of a surface's triangles.

    Parameters
    ----------
    surface : DisplacedSurface
    thick : (m,) array, optional
        Radius around each face [m], whose three points are then one or two.
    closed : bool
        The surface is that of a solid: it goes on, within other parts of the body, beyond a side
        that only one triangle has.
    """
    points, faces = _welded(surface)
    thick = np.zeros(len(faces)) if thick is None else thick
    triangles = points[faces]
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    size = np.linalg.norm(cross, axis=1)
    flat = thick == 0.0
    # Slivers have no reliable normal.
    least = 1e-6 * np.median(size[flat]) if flat.any() else 0.0
    kept = (size > least) | ~flat
    triangles, faces, thick = triangles[kept], faces[kept], thick[kept]
    normals = cross[kept] / np.where(flat, size, 1.0)[kept][:, None]
    normals[~flat[kept]] = 0.0
    order = np.argsort(_morton(triangles.mean(axis=1)), kind="stable")
    triangles, faces, normals, thick = triangles[order], faces[order], normals[order], thick[order]
    first, neighbours = _neighbours(faces)
    owner = np.repeat(np.arange(len(faces)), np.diff(first))
    cosines = np.einsum("ij,ij->i", normals[owner], normals[neighbours])
    own = np.zeros(len(faces))
    np.maximum.at(own, owner, np.arccos(np.clip(cosines, -1.0, 1.0)))
    alone = edges_of(faces).borders.reshape(-1, 3) & (thick == 0.0)[:, None]
    own[thick > 0.0] = math.pi
    if not closed:
        # At the border of a sheet the nearest place lies on a side.
        own[alone.any(axis=1)] = math.pi
    goes_on = alone & closed
    return Tree(
        np.ascontiguousarray(triangles), np.ascontiguousarray(normals), thick, faces, goes_on,
        first, neighbours, *_nodes(triangles, normals, thick, own),
    )  # fmt: skip


def _welded(surface: DisplacedSurface) -> tuple[Array, Indices]:
    """Return points and faces of a surface with coincident points welded."""
    _, first, number = np.unique(
        np.round(surface.points / _SAME).astype(np.int64), axis=0, return_index=True,
        return_inverse=True,
    )  # fmt: skip
    return surface.points[first], number.ravel()[surface.faces]


def _morton(places: Array) -> Indices:
    """Return Morton codes of places, 20 bits an axis (Morton 1966)."""
    low, extent = places.min(axis=0), max(float(np.ptp(places, axis=0).max()), 1e-12)
    cells = ((places - low) / extent * (2**20 - 1)).astype(np.int64)
    out = np.zeros(len(places), np.int64)
    for bit in range(20):
        for axis in range(3):
            out |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return out


def _neighbours(faces: Indices) -> tuple[Indices, Indices]:
    from scipy.sparse import csr_array

    m = len(faces)
    touch = csr_array(
        (np.ones(3 * m, np.int8), (np.repeat(np.arange(m), 3), faces.ravel())),
        shape=(m, int(faces.max()) + 1),
    )
    shared = (touch.astype(np.int32) @ touch.T.astype(np.int32)).tocsr()
    shared.setdiag(0)
    shared.eliminate_zeros()
    return shared.indptr.astype(np.int64), shared.indices.astype(np.int64)


def _nodes(
    triangles: Array, normals: Array, thick: Array, own: Array
) -> tuple[Array, Array, Array, Array, int]:
    """Return centres, radii, axes, angles and the number of leaves, built from the leaves up."""
    m = len(triangles)
    leaves = 1 << max(math.ceil(math.log2(m)), 0)
    count = 2 * leaves - 1
    middles, radii = np.zeros((count, 3)), np.full(count, -1.0)
    axes, angles = np.zeros((count, 3)), np.zeros(count)
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    sums = np.zeros((count, 3))
    there = slice(leaves - 1, leaves - 1 + m)
    low[there] = triangles.min(axis=1) - thick[:, None]
    high[there] = triangles.max(axis=1) + thick[:, None]
    sums[there], axes[there], angles[there] = normals, normals, own
    middles[there] = triangles.mean(axis=1)
    radii[there] = np.linalg.norm(triangles - middles[there][:, None], axis=2).max(axis=1)
    radii[there] += thick
    begin = leaves - 1
    while begin > 0:
        start = (begin - 1) // 2
        here = np.arange(start, begin)
        a, b = 2 * here + 1, 2 * here + 2
        low[here], high[here] = np.minimum(low[a], low[b]), np.maximum(high[a], high[b])
        sums[here] = sums[a] + sums[b]
        full = radii[a] >= 0.0
        here, a, b = here[full], a[full], b[full]
        middles[here] = 0.5 * (low[here] + high[here])
        length = np.linalg.norm(sums[here], axis=1)
        axes[here] = np.where(
            length[:, None] > 1e-9, sums[here] / np.maximum(length, 1e-9)[:, None], [0.0, 0.0, 1.0]
        )
        for child in (a, b):
            held = radii[child] >= 0.0
            reach = np.linalg.norm(middles[child] - middles[here], axis=1) + radii[child]
            radii[here] = np.where(held, np.maximum(radii[here], reach), radii[here])
            cosine = np.einsum("ij,ij->i", axes[child], axes[here])
            wide = np.arccos(np.clip(cosine, -1.0, 1.0)) + angles[child]
            angles[here] = np.where(held, np.maximum(angles[here], wide), angles[here])
        # The sphere around the box may be smaller than the one around the children's spheres.
        box = 0.5 * np.linalg.norm(high[here] - low[here], axis=1)
        radii[here] = np.minimum(radii[here], box)
        begin = start
    return middles, radii, axes, np.minimum(angles, math.pi), leaves
