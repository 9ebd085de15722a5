"""Quadrics of the vertices of a mesh: sums of squared distances from planes.

A quadric is the upper triangle of a symmetric 4 x 4 matrix, row by row but for the last column: xx,
xy, xz, yy, yz, zz, then x, y, z of the linear part, then the constant; ten numbers in all. Source:
Garland & Heckbert, "Surface simplification using quadric error metrics", SIGGRAPH 97.
"""

from __future__ import annotations

import numpy as np

from asperity._core.kernels import kernel

_TOWARDS_MIDDLE = 1e-3
"""Weight of the squared distance from the edge's middle: where planes leave the point open."""
_BORDER = 10.0
"""Weight of the planes through borders, without which these would shrink."""


@kernel
def triangle_cross(a, b, c):
    """Return the cross product of two sides of a triangle: its normal, twice its area long."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


@kernel
def _add_plane(q, x, y, z, d, weight):
    """Add the weighted squared distance from the plane (x, y, z, d) to a quadric."""
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
def cost_at(q, p):
    """Return the value of a quadric at a point."""
    x, y, z = p[0], p[1], p[2]
    return (
        q[0] * x * x + 2.0 * q[1] * x * y + 2.0 * q[2] * x * z + q[3] * y * y
        + 2.0 * q[4] * y * z + q[5] * z * z
        + 2.0 * (q[6] * x + q[7] * y + q[8] * z) + q[9]
    )  # fmt: skip


@kernel
def fill_cheapest(q, a, b, a_at_border, b_at_border, out):
    """Fill the point at which an edge (a, b) is collapsed with least cost.

    The cost is the edge's quadric plus a small weight of the squared distance from its middle. If
    only one end is on a border, that end is the point.
    """
    if a_at_border != b_at_border:
        for k in range(3):
            out[k] = a[k] if a_at_border else b[k]
        return
    mx, my, mz = 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])
    e = _TOWARDS_MIDDLE * (q[0] + q[3] + q[5]) + 1e-30
    xx, yy, zz, xy, xz, yz = q[0] + e, q[3] + e, q[5] + e, q[1], q[2], q[4]
    # Newton step from the middle: the right side is the negative gradient there.
    rx = -(q[0] * mx + xy * my + xz * mz + q[6])
    ry = -(xy * mx + q[3] * my + yz * mz + q[7])
    rz = -(xz * mx + yz * my + q[5] * mz + q[8])
    cx, cy, cz = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    det = xx * cx + xy * cy + xz * cz
    dx = (cx * rx + cy * ry + cz * rz) / det
    dy = (cy * rx + (xx * zz - xz * xz) * ry + (xy * xz - xx * yz) * rz) / det
    dz = (cz * rx + (xy * xz - xx * yz) * ry + (xx * yy - xy * xy) * rz) / det
    # The step is at most as long as the edge.
    far = np.sqrt(dx * dx + dy * dy + dz * dz)
    length = np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)
    scale = 1.0 if far <= length else length / far
    out[0], out[1], out[2] = mx + scale * dx, my + scale * dy, mz + scale * dz


@kernel
def vertex_quadrics(points, faces, border_edges):
    """Return the quadrics (n, 10) of all vertices.

    `border_edges` are half-edges `3 * triangle + corner`.
    """
    out = np.zeros((len(points), 10))
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        x, y, z = triangle_cross(points[a], points[b], points[c])
        area = np.sqrt(x * x + y * y + z * z)
        if area == 0.0:
            continue
        x, y, z = x / area, y / area, z / area
        d = -(x * points[a, 0] + y * points[a, 1] + z * points[a, 2])
        for v in (a, b, c):
            _add_plane(out[v], x, y, z, d, area / 6.0)
    for k in range(len(border_edges)):
        # A plane through the border, perpendicular to its triangle.
        f, c = border_edges[k] // 3, border_edges[k] % 3
        a, b = faces[f, c], faces[f, (c + 1) % 3]
        x, y, z = triangle_cross(points[faces[f, 0]], points[faces[f, 1]], points[faces[f, 2]])
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
