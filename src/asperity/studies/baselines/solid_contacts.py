"""Kernels for the contact of two convex solids: its depth, direction and place."""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import kernel
from asperity.studies.baselines.minkowski_walk import (
    is_surface_normal,
    least_of_all,
    support,
    walk,
)
from asperity.studies.baselines.overlap_places import (
    MOST_CORNERS,
    add_measures,
    dot,
    keep_near,
    middle_of,
    touching_part,
)
from asperity.studies.baselines.triangle_pairs import nearest_points

LEVEL = 0.2
"""Sine of the angle from which on a face or an edge is not level: its region is a vertex's [-]."""


@kernel
def _level_features(solid, n, sign, band, first, corners):
    """List the faces, or edges, or the vertex, that may touch along `sign` n; return their number.

    `first` (k + 1,) and `corners` are filled: the limits and the vertices of each.
    """
    top_vertex = support(solid, n, sign)
    low = sign * dot(n, solid.vertices[top_vertex]) - band
    count, filled = 0, 0
    first[0] = 0
    cosine = math.sqrt(1.0 - LEVEL * LEVEL)
    for f in range(solid.normals.shape[0]):
        if not solid.real[f] or sign * dot(n, solid.normals[f]) < cosine:
            continue
        near = False
        for k in range(solid.face_first[f], solid.face_first[f + 1]):
            v = solid.face_corners[k]
            corners[filled] = v
            filled += 1
            near = near or sign * dot(n, solid.vertices[v]) >= low
        if near:
            count += 1
            first[count] = filled
        filled = first[count]
    if count > 0:
        return count
    for m in range(solid.near_first[top_vertex], solid.near_first[top_vertex + 1]):
        other = solid.near[m]
        e = solid.vertices[other] - solid.vertices[top_vertex]
        if abs(dot(e, n)) < LEVEL * math.sqrt(dot(e, e)):
            corners[2 * count], corners[2 * count + 1] = top_vertex, other
            count += 1
            first[count] = 2 * count
    if count == 0:
        corners[0], first[1], count = top_vertex, 1, 1
    return count


@kernel
def _corners_of(solid, first, corners, index):
    count = first[index + 1] - first[index]
    out = np.empty((count, 3))
    for k in range(count):
        out[k] = solid.vertices[corners[first[index] + k]]
    return out


@kernel
def contact_place(a, b, found, limits, place):
    """Write the place of a contact to `place` (3,); return its area [m^2], below 0 if it has none.

    Parameters
    ----------
    a, b : ConvexSolid
        Placed in one frame.
    found : (4,) array
        Depth [m], and the unit direction in which to move a.
    limits : (2,) array
        Share s [-]: a place counts where it is at least 1 - s as deep as the deepest. Width of a
        contact on an edge [m].
    place : (3,) array
        Filled: the middle of the region, halfway between both surfaces.
    """
    n, depth = found[1:], found[0]
    band = limits[0] * depth
    most_a, most_b = a.face_corners.size + 2 * a.edges.shape[0] + 2, b.face_corners.size + 2
    most_b += 2 * b.edges.shape[0]
    first_a, corners_a = np.empty(most_a + 1, np.int64), np.empty(most_a, np.int64)
    first_b, corners_b = np.empty(most_b + 1, np.int64), np.empty(most_b, np.int64)
    count_a = _level_features(a, n, -1.0, band, first_a, corners_a)
    count_b = _level_features(b, n, 1.0, band, first_b, corners_b)
    room = most_a + most_b + MOST_CORNERS
    out, gaps, sums = np.empty((2, room, 3)), np.empty(room), np.zeros((3, 4))
    low = a.radius + b.radius - depth
    for i in range(count_a):
        one = _corners_of(a, first_a, corners_a, i)
        for j in range(count_b):
            other = _corners_of(b, first_b, corners_b, j)
            count = touching_part(one, other, n, out, gaps)
            count = keep_near(out, gaps, count, low + band)
            if count > 0:
                add_measures(out[0], gaps, count, low, band, sums)
    if sums[2, 0] <= 0.0:
        return -1.0
    area = middle_of(sums, limits[1], place)
    level = dot(n, b.vertices[support(b, n, 1.0)]) + b.radius - 0.5 * depth - dot(n, place)
    for k in range(3):
        place[k] += level * n[k]
    return area


