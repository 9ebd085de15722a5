"""Edges of a triangle mesh collapsed one after another, the cheapest first.

Each vertex carries the sum of squared distances to the planes of the triangles that went into it
(Garland & Heckbert, SIGGRAPH 97); an edge is collapsed to where that of its two ends is least. An
edge is left as it is for the time being if its collapse would

- change how the surface hangs together: the ends may have no neighbours in common but those of
  the triangles at the edge (the link condition: Dey et al., Publ. Inst. Math. 66, 23 (1999)). So
  what is closed stays closed, holes stay holes, and no edge gets a third triangle;
- fold the surface: no triangle may turn by 78 degrees or more, nor lie so to the mean normal of
  those round the new vertex, along which a texture will be displaced;
- make a needle: a triangle much thinner than the thinnest before.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import kernel

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
_MOST = 256
"""Triangles round an edge, at most."""
_TOWARDS_MIDDLE = 1e-3
"""Weight of the edge's middle, where planes leave the place open."""
_BORDER = 10.0
"""Weight of borders, which would shrink."""


def collapsed(
    points: Array, faces: Indices, count: int, *, facing: float, quality: float
) -> tuple[Array, Indices]:
    """Return the mesh with edges collapsed until `count` triangles are left, or none can be.

    Parameters
    ----------
    points : (n, 3) array
        Of about unit size; each place once.
    faces : (m, 3) array
        Wound alike.
    count : int
    facing : float
        Least cosine between a triangle's normal and what it was, or the mean round its corner.
    quality : float
        Least quality of a triangle, 1 for an equilateral one, 0 for a needle.
    """
    points, faces = points.copy(), faces.copy()
    alive = np.ones(len(faces), dtype=np.bool_)
    _collapse(points, faces, alive, count, facing, quality)
    used, corners = np.unique(faces[alive], return_inverse=True)
    return points[used], corners.reshape(-1, 3).astype(np.int64)


@kernel
def _cross(a, b, c):
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


@kernel
def _add_plane(q, x, y, z, d, weight):
    """Add to a quadric the squared distance to the plane x, y, z, d, times a weight."""
    q[0] += weight * x * x
    q[1] += weight * x * y
    q[2] += weight * x * z
    q[3] += weight * y * y
    q[4] += weight * y * z
    q[5] += weight * z * z
    q[6] += weight * x * d
    q[7] += weight * y * d
    q[8] += weight * z * d
    q[9] += weight * d * d


@kernel
def _cost(q, p):
    """Return the value of a quadric at a place."""
    x, y, z = p[0], p[1], p[2]
    return (
        q[0] * x * x + 2.0 * q[1] * x * y + 2.0 * q[2] * x * z + q[3] * y * y
        + 2.0 * q[4] * y * z + q[5] * z * z
        + 2.0 * (q[6] * x + q[7] * y + q[8] * z) + q[9]
    )  # fmt: skip


@kernel
def _place(q, a, b, a_at_border, b_at_border, out):
    """Fill in the place where a quadric and a little of the distance from the middle are least.

    An end that is at a border stays where it is if the other is not.
    """
    if a_at_border != b_at_border:
        for k in range(3):
            out[k] = a[k] if a_at_border else b[k]
        return
    mx, my, mz = 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])
    e = _TOWARDS_MIDDLE * (q[0] + q[3] + q[5]) + 1e-30
    xx, yy, zz, xy, xz, yz = q[0] + e, q[3] + e, q[5] + e, q[1], q[2], q[4]
    # From the middle: the right side is the slope there.
    rx = -(q[0] * mx + xy * my + xz * mz + q[6])
    ry = -(xy * mx + q[3] * my + yz * mz + q[7])
    rz = -(xz * mx + yz * my + q[5] * mz + q[8])
    cx, cy, cz = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    det = xx * cx + xy * cy + xz * cz
    dx = (cx * rx + cy * ry + cz * rz) / det
    dy = (cy * rx + (xx * zz - xz * xz) * ry + (xy * xz - xx * yz) * rz) / det
    dz = (cz * rx + (xy * xz - xx * yz) * ry + (xx * yy - xy * xy) * rz) / det
    # No farther than the edge is long.
    far = np.sqrt(dx * dx + dy * dy + dz * dz)
    length = np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)
    scale = 1.0 if far <= length else length / far
    out[0], out[1], out[2] = mx + scale * dx, my + scale * dy, mz + scale * dz


@kernel
def _push(heap, keys, size, cost, u, v, stamp):
    """Put an edge on the heap; there has to be room."""
    i = size
    while i > 0:
        parent = (i - 1) // 2
        if keys[parent] <= cost:
            break
        keys[i] = keys[parent]
        heap[i] = heap[parent]
        i = parent
    keys[i] = cost
    heap[i, 0], heap[i, 1], heap[i, 2] = u, v, stamp
    return size + 1


