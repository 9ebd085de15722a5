r"""Bounding volume hierarchies of triangles with a sphere and a normal cone at every node.

Johnson & Cohen (2001), *Spatialized normal cone hierarchies*. Two nodes can hold points p and q at
a local minimum of distance only if some line between their spheres lies within both cones: with the
vector a between the centres, radii r and s, and half angles alpha and beta of the cones,

    angle(a, axis_A) <= alpha + gamma,   angle(-a, axis_B) <= beta + gamma,
    sin gamma = (r + s) / |a| .

The cone of a triangle contains the normals of all triangles that share a corner with it, because
the normals at an edge lie between those of its two triangles.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, kernel
from asperity.studies.baselines.displaced_surfaces import DisplacedSurface
from asperity.studies.baselines.triangle_pairs import nearest_points

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
    """(m, 3), unit."""
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


class RigidMotion(NamedTuple):
    """A transform from one frame into another."""

    rotation: Array
    """(3, 3)"""
    translation: Array
    """(3,) [m]"""


class NeighbourScratch(NamedTuple):
    """Memory of `_is_least`."""

    triangle: Array
    """A neighbour in the other frame (3, 3) [m]."""
    nearest: Array
    """Nearest points of the two triangles (2, 3) [m]."""
    work: Array
    """Memory of `nearest_points` (2, 3)."""


def tree_of(surface: DisplacedSurface) -> Tree:
    """Return the tree of a surface's triangles."""
    points, faces = _welded(surface)
    triangles = points[faces]
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    size = np.linalg.norm(cross, axis=1)
    kept = size > 1e-6 * np.median(size)
    triangles, faces, cross = triangles[kept], faces[kept], cross[kept] / size[kept][:, None]
    order = np.argsort(_morton(triangles.mean(axis=1)), kind="stable")
    triangles, faces, normals = triangles[order], faces[order], cross[order]
    first, neighbours = _neighbours(faces)
    counts = np.diff(first)
    owner = np.repeat(np.arange(len(faces)), counts)
    cosines = np.einsum("ij,ij->i", normals[owner], normals[neighbours])
    own = np.zeros(len(faces))
    np.maximum.at(own, owner, np.arccos(np.clip(cosines, -1.0, 1.0)))
    return Tree(
        np.ascontiguousarray(triangles), np.ascontiguousarray(normals), first, neighbours,
        *_nodes(triangles, normals, own),
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


def _nodes(triangles: Array, normals: Array, own: Array) -> tuple[Array, Array, Array, Array, int]:
    """Return centres, radii, axes, angles and the number of leaves, built from the leaves up."""
    m = len(triangles)
    leaves = 1 << max(math.ceil(math.log2(m)), 0)
    count = 2 * leaves - 1
    middles, radii = np.zeros((count, 3)), np.full(count, -1.0)
    axes, angles = np.zeros((count, 3)), np.zeros(count)
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    sums = np.zeros((count, 3))
    there = slice(leaves - 1, leaves - 1 + m)
    low[there], high[there] = triangles.min(axis=1), triangles.max(axis=1)
    sums[there], axes[there], angles[there] = normals, normals, own
    middles[there] = triangles.mean(axis=1)
    radii[there] = np.linalg.norm(triangles - middles[there][:, None], axis=2).max(axis=1)
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


@inner_kernel
def _turned(rotation, v, out):
    for k in range(3):
        out[k] = rotation[k, 0] * v[0] + rotation[k, 1] * v[1] + rotation[k, 2] * v[2]


@inner_kernel
def _placed(rotation, shift, triangle, out):
    for i in range(3):
        for k in range(3):
            out[i, k] = shift[k]
            for j in range(3):
                out[i, k] += rotation[k, j] * triangle[i, j]


@inner_kernel
def _angle(ax, ay, az, v):
    return math.acos(min(max(ax * v[0] + ay * v[1] + az * v[2], -1.0), 1.0))


@inner_kernel
def _is_least(tree, index, moving, motion, other, distance, scratch):
    """Return whether no neighbour of triangle `index` of a tree is nearer to the triangle `other`.

    `motion` transforms the triangles of the tree if it is the moving one.
    """
    for place in range(tree.first[index], tree.first[index + 1]):
        triangle = tree.triangles[tree.neighbours[place]]
        if moving:
            _placed(motion.rotation, motion.translation, triangle, scratch.triangle)
            away = nearest_points(scratch.triangle, other, scratch.work, scratch.nearest)
        else:
            away = nearest_points(other, triangle, scratch.work, scratch.nearest)
        if away < distance - 1e-12 - 1e-9 * distance:
            return False
    return True


@inner_kernel
def _divided(a, b, i, j, leaf_i, leaf_j, stack, top):
    """Push the halves of a pair of nodes on the stack, if it has room; return its new height."""
    if top + 2 > stack.shape[0]:
        return top
    if leaf_j or (not leaf_i and a.radii[i] > b.radii[j]):
        stack[top, 0], stack[top, 1] = 2 * i + 1, j
        stack[top + 1, 0], stack[top + 1, 1] = 2 * i + 2, j
    else:
        stack[top, 0], stack[top, 1] = i, 2 * j + 1
        stack[top + 1, 0], stack[top + 1, 1] = i, 2 * j + 2
    return top + 2


@kernel
def local_minima(a, b, rotation, shift, cutoff, points_out, distances_out, counts):
    """Find the local minimum distances of two surfaces; return how many there are.

    Parameters
    ----------
    a, b : Tree
    rotation, shift : (3, 3), (3,) arrays
        From the frame of `a` into that of `b`.
    cutoff : float
        Largest distance that counts [m].
    points_out : (n, 3, 3) array
        Filled: points on a and on b, and the unit direction from b to a, in b's frame.
    distances_out : (n,) array
        Filled: distances [m], above 0. Where the surfaces cross there is none; see `crossing`.
    counts : (2,) int64 array
        Increased by the numbers of visited pairs of nodes and of triangles.
    """
    most, found = distances_out.size, 0
    stack = np.empty((4096, 2), np.int64)
    stack[0, 0], stack[0, 1] = 0, 0
    top = 1
    middle, axis = np.empty(3), np.empty(3)
    one, room, pair = np.empty((3, 3)), np.empty((2, 3)), np.empty((2, 3))
    motion = RigidMotion(rotation, shift)
    scratch = NeighbourScratch(np.empty((3, 3)), np.empty((2, 3)), room)
    while top > 0:
        top -= 1
        i, j = stack[top, 0], stack[top, 1]
        if a.radii[i] < 0.0 or b.radii[j] < 0.0:
            continue
        counts[0] += 1
        _turned(rotation, a.middles[i], middle)
        _turned(rotation, a.axes[i], axis)
        dx = b.middles[j, 0] - middle[0] - shift[0]
        dy = b.middles[j, 1] - middle[1] - shift[1]
        dz = b.middles[j, 2] - middle[2] - shift[2]
        away = math.sqrt(dx * dx + dy * dy + dz * dz)
        reach = a.radii[i] + b.radii[j]
        if away - reach > cutoff:
            continue
        if away > reach:
            slack = math.asin(reach / away) + 1e-9
            dx, dy, dz = dx / away, dy / away, dz / away
            if _angle(dx, dy, dz, axis) > a.angles[i] + slack:
                continue
            if _angle(-dx, -dy, -dz, b.axes[j]) > b.angles[j] + slack:
                continue
        if _angle(-axis[0], -axis[1], -axis[2], b.axes[j]) > a.angles[i] + b.angles[j] + 1e-9:
            continue
        leaf_i, leaf_j = i >= a.leaves - 1, j >= b.leaves - 1
        if not (leaf_i and leaf_j):
            top = _divided(a, b, i, j, leaf_i, leaf_j, stack, top)
            continue
        counts[1] += 1
        s, t = i - a.leaves + 1, j - b.leaves + 1
        _placed(rotation, shift, a.triangles[s], one)
        distance = nearest_points(one, b.triangles[t], room, pair)
        if distance > cutoff or distance < 1e-12 or found == most:
            continue
        # The line is known now: it must lie within both cones itself.
        for k in range(3):
            room[0, k] = (pair[1, k] - pair[0, k]) / distance
        if _angle(room[0, 0], room[0, 1], room[0, 2], axis) > a.angles[i] + 1e-6:
            continue
        if _angle(-room[0, 0], -room[0, 1], -room[0, 2], b.axes[j]) > b.angles[j] + 1e-6:
            continue
        if not _is_least(a, s, True, motion, b.triangles[t], distance, scratch):
            continue
        if not _is_least(b, t, False, motion, one, distance, scratch):
            continue
        _turned(rotation, a.normals[s], axis)
        for k in range(3):
            points_out[found, 0, k], points_out[found, 1, k] = pair[0, k], pair[1, k]
            points_out[found, 2, k] = (pair[0, k] - pair[1, k]) / distance
        # Of the two sides of a sheet, only the one facing the other surface counts.
        along = 0.0
        for k in range(3):
            along += points_out[found, 2, k] * (b.normals[t, k] - axis[k])
        if along <= 0.0:
            continue
        distances_out[found] = distance
        found += 1
    return found


@inner_kernel
def _apart(one, other, normal):
    """Return whether a triangle is on one side of the plane of another, whose normal is given."""
    low, high = math.inf, -math.inf
    for i in range(3):
        side = 0.0
        for k in range(3):
            side += normal[k] * (one[i, k] - other[0, k])
        low, high = min(low, side), max(high, side)
    return low > 1e-12 or high < -1e-12


@kernel
def crossing(a, b, rotation, shift, out):
    """Count the pairs of triangles of two surfaces that cross, up to 256.

    Parameters
    ----------
    a, b, rotation, shift
        As for `local_minima`.
    out : (2, 3) array
        Filled: the mean centre of those of `b`, and the sum of b's normals minus a's, b's frame.
    """
    stack = np.empty((4096, 2), np.int64)
    stack[0, 0], stack[0, 1] = 0, 0
    top, found = 1, 0
    middle, axis = np.empty(3), np.empty(3)
    one, room, pair = np.empty((3, 3)), np.empty((2, 3)), np.empty((2, 3))
    out[:] = 0.0
    while top > 0 and found < 256:
        top -= 1
        i, j = stack[top, 0], stack[top, 1]
        if a.radii[i] < 0.0 or b.radii[j] < 0.0:
            continue
        _turned(rotation, a.middles[i], middle)
        away, reach = 0.0, a.radii[i] + b.radii[j]
        for k in range(3):
            away += (b.middles[j, k] - middle[k] - shift[k]) ** 2
        if away > reach * reach:
            continue
        leaf_i, leaf_j = i >= a.leaves - 1, j >= b.leaves - 1
        if not (leaf_i and leaf_j):
            top = _divided(a, b, i, j, leaf_i, leaf_j, stack, top)
            continue
        s, t = i - a.leaves + 1, j - b.leaves + 1
        _placed(rotation, shift, a.triangles[s], one)
        _turned(rotation, a.normals[s], axis)
        # Most triangles are on one side of each other's plane.
        if _apart(one, b.triangles[t], b.normals[t]) or _apart(b.triangles[t], one, axis):
            continue
        if nearest_points(one, b.triangles[t], room, pair) > 1e-12:
            continue
        for k in range(3):
            out[0, k] += (b.triangles[t, 0, k] + b.triangles[t, 1, k] + b.triangles[t, 2, k]) / 3.0
            out[1, k] += b.normals[t, k] - axis[k]
        found += 1
    if found > 0:
        for k in range(3):
            out[0, k] /= found
    return found