@kernel
def _triangle(solid, face, corner, out):
    """Write a triangle of a face, or of a point or a segment, to `out` (3, 3)."""
    count = solid.vertices.shape[0]
    for k in range(3):
        out[k] = solid.vertices[min(k, count - 1)]
    if face >= 0:
        begin = solid.face_first[face]
        out[0] = solid.vertices[solid.face_corners[begin]]
        out[1] = solid.vertices[solid.face_corners[begin + corner]]
        out[2] = solid.vertices[solid.face_corners[begin + corner + 1]]


@kernel
def _core_distance(a, b, found):
    """Write the distance of the cores of two solids and its direction to `found`; 0 if they meet.

    For solids of which one at least is a point or a segment.
    """
    one, other = np.empty((3, 3)), np.empty((3, 3))
    scratch, pair, nearest = np.empty((2, 3)), np.empty((2, 3)), np.empty((2, 3))
    found[0] = math.inf
    for f in range(min(a.normals.shape[0] - 1, 0), a.normals.shape[0]):
        last_a = 2 if f < 0 else a.face_first[f + 1] - a.face_first[f] - 1
        for c in range(1, last_a):
            _triangle(a, f, c, one)
            for g in range(min(b.normals.shape[0] - 1, 0), b.normals.shape[0]):
                last_b = 2 if g < 0 else b.face_first[g + 1] - b.face_first[g] - 1
                for d in range(1, last_b):
                    _triangle(b, g, d, other)
                    size = nearest_points(one, other, scratch, pair)
                    if size < found[0]:
                        found[0] = size
                        nearest[:] = pair
    for solid, core in ((b, a), (a, b)):
        if solid.normals.shape[0] == 0:
            continue
        for i in range(core.vertices.shape[0]):
            outside = -math.inf
            for f in range(solid.normals.shape[0]):
                corner = solid.vertices[solid.face_corners[solid.face_first[f]]]
                outside = max(outside, dot(solid.normals[f], core.vertices[i] - corner))
            if outside <= 0.0:
                found[0] = 0.0
    if found[0] > 0.0:
        for k in range(3):
            found[k + 1] = (nearest[0, k] - nearest[1, k]) / found[0]


@kernel
def solid_contact(a, b, hub, limits, found, place):
    """Find the contact of two convex solids; return its area [m^2], below 0 if there is none.

    Parameters
    ----------
    a, b : ConvexSolid
        Placed in one frame; b may not be moved.
    hub : (2,) int64 array
        Vertices at which the last tick's walk ended, -1 without one; replaced by those of this.
    limits : (2,) array
        See `contact_place`.
    found : (4,) array
        Filled: depth [m], and the unit direction in which to move a.
    place : (3,) array
        Filled; see `contact_place`.
    """
    found[0] = 0.0
    if a.radius > 0.0 or b.radius > 0.0:
        _core_distance(a, b, found)
    if found[0] > 1e-12:
        n = found[1:]
        found[0] = a.radius + b.radius - found[0]
        surface = is_surface_normal(a, support(a, n, -1.0), n, -1.0)
        if not surface or not is_surface_normal(b, support(b, n, 1.0), n, 1.0):
            return -1.0
    elif a.normals.shape[0] > 0 or b.normals.shape[0] > 0:
        if hub[0] >= 0:
            walk(a, b, hub, found)
        if hub[0] < 0 or found[0] == math.inf:
            least_of_all(a, b, hub, found)
        if found[0] == math.inf:
            hub[0] = -1
            return -1.0
        found[0] += a.radius + b.radius
    else:
        return -1.0
    if found[0] <= 0.0:
        return -1.0
    return contact_place(a, b, found, limits, place)