@kernel
def _pop(heap, keys, size, out):
    """Take the cheapest edge from the heap into `out`."""
    out[0], out[1], out[2] = heap[0, 0], heap[0, 1], heap[0, 2]
    size -= 1
    key, u, v, stamp = keys[size], heap[size, 0], heap[size, 1], heap[size, 2]
    i = 0
    while True:
        child = 2 * i + 1
        if child >= size:
            break
        if child + 1 < size and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= key:
            break
        keys[i] = keys[child]
        heap[i] = heap[child]
        i = child
    keys[i] = key
    heap[i, 0], heap[i, 1], heap[i, 2] = u, v, stamp
    return size


@kernel
def _round(vertex, faces, alive, head, following, out):
    """Fill in the triangles round a vertex; return how many, or -1 if there are too many."""
    n = 0
    corner = head[vertex]
    while corner >= 0:
        f = corner // 3
        if alive[f]:
            if n == _MOST:
                return -1
            out[n] = f
            n += 1
        corner = following[corner]
    return n


@kernel
def _may(u, v, place, points, faces, rings, counts, border, marks, mark, facing, quality):
    """Return whether an edge may be collapsed to a place.

    `rings` (2, ...) are the triangles round its ends; `marks` and `mark` serve to count neighbours.
    """
    shared = 0
    for k in range(counts[0]):
        f = rings[0, k]
        for c in range(3):
            marks[faces[f, c]] = mark
            if faces[f, c] == v:
                shared += 1
    common = 0
    for k in range(counts[1]):
        f = rings[1, k]
        for c in range(3):
            w = faces[f, c]
            if w not in (u, v) and marks[w] == mark:
                common += 1
                marks[w] = mark - 1
    if common != shared or shared > 2 or shared == 0:
        return False
    if border[u] and border[v] and shared == 2:
        return False
    if counts[0] + counts[1] - 2 * shared < 3 and shared == 2:
        return False  # a tetrahedron would become two sheets

    nx, ny, nz = 0.0, 0.0, 0.0
    for side in range(2):
        for k in range(counts[side]):
            f = rings[side, k]
            a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
            other = v if side == 0 else u
            if other in (a, b, c):
                continue
            end = u if side == 0 else v
            pa = place if a == end else points[a]
            pb = place if b == end else points[b]
            pc = place if c == end else points[c]
            x, y, z = _cross(pa, pb, pc)
            ox, oy, oz = _cross(points[a], points[b], points[c])
            new, old = np.sqrt(x * x + y * y + z * z), np.sqrt(ox * ox + oy * oy + oz * oz)
            if new == 0.0:
                return False
            if old > 0.0 and x * ox + y * oy + z * oz < facing * new * old:
                return False
            if _quality(pa, pb, pc, new) < quality:
                before = _quality(points[a], points[b], points[c], old)
                if _quality(pa, pb, pc, new) < before:
                    return False
            # The mean that carries the texture is weighted by the angles at the vertex.
            if a == end:
                angle = _angle(pa, pb, pc)
            elif b == end:
                angle = _angle(pb, pc, pa)
            else:
                angle = _angle(pc, pa, pb)
            nx, ny, nz = nx + angle * x / new, ny + angle * y / new, nz + angle * z / new
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    if length == 0.0:
        return False
    for side in range(2):
        for k in range(counts[side]):
            f = rings[side, k]
            a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
            other = v if side == 0 else u
            if other in (a, b, c):
                continue
            end = u if side == 0 else v
            pa = place if a == end else points[a]
            pb = place if b == end else points[b]
            pc = place if c == end else points[c]
            x, y, z = _cross(pa, pb, pc)
            new = np.sqrt(x * x + y * y + z * z)
            if x * nx + y * ny + z * nz < facing * new * length:
                return False
    return True


@kernel
def _angle(a, b, c):
    """Return the angle at the corner a of a triangle [rad]."""
    x, y, z = _cross(a, b, c)
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
def _quadrics(points, faces, border_edges):
    """Return the quadrics (n, 10) of all vertices."""
    out = np.zeros((len(points), 10))
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        x, y, z = _cross(points[a], points[b], points[c])
        area = np.sqrt(x * x + y * y + z * z)
        if area == 0.0:
            continue
        x, y, z = x / area, y / area, z / area
        d = -(x * points[a, 0] + y * points[a, 1] + z * points[a, 2])
        for v in (a, b, c):
            _add_plane(out[v], x, y, z, d, area / 6.0)
    for k in range(len(border_edges)):
        # A plane through the border, upright on its triangle.
        f, c = border_edges[k] // 3, border_edges[k] % 3
        a, b = faces[f, c], faces[f, (c + 1) % 3]
        x, y, z = _cross(points[faces[f, 0]], points[faces[f, 1]], points[faces[f, 2]])
        ex, ey, ez = points[b] - points[a]
        sx, sy, sz = ey * z - ez * y, ez * x - ex * z, ex * y - ey * x
        size = np.sqrt(sx * sx + sy * sy + sz * sz)
        if size == 0.0:
            continue
        sx, sy, sz = sx / size, sy / size, sz / size
        d = -(sx * points[a, 0] + sy * points[a, 1] + sz * points[a, 2])
        weight = _BORDER * (ex * ex + ey * ey + ez * ez)
        _add_plane(out[a], sx, sy, sz, d, weight)
        _add_plane(out[b], sx, sy, sz, d, weight)
    return out


