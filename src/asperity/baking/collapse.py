"""Simplification of a triangle mesh by collapsing its edges, the cheapest first.

Each vertex carries the sum of squared distances from the planes of the triangles that it stands for
(`quadrics`; Garland & Heckbert, SIGGRAPH 97); an edge is collapsed to the point where the sum of
its two ends is least. The collapse of an edge is deferred if it would

- change the topology: the only common neighbours of its ends may be the corners opposite to it (the
  link condition: Dey et al., Publ. Inst. Math. 66, 23 (1999)). So a closed mesh stays closed, holes
  stay holes, and no edge gets a third triangle;
- fold the surface: no triangle may turn by 78 degrees or more, nor deviate so far from the mean
  normal around the new vertex, along which a texture will be displaced;
- create a needle: a triangle much thinner than the thinnest one it replaces.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array, Indices, Mask
from asperity._core.kernels import kernel
from asperity.baking.edge_heap import pop, push
from asperity.baking.quadrics import cost_at, fill_cheapest, triangle_cross, vertex_quadrics
from asperity.geometry.mesh.topology import edges_of

_MOST = 256
"""Triangles around a vertex, at most."""


class _Corners(NamedTuple):
    """Triangles of each vertex, as linked lists of half-edges `3 * triangle + corner`."""

    head: Indices
    """First half-edge of each vertex, -1: none, (n,)."""
    tail: Indices
    """Last half-edge of each vertex, (n,)."""
    following: Indices
    """Next half-edge in the list, -1 at its end, (3 m,)."""


class _Surface(NamedTuple):
    """The mesh while it is simplified."""

    points: Array
    """(n, 3)."""
    faces: Indices
    """(m, 3)."""
    alive: Mask
    """Which triangles remain, (m,)."""
    border: Mask
    """Which vertices are on a border, (n,)."""
    corners: _Corners


class _Rings(NamedTuple):
    """Triangles around both ends of an edge."""

    faces: Indices
    """(2, _MOST)."""
    counts: Indices
    """(2,)."""


class _Limits(NamedTuple):
    """Conditions on triangles after a collapse; see `collapsed`."""

    facing: float
    quality: float


def collapsed(
    points: Array, faces: Indices, count: int, *, facing: float, quality: float,
    shortest: bool = False,
) -> tuple[Array, Indices]:  # fmt: skip
    """Collapse edges until `count` triangles remain or no edge can be collapsed.

    Parameters
    ----------
    points : (n, 3) array
        Of about unit size, no two equal.
    faces : (m, 3) array
        Consistently oriented.
    count : int
    facing : float
        Least cosine between a triangle's normal and its former one, or the mean at its corner.
    quality : float
        Least quality of a triangle: 1 for an equilateral one, 0 for a needle.
    shortest : bool
        Collapse the shortest edge first instead of the cheapest: triangles of about one size.

    Returns
    -------
    points, faces
        Of the simplified mesh.
    """
    points, faces = points.copy(), faces.copy()
    alive = np.ones(len(faces), dtype=np.bool_)
    borders = np.flatnonzero(edges_of(faces).borders)
    _collapse(points, faces, borders, alive, count, _Limits(facing, quality), shortest)
    used, corners = np.unique(faces[alive], return_inverse=True)
    return points[used], corners.reshape(-1, 3).astype(np.int64)


@kernel
def _ring(surface, vertex, out):
    """Fill the triangles around a vertex; return their number, or -1 if there are too many."""
    n = 0
    corner = surface.corners.head[vertex]
    while corner >= 0:
        f = corner // 3
        if surface.alive[f]:
            if n == _MOST:
                return -1
            out[n] = f
            n += 1
        corner = surface.corners.following[corner]
    return n


@kernel
def _keeps_topology(surface, edge, rings, marks, mark):
    """Return whether the collapse of an edge satisfies the link condition.

    `marks` (n,) is working memory; values below `mark - 1` are treated as empty.
    """
    u, v = edge
    faces, border, counts = surface.faces, surface.border, rings.counts
    shared = 0
    for k in range(counts[0]):
        f = rings.faces[0, k]
        for c in range(3):
            marks[faces[f, c]] = mark
            if faces[f, c] == v:
                shared += 1
    common = 0
    for k in range(counts[1]):
        f = rings.faces[1, k]
        for c in range(3):
            w = faces[f, c]
            if w not in (u, v) and marks[w] == mark:
                common += 1
                marks[w] = mark - 1
    if common != shared or shared > 2 or shared == 0:
        return False
    if border[u] and border[v] and shared == 2:
        return False
    # Below three other triangles a tetrahedron would become two coincident sheets.
    return not (counts[0] + counts[1] - 2 * shared < 3 and shared == 2)


@kernel
def _moved(surface, edge, side, f, place):
    """Return whether triangle f remains when its end moves, which corner that is, and all three."""
    points, end, other = surface.points, edge[side], edge[1 - side]
    a, b, c = surface.faces[f, 0], surface.faces[f, 1], surface.faces[f, 2]
    corner = 0 if a == end else 1 if b == end else 2
    pa = place if a == end else points[a]
    pb = place if b == end else points[b]
    pc = place if c == end else points[c]
    return other not in (a, b, c), corner, pa, pb, pc


@kernel
def _keeps_shape(surface, edge, place, rings, limits):
    """Return whether no triangle folds or becomes a needle when an edge collapses to `place`."""
    points, faces = surface.points, surface.faces
    nx, ny, nz = 0.0, 0.0, 0.0
    for side in range(2):
        for k in range(rings.counts[side]):
            f = rings.faces[side, k]
            remains, corner, pa, pb, pc = _moved(surface, edge, side, f, place)
            if not remains:
                continue
            a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
            x, y, z = triangle_cross(pa, pb, pc)
            ox, oy, oz = triangle_cross(points[a], points[b], points[c])
            new, old = np.sqrt(x * x + y * y + z * z), np.sqrt(ox * ox + oy * oy + oz * oz)
            if new == 0.0:
                return False
            if old > 0.0 and x * ox + y * oy + z * oz < limits.facing * new * old:
                return False
            if _quality(pa, pb, pc, new) < limits.quality:
                before = _quality(points[a], points[b], points[c], old)
                if _quality(pa, pb, pc, new) < before:
                    return False
            # The mean normal, which carries the texture, is weighted by the angles at the vertex.
            if corner == 0:
                angle = _angle(pa, pb, pc)
            elif corner == 1:
                angle = _angle(pb, pc, pa)
            else:
                angle = _angle(pc, pa, pb)
            nx, ny, nz = nx + angle * x / new, ny + angle * y / new, nz + angle * z / new
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    if length == 0.0:
        return False
    for side in range(2):
        for k in range(rings.counts[side]):
            remains, _, pa, pb, pc = _moved(surface, edge, side, rings.faces[side, k], place)
            if not remains:
                continue
            x, y, z = triangle_cross(pa, pb, pc)
            new = np.sqrt(x * x + y * y + z * z)
            if x * nx + y * ny + z * nz < limits.facing * new * length:
                return False
    return True


@kernel
def _angle(a, b, c):
    """Return the angle at the corner a of a triangle [rad]."""
    x, y, z = triangle_cross(a, b, c)
    along = 0.0
    for k in range(3):
        along += (b[k] - a[k]) * (c[k] - a[k])
    return np.arctan2(np.sqrt(x * x + y * y + z * z), along)


@kernel
def _quality(a, b, c, twice_area):
    """Return 4 sqrt(3) times a triangle's area over the sum of its squared sides."""
    total = 0.0
    for k in range(3):
        total += (a[k] - b[k]) ** 2 + (b[k] - c[k]) ** 2 + (c[k] - a[k]) ** 2
    return 2.0 * np.sqrt(3.0) * twice_area / max(total, 1e-300)


