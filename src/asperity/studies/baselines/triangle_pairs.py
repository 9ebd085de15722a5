"""Kernels for the nearest points of two triangles."""

from __future__ import annotations

import math

from asperity._core.kernels import inner_kernel


@inner_kernel
def _segments(p, p2, q, q2, out):
    """Return the squared distance of two segments; write their nearest points to `out` (2, 3).

    Ericson (2005), section 5.1.9.
    """
    aa = ee = f = c = b = 0.0
    for k in range(3):
        d1, d2, r = p2[k] - p[k], q2[k] - q[k], p[k] - q[k]
        aa += d1 * d1
        ee += d2 * d2
        f += d2 * r
        c += d1 * r
        b += d1 * d2
    s = t = 0.0
    if aa > 0.0 and ee > 0.0:
        under = aa * ee - b * b
        if under > 1e-12 * aa * ee:
            s = min(max((b * f - c * ee) / under, 0.0), 1.0)
        t = (b * s + f) / ee
        if t < 0.0:
            t, s = 0.0, min(max(-c / aa, 0.0), 1.0)
        elif t > 1.0:
            t, s = 1.0, min(max((b - c) / aa, 0.0), 1.0)
    elif ee > 0.0:  # the first segment is a point
        t = min(max(f / ee, 0.0), 1.0)
    elif aa > 0.0:
        s = min(max(-c / aa, 0.0), 1.0)
    total = 0.0
    for k in range(3):
        out[0, k] = p[k] + s * (p2[k] - p[k])
        out[1, k] = q[k] + t * (q2[k] - q[k])
        total += (out[0, k] - out[1, k]) ** 2
    return total


@inner_kernel
def _to_inside(p, triangle, out):
    """Return the squared distance of a point to a triangle's inside; write its foot to `out[0]`.

    Infinite if the foot is outside the triangle: then an edge is nearer.
    """
    a, b, c = triangle[0], triangle[1], triangle[2]
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    wx, wy, wz = p[0] - a[0], p[1] - a[1], p[2] - a[2]
    uu, uv, vv = (
        ux * ux + uy * uy + uz * uz,
        ux * vx + uy * vy + uz * vz,
        vx * vx + vy * vy + vz * vz,
    )
    wu, wv = wx * ux + wy * uy + wz * uz, wx * vx + wy * vy + wz * vz
    under = uu * vv - uv * uv
    if under <= 0.0:
        return math.inf
    s, t = (vv * wu - uv * wv) / under, (uu * wv - uv * wu) / under
    if s < 0.0 or t < 0.0 or s + t > 1.0:
        return math.inf
    out[0, 0], out[0, 1], out[0, 2] = (
        a[0] + s * ux + t * vx, a[1] + s * uy + t * vy, a[2] + s * uz + t * vz
    )  # fmt: skip
    return (p[0] - out[0, 0]) ** 2 + (p[1] - out[0, 1]) ** 2 + (p[2] - out[0, 2]) ** 2


@inner_kernel
def _crosses(p, p2, triangle):
    """Return whether a segment crosses a triangle (Moeller & Trumbore 1997)."""
    a, b, c = triangle[0], triangle[1], triangle[2]
    dx, dy, dz = p2[0] - p[0], p2[1] - p[1], p2[2] - p[2]
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    hx, hy, hz = dy * vz - dz * vy, dz * vx - dx * vz, dx * vy - dy * vx
    under = ux * hx + uy * hy + uz * hz
    if under == 0.0:
        return False
    wx, wy, wz = p[0] - a[0], p[1] - a[1], p[2] - a[2]
    s = (wx * hx + wy * hy + wz * hz) / under
    gx, gy, gz = wy * uz - wz * uy, wz * ux - wx * uz, wx * uy - wy * ux
    t = (dx * gx + dy * gy + dz * gz) / under
    along = (vx * gx + vy * gy + vz * gz) / under
    return s >= 0.0 and t >= 0.0 and s + t <= 1.0 and 0.0 <= along <= 1.0


@inner_kernel
def nearest_points(one, other, scratch, out):
    """Return the distance of two triangles (3, 3); write their nearest points to `out` (2, 3).

    `scratch` is (2, 3). For triangles that cross, the distance is 0 and the points are undefined.
    """
    best = math.inf
    for i in range(3):
        for j in range(3):
            square = _segments(one[i], one[(i + 1) % 3], other[j], other[(j + 1) % 3], scratch)
            if square < best:
                best = square
                for k in range(3):
                    out[0, k], out[1, k] = scratch[0, k], scratch[1, k]
    for i in range(3):
        square = _to_inside(one[i], other, scratch)
        if square < best:
            best = square
            for k in range(3):
                out[0, k], out[1, k] = one[i, k], scratch[0, k]
        square = _to_inside(other[i], one, scratch)
        if square < best:
            best = square
            for k in range(3):
                out[0, k], out[1, k] = scratch[0, k], other[i, k]
    if best > 0.0:
        for i in range(3):
            if _crosses(one[i], one[(i + 1) % 3], other) or _crosses(
                other[i], other[(i + 1) % 3], one
            ):
                return 0.0
    return math.sqrt(best)