@kernel
def _single_edges(faces, head, following):
    """Return the half-edges that no other triangle meets."""
    out = np.empty(3 * len(faces), dtype=np.int64)
    n = 0
    for h in range(3 * len(faces)):
        u, v = faces[h // 3, h % 3], faces[h // 3, (h + 1) % 3]
        met = 0
        corner = head[u]
        while corner >= 0:
            f = corner // 3
            if v in (faces[f, 0], faces[f, 1], faces[f, 2]):
                met += 1
            corner = following[corner]
        if met == 1:
            out[n] = h
            n += 1
    return out[:n]


@kernel
def _collapse(points, faces, alive, target, facing, quality):
    """Collapse edges until `target` triangles are alive."""
    n, m = len(points), len(faces)
    head, tail = np.full(n, -1, dtype=np.int64), np.full(n, -1, dtype=np.int64)
    following = np.full(3 * m, -1, dtype=np.int64)
    for h in range(3 * m):
        v = faces[h // 3, h % 3]
        if head[v] < 0:
            head[v] = h
        else:
            following[tail[v]] = h
        tail[v] = h
    single = _single_edges(faces, head, following)
    border = np.zeros(n, dtype=np.bool_)
    for h in single:
        border[faces[h // 3, h % 3]] = border[faces[h // 3, (h + 1) % 3]] = True
    quadric = _quadrics(points, faces, single)
    stamp = np.zeros(n, dtype=np.int64)
    marks = np.zeros(n, dtype=np.int64)
    mark = 2
    keys, heap, size = np.empty(6 * m + 64), np.empty((6 * m + 64, 3), dtype=np.int64), 0
    both, place, edge = np.empty(10), np.empty(3), np.empty(3, dtype=np.int64)
    for h in range(3 * m):
        u, v = faces[h // 3, h % 3], faces[h // 3, (h + 1) % 3]
        if u < v or (border[u] and border[v]):
            both[:] = quadric[u] + quadric[v]
            _place(both, points[u], points[v], border[u], border[v], place)
            size = _push(heap, keys, size, _cost(both, place), u, v, 0)
    rings, counts = np.empty((2, _MOST), dtype=np.int64), np.empty(2, dtype=np.int64)
    left = m
    while size > 0 and left > target:
        size = _pop(heap, keys, size, edge)
        u, v = edge[0], edge[1]
        if head[u] < 0 or head[v] < 0 or stamp[u] + stamp[v] != edge[2]:
            continue
        counts[0] = _round(u, faces, alive, head, following, rings[0])
        counts[1] = _round(v, faces, alive, head, following, rings[1])
        if counts[0] < 0 or counts[1] < 0:
            continue
        both[:] = quadric[u] + quadric[v]
        _place(both, points[u], points[v], border[u], border[v], place)
        mark += 2
        if not _may(
            u, v, place, points, faces, rings, counts, border, marks, mark, facing, quality
        ):
            continue
        points[u] = place
        quadric[u] = both
        border[u] = border[u] or border[v]
        for k in range(counts[1]):
            f = rings[1, k]
            if u in (faces[f, 0], faces[f, 1], faces[f, 2]):
                alive[f] = False
                left -= 1
            for c in range(3):
                if faces[f, c] == v:
                    faces[f, c] = u
        following[tail[u]] = head[v]
        tail[u] = tail[v]
        head[v] = -1
        # Edges that were put off may do now, so all round the new vertex are looked at again.
        count = _round(u, faces, alive, head, following, rings[0])
        stamp[u] += 1_000_003
        mark += 2
        for k in range(max(count, 0)):
            f = rings[0, k]
            for c in range(3):
                w = faces[f, c]
                if w == u or marks[w] == mark:
                    continue
                marks[w] = mark
                if size == len(keys):
                    keys = np.concatenate((keys, np.empty(size)))
                    heap = np.concatenate((heap, np.empty((size, 3), dtype=np.int64)))
                both[:] = quadric[u] + quadric[w]
                _place(both, points[u], points[w], border[u], border[w], place)
                size = _push(heap, keys, size, _cost(both, place), u, w, stamp[u] + stamp[w])
    return left
