"""The normal of the smooth surface of the scene's body under a contact of two geoms.

MuJoCo's normals depend on the tool, and their sign on the order of the geoms; they are not used. On
a curved geom the normal is that of its surface nearest to the contact. On a box or cylinder it is
that of the face; within `blend` of an edge the normals of the faces are averaged with weights that
fall off linearly, so that the normal turns continuously around the edge. A face that is covered by
another geom of the same body does not count: a plate made of many boxes has the normals of a plate.
"""

from __future__ import annotations

import math

from asperity._core.kernels import clear, inner_kernel
from asperity._core.stack import stack_array
from asperity.geometry.bodies import KINDS

_PLANE, _SPHERE, _CAPSULE, _ELLIPSOID, _CYLINDER = (KINDS.index(kind) for kind in KINDS[:5])


@inner_kernel
def _solid_distance(kind, size, p):
    """Return roughly the signed distance of a point from a geom's surface [m]; negative inside."""
    if kind == _PLANE:
        return p[2]
    if kind == _SPHERE:
        return math.sqrt(p[0] ** 2 + p[1] ** 2 + p[2] ** 2) - size[0]
    if kind == _CAPSULE:
        z = p[2] - min(max(p[2], -size[1]), size[1])
        return math.sqrt(p[0] ** 2 + p[1] ** 2 + z * z) - size[0]
    if kind == _ELLIPSOID:
        r = math.sqrt((p[0] / size[0]) ** 2 + (p[1] / size[1]) ** 2 + (p[2] / size[2]) ** 2)
        return (r - 1.0) * min(size[0], size[1], size[2])
    if kind == _CYLINDER:
        return max(math.sqrt(p[0] ** 2 + p[1] ** 2) - size[0], abs(p[2]) - size[1])
    return max(abs(p[0]) - size[0], abs(p[1]) - size[1], abs(p[2]) - size[2])


@inner_kernel
def _covered(geometry, g, x, y, z):
    """Return whether a point in the frame of geom `g` [m] lies within another geom of its body."""
    body = geometry.body[g]
    p, q = stack_array((3,)), stack_array((3,))
    for i in range(3):
        r = geometry.rotation[g]
        p[i] = geometry.position[g, i] + r[i, 0] * x + r[i, 1] * y + r[i, 2] * z
    for h in range(geometry.kind.size):
        if h == g or geometry.body[h] != body:
            continue
        for i in range(3):
            q[i] = 0.0
            for k in range(3):
                q[i] += geometry.rotation[h, k, i] * (p[k] - geometry.position[h, k])
        if _solid_distance(geometry.kind[h], geometry.size[h], q) < 0.0:
            return True
    return False


@inner_kernel
def normal_under(geometry, g, point, blend, out):
    """Fill the unit normal (3,) of geom `g`'s smooth surface near a point, in the body's frame.

    Parameters
    ----------
    geometry : Geometry
    g : int
    point : (3,) array
        In the body's frame [m].
    blend : float
        Distance from an edge within which the normals of its faces are averaged [m].
    out : (3,) array
    """
    p, n = stack_array((3,)), stack_array((3,))
    clear(n)
    rotation, size, kind = geometry.rotation[g], geometry.size[g], geometry.kind[g]
    for i in range(3):
        p[i] = 0.0
        for k in range(3):
            p[i] += rotation[k, i] * (point[k] - geometry.position[g, k])
    if kind == _PLANE:
        n[2] = 1.0
    elif kind == _SPHERE:
        n[0], n[1], n[2] = p[0], p[1], p[2]
    elif kind == _CAPSULE:
        n[0], n[1] = p[0], p[1]
        n[2] = p[2] - min(max(p[2], -size[1]), size[1])
    elif kind == _ELLIPSOID:
        for i in range(3):
            n[i] = p[i] / (size[i] * size[i])
    elif kind == _CYLINDER:
        r = math.sqrt(p[0] * p[0] + p[1] * p[1])
        side, end = r - size[0], abs(p[2]) - size[1]
        most = max(side, end)
        sign = 1.0 if p[2] >= 0.0 else -1.0
        on_side, on_end = (
            max(1.0 + (side - most) / blend, 0.0),
            max(1.0 + (end - most) / blend, 0.0),
        )
        if r > 0.0:
            n[0], n[1] = on_side * p[0] / r, on_side * p[1] / r
        if not (
            end < side
            and _covered(geometry, g, p[0] * 0.999, p[1] * 0.999, sign * (size[1] + 1e-6))
        ):
            n[2] = on_end * sign
    else:
        most = max(abs(p[0]) - size[0], abs(p[1]) - size[1], abs(p[2]) - size[2])
        inside = stack_array((3,))
        for i in range(3):
            # Just inside the box, so that an adjacent geom counts only where it covers the face.
            inside[i] = min(max(p[i], 1e-6 - size[i]), size[i] - 1e-6)
        for i in range(3):
            weight = 1.0 + (abs(p[i]) - size[i] - most) / blend
            if weight <= 0.0:
                continue
            sign = 1.0 if p[i] >= 0.0 else -1.0
            keep = inside[i]
            inside[i] = sign * (size[i] + 1e-6)
            if not _covered(geometry, g, inside[0], inside[1], inside[2]):
                n[i] = weight * sign
            inside[i] = keep
    length = math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    if length == 0.0:
        n[2], length = 1.0, 1.0
    for i in range(3):
        out[i] = 0.0
        for k in range(3):
            out[i] += rotation[i, k] * n[k] / length