@kernel
def _corners_of(faces, count):
    """Return the `_Corners` of `count` vertices."""
    head, tail = np.full(count, -1, dtype=np.int64), np.full(count, -1, dtype=np.int64)
    following = np.full(3 * len(faces), -1, dtype=np.int64)
    for h in range(3 * len(faces)):
        v = faces[h // 3, h % 3]
        if head[v] < 0:
            head[v] = h
        else:
            following[tail[v]] = h
        tail[v] = h
    return _Corners(head, tail, following)


@kernel
def _merge(surface, edge, rings):
    """Replace the second end of an edge by its first; return how many triangles vanish."""
    u, v = edge
    faces, corners, vanished = surface.faces, surface.corners, 0
    surface.border[u] = surface.border[u] or surface.border[v]
    for k in range(rings.counts[1]):
        f = rings.faces[1, k]
        if u in (faces[f, 0], faces[f, 1], faces[f, 2]):
            surface.alive[f] = False
            vanished += 1
        for c in range(3):
            if faces[f, c] == v:
                faces[f, c] = u
    corners.following[corners.tail[u]] = corners.head[v]
    corners.tail[u] = corners.tail[v]
    corners.head[v] = -1
    return vanished


@kernel
def _cost(both, place, a, b, shortest):
    """Return the priority of an edge from a to b that collapses to `place`; lower is earlier."""
    if not shortest:
        return cost_at(both, place)
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2


@kernel
def _collapse(points, faces, borders, alive, target, limits, shortest):
    """Collapse edges until `target` triangles are alive; `borders` are half-edges."""
    n, m = len(points), len(faces)
    corners = _corners_of(faces, n)
    border = np.zeros(n, dtype=np.bool_)
    for h in borders:
        border[faces[h // 3, h % 3]] = border[faces[h // 3, (h + 1) % 3]] = True
    surface = _Surface(points, faces, alive, border, corners)
    quadric = vertex_quadrics(points, faces, borders)
    stamp = np.zeros(n, dtype=np.int64)
    marks = np.zeros(n, dtype=np.int64)
    mark = 2
    keys, heap, size = np.empty(6 * m + 64), np.empty((6 * m + 64, 3), dtype=np.int64), 0
    both, place, edge = np.empty(10), np.empty(3), np.empty(3, dtype=np.int64)
    for h in range(3 * m):
        u, v = faces[h // 3, h % 3], faces[h // 3, (h + 1) % 3]
        if u < v or (border[u] and border[v]):
            both[:] = quadric[u] + quadric[v]
            fill_cheapest(both, points[u], points[v], border[u], border[v], place)
            cost = _cost(both, place, points[u], points[v], shortest)
            size = push(heap, keys, size, cost, u, v, 0)
    rings = _Rings(np.empty((2, _MOST), dtype=np.int64), np.empty(2, dtype=np.int64))
    left = m
    while size > 0 and left > target:
        size = pop(heap, keys, size, edge)
        u, v = edge[0], edge[1]
        if corners.head[u] < 0 or corners.head[v] < 0 or stamp[u] + stamp[v] != edge[2]:
            continue
        rings.counts[0] = _ring(surface, u, rings.faces[0])
        rings.counts[1] = _ring(surface, v, rings.faces[1])
        if rings.counts[0] < 0 or rings.counts[1] < 0:
            continue
        both[:] = quadric[u] + quadric[v]
        fill_cheapest(both, points[u], points[v], border[u], border[v], place)
        mark += 2
        if not _keeps_topology(surface, (u, v), rings, marks, mark):
            continue
        if not _keeps_shape(surface, (u, v), place, rings, limits):
            continue
        points[u] = place
        quadric[u] = both
        left -= _merge(surface, (u, v), rings)
        # Edges whose collapse was deferred may be possible now: all around the vertex are queued.
        count = _ring(surface, u, rings.faces[0])
        stamp[u] += 1_000_003
        mark += 2
        for k in range(max(count, 0)):
            f = rings.faces[0, k]
            for c in range(3):
                w = faces[f, c]
                if w == u or marks[w] == mark:
                    continue
                marks[w] = mark
                if size == len(keys):
                    keys = np.concatenate((keys, np.empty(size)))
                    heap = np.concatenate((heap, np.empty((size, 3), dtype=np.int64)))
                both[:] = quadric[u] + quadric[w]
                fill_cheapest(both, points[u], points[w], border[u], border[w], place)
                cost = _cost(both, place, points[u], points[w], shortest)
                size = push(heap, keys, size, cost, u, w, stamp[u] + stamp[w])
    return left
