r"""Penetration depth of two convex solids, by a walk over their Minkowski difference.

A translation of A by h(n) along the unit vector n separates it from B, with

    h(n) = max_{b in B} n . b - min_{a in A} n . a ,

and the penetration depth is the least h. Its local minima are facets of the Minkowski difference
B - A: a face of one solid and a vertex of the other, or an edge of each. A vertex of the difference
is a pair of vertices, a *hub*. The walk (Kim, Lin & Manocha, DEEP) starts at the hub of the last
tick, computes h of all facets at the hub, and goes on to the hubs at the corners of the least
facet, until none has a facet with a smaller h. Without a last tick all facets are tried.

A facet counts only if its normal is one of the *body's* surface on both sides: a positive
combination of normals of real faces at the vertex (`convex_solids`).
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import kernel
from asperity.studies.baselines.overlap_places import cross, dot

_SINE = 1e-7
"""Sine of an angle that counts as none."""
_HUBS = 256
"""Largest number of hubs of one walk."""


@kernel
def _supports(solid, vertex, n, sign):
    """Return whether no edge at a vertex leads farther along `sign` n."""
    at = solid.vertices[vertex]
    for k in range(solid.near_first[vertex], solid.near_first[vertex + 1]):
        other = solid.vertices[solid.near[k]]
        along = length = 0.0
        for i in range(3):
            along += sign * n[i] * (other[i] - at[i])
            length += (other[i] - at[i]) ** 2
        if along > _SINE * math.sqrt(length):
            return False
    return True


@kernel
def is_surface_normal(solid, vertex, n, sign):
    """Return whether `sign` n is a normal of the body's surface at a vertex of a piece.

    It is if it is a combination of the normals of real faces there with positive coefficients; at
    most three are needed (Caratheodory).
    """
    first, last = solid.around_first[vertex], solid.around_first[vertex + 1]
    count, virtual = 0, False
    faces = np.empty(last - first, np.int64)
    for k in range(first, last):
        if solid.real[solid.around[k]]:
            faces[count] = solid.around[k]
            count += 1
        else:
            virtual = True
    if not virtual:
        return True
    u, v, w = np.empty(3), np.empty(3), np.empty(3)
    for i in range(count):
        a = solid.normals[faces[i]]
        if sign * dot(a, n) > 0.0:
            cross(a, n, u)
            if dot(u, u) < _SINE * _SINE:
                return True
    for i in range(count):
        a = solid.normals[faces[i]]
        for j in range(i):
            b = solid.normals[faces[j]]
            cross(a, b, u)
            size = dot(u, u)
            if size < 1e-12:
                continue
            off = sign * dot(u, n)
            if off * off < _SINE * _SINE * size:
                # Within the plane of both: n = s a + t b.
                cross(n, b, v)
                cross(a, n, w)
                if sign * dot(v, u) >= -_SINE * size and sign * dot(w, u) >= -_SINE * size:
                    return True
            for k in range(j):
                c = solid.normals[faces[k]]
                volume = dot(u, c)
                if abs(volume) < 1e-9:
                    continue
                cross(b, c, v)
                cross(c, a, w)
                if (
                    sign * dot(v, n) / volume >= -_SINE
                    and sign * dot(w, n) / volume >= -_SINE
                    and off / volume >= -_SINE
                ):
                    return True
    return False


@kernel
def _judge(a, b, i, j, n, best):
    """Take a direction as the best at a hub if it is a facet there, of real surfaces, and less.

    `best` (4,) is h and n.
    """
    h = 0.0
    for k in range(3):
        h += n[k] * (b.vertices[j, k] - a.vertices[i, k])
    if h >= best[0] or not _supports(a, i, n, -1.0) or not _supports(b, j, n, 1.0):
        return
    if is_surface_normal(a, i, n, -1.0) and is_surface_normal(b, j, n, 1.0):
        best[0] = h
        best[1:] = n


@kernel
def _least_at_hub(a, b, i, j, best):
    """Improve `best` by the facets of the Minkowski difference at a pair of vertices."""
    n, e, g = np.empty(3), np.empty(3), np.empty(3)
    for k in range(b.around_first[j], b.around_first[j + 1]):
        if b.real[b.around[k]]:
            n[:] = b.normals[b.around[k]]
            _judge(a, b, i, j, n, best)
    for k in range(a.around_first[i], a.around_first[i + 1]):
        if a.real[a.around[k]]:
            for c in range(3):
                n[c] = -a.normals[a.around[k], c]
            _judge(a, b, i, j, n, best)
    for k in range(a.near_first[i], a.near_first[i + 1]):
        e[:] = a.vertices[a.near[k]] - a.vertices[i]
        for m in range(b.near_first[j], b.near_first[j + 1]):
            g[:] = b.vertices[b.near[m]] - b.vertices[j]
            cross(e, g, n)
            size = math.sqrt(dot(n, n))
            if size < 1e-7 * math.sqrt(dot(e, e) * dot(g, g)):
                continue
            for c in range(3):
                n[c] /= size
            _judge(a, b, i, j, n, best)
            for c in range(3):
                n[c] = -n[c]
            _judge(a, b, i, j, n, best)


@kernel
def support(solid, n, sign):
    """Return the vertex of a solid that is farthest along `sign` n."""
    best, vertex = -math.inf, 0
    for i in range(solid.vertices.shape[0]):
        along = sign * dot(n, solid.vertices[i])
        if along > best:
            best, vertex = along, i
    return vertex


@kernel
def least_of_all(a, b, hub, best):
    """Compute the penetration depth from all facets of the Minkowski difference.

    Parameters
    ----------
    a, b : ConvexSolid
        Placed in one frame.
    hub : (2,) int64 array
        Filled: vertices of a and b at the facet.
    best : (4,) array
        Filled: h [m], and the unit direction in which to move a. h is infinite if there is none.
    """
    best[0] = math.inf
    n, before = np.empty(3), math.inf
    for side in range(2):
        solid, other = (b, a) if side == 0 else (a, b)
        sign = 1.0 if side == 0 else -1.0
        for f in range(solid.normals.shape[0]):
            if not solid.real[f]:
                continue
            for c in range(3):
                n[c] = sign * solid.normals[f, c]
            own, far = solid.face_corners[solid.face_first[f]], support(other, n, -sign)
            top = dot(n, other.vertices[far])
            # Of vertices equally far, any may have the real surface.
            for v in range(other.vertices.shape[0]):
                if v == far or abs(dot(n, other.vertices[v]) - top) < 1e-12:
                    i, j = (v, own) if side == 0 else (own, v)
                    _judge(a, b, i, j, n, best)
                    if best[0] < before:
                        hub[0], hub[1], before = i, j, best[0]
    e, g = np.empty(3), np.empty(3)
    for k in range(a.edges.shape[0]):
        i = a.edges[k, 0]
        e[:] = a.vertices[a.edges[k, 1]] - a.vertices[i]
        for m in range(b.edges.shape[0]):
            j = b.edges[m, 0]
            g[:] = b.vertices[b.edges[m, 1]] - b.vertices[j]
            cross(e, g, n)
            size = math.sqrt(dot(n, n))
            if size < 1e-7 * math.sqrt(dot(e, e) * dot(g, g)):
                continue
            for side in range(2):
                sign = (1.0 - 2.0 * side) / (size if side == 0 else 1.0)
                for c in range(3):
                    n[c] *= sign
                _judge(a, b, i, j, n, best)
                if best[0] < before:
                    hub[0], hub[1], before = i, j, best[0]


@kernel
def walk(a, b, hub, best):
    """Compute the penetration depth by a walk from a hub; arguments as for `least_of_all`.

    `hub` is read as well: the start. Return the number of hubs visited. The depth is a local
    minimum; it is infinite if no facet at the start, or at hubs equally far, is a real one.
    """
    queue = np.empty((_HUBS, 2), np.int64)
    queue[0] = hub
    filled, done = 1, 0
    best[0] = math.inf
    lean = np.empty(4)
    while done < filled:
        i, j = queue[done, 0], queue[done, 1]
        done += 1
        lean[:] = best
        _least_at_hub(a, b, i, j, lean)
        if lean[0] < best[0] - 1e-13 or best[0] == math.inf:
            best[:] = lean
            hub[0], hub[1] = i, j
            if best[0] == math.inf:
                continue
        # On to the other corners of the least facet, those equally far along its normal.
        n = best[1:]
        for side in range(2):
            solid, at = (a, i) if side == 0 else (b, j)
            for k in range(solid.near_first[at], solid.near_first[at + 1]):
                other = solid.near[k]
                e = solid.vertices[other] - solid.vertices[at]
                if abs(dot(e, n)) > _SINE * math.sqrt(dot(e, e)):
                    continue
                x, y = (other, j) if side == 0 else (i, other)
                known = filled == _HUBS
                for m in range(filled):
                    if queue[m, 0] == x and queue[m, 1] == y:
                        known = True
                if not known:
                    queue[filled, 0], queue[filled, 1] = x, y
                    filled += 1
    return done
