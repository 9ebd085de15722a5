"""Implicit form of a textured surface: distance of a point outside it, along the surface's normal.

A simple solid is the intersection of *sheets*: its flat faces, and its curved side if it has one.
With tau the signed distance of a point x to a smooth sheet, b the closest point of it and w the
normal there, the textured surface `b + t w` is the zero set of

    f(x) = tau(x) - t(b(x), w(x)),      grad f = w - db/dx^T t_b - dw/dx^T t_w.

It is the surface of `contact.narrow_phase`, in the form for intersection with rays.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array
from asperity._core.kernels import inner_kernel
from asperity._core.stack import stack_array
from asperity._core.structures import by_reference
from asperity.contact.body_arrays import Geometry
from asperity.contact.soft.mesh_records import MeshFacets
from asperity.texture.packed import PackedTextures, texture_slope

PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH = range(7)
"""Indices into `geometry.bodies.KINDS`."""
CURVED = -1
"""The curved sheet of a solid; flat ones are 2 axis + (1 for the positive side)."""
PLANAR, _CYLINDRICAL, TRIPLANAR = range(3)
"""Indices into `geometry.bodies.MAPPINGS`."""
GRAZING = 1e-3
"""Lower limit of the cosine between a ray and a normal in a force."""
_NEGLIGIBLE = 1e-12
"""Weight below which a map of a triplanar mapping is ignored, as in the search for depths."""

REACH = np.dtype([("lowest", "f8"), ("highest", "f8"), ("slope", "f8"), ("bend", "f8")])
"""Bounds of the texture on a geom [m], of its slope [-] and of its curvature [1/m]."""


@by_reference
class Solids(NamedTuple):
    """Textured solids; rows are geoms."""

    textures: PackedTextures
    geometry: Geometry
    reach: NDArray[np.void]
    """`REACH` records, (geoms,)."""
    frames: Array
    """Rotation and position in the world, (geoms, 3, 4)."""
    bound: Array
    """Radius of the bounding sphere of each geom's textured surface [m], (geoms,)."""
    extent: Array
    """Half sides of the bounding box of each geom's textured surface, in the geom's frame [m],
    (geoms, 3); a plane is bounded only above."""
    meshes: MeshFacets | None
    """Facets of the geoms that are meshes; None without any."""


@inner_kernel
def half_length(kind, size, axis):
    """Return the distance of a flat sheet from the middle of its solid [m]."""
    if kind == PLANE:
        return 0.0
    return size[1] if kind == CYLINDER else size[axis]


@inner_kernel
def texture_on(solids, g, on_side, base, w, by_base, by_normal):
    """Return the texture's height t at a base point with the normal w; fill t_b and t_w.

    All vectors are (3,) in the geom's frame. `on_side` is whether a cylindrical map covers the
    point.
    """
    for i in range(3):
        by_base[i] = by_normal[i] = 0.0
    textures, geometry = solids.textures, solids.geometry
    surface = geometry.surface[g]
    k, mapping = geometry.texture[surface], geometry.mapping[surface]
    if k < 0 or (mapping == _CYLINDRICAL and not on_side):
        return 0.0
    origin_u, origin_v = geometry.origin[surface, 0], geometry.origin[surface, 1]
    if mapping == _CYLINDRICAL:
        radius, x, y = geometry.size[g, 0] * geometry.around[g], base[0], base[1]
        t, t_u, t_v = texture_slope(
            textures, k, radius * math.atan2(y, x) - origin_u, base[2] - origin_v
        )
        turn = t_u * radius / (x * x + y * y)
        by_base[0], by_base[1], by_base[2] = -turn * y, turn * x, t_v
        return t
    turn, at = geometry.rotation[g], geometry.position[g]
    x = turn[0, 0] * base[0] + turn[0, 1] * base[1] + turn[0, 2] * base[2] + at[0]
    y = turn[1, 0] * base[0] + turn[1, 1] * base[1] + turn[1, 2] * base[2] + at[1]
    if mapping != TRIPLANAR:
        t, t_u, t_v = texture_slope(textures, k, x - origin_u, y - origin_v)
        for i in range(3):
            by_base[i] = t_u * turn[0, i] + t_v * turn[1, i]
        return t
    z = turn[2, 0] * base[0] + turn[2, 1] * base[1] + turn[2, 2] * base[2] + at[2]
    total = t = 0.0
    share, height = stack_array((3,)), stack_array((3,))
    for axis in range(3):
        c = turn[axis, 0] * w[0] + turn[axis, 1] * w[1] + turn[axis, 2] * w[2]
        weight = c * c * c * c
        share[axis] = height[axis] = 0.0
        if weight < _NEGLIGIBLE:
            continue
        u, v = ((y, z), (z, x), (x, y))[axis]
        height[axis], t_u, t_v = texture_slope(textures, k, u - origin_u, v - origin_v)
        share[axis] = 4.0 * c * c * c
        total += weight
        t += weight * height[axis]
        one, two = (axis + 1) % 3, (axis + 2) % 3
        for i in range(3):
            by_base[i] += weight * (t_u * turn[one, i] + t_v * turn[two, i])
    t /= total
    for i in range(3):
        by_base[i] /= total
        for axis in range(3):
            by_normal[i] += share[axis] * (height[axis] - t) / total * turn[axis, i]
    return t


@inner_kernel
def _fill_flat_foot(kind, size, face, x, base, w):
    axis, sign = face >> 1, 1.0 if face & 1 else -1.0
    level = half_length(kind, size, axis)
    for i in range(3):
        base[i], w[i] = x[i], 0.0
    base[axis], w[axis] = sign * level, sign
    return sign * x[axis] - level


@inner_kernel
def _fill_round_foot(kind, size, x, base, w):
    """Fill the closest point of a ball, capsule or cylinder; return tau, rho, whether on a side."""
    radius, middle, on_side = size[0], 0.0, kind == CYLINDER
    if kind == CYLINDER:
        middle = x[2]
    elif kind == CAPSULE:
        middle = min(max(x[2], -size[1]), size[1])
        on_side = abs(x[2]) <= size[1]
    up = x[2] - middle
    rho = max(math.sqrt(x[0] * x[0] + x[1] * x[1] + up * up), 1e-30)
    w[0], w[1], w[2] = x[0] / rho, x[1] / rho, up / rho
    base[0], base[1], base[2] = radius * w[0], radius * w[1], radius * w[2] + middle
    return rho - radius, rho, on_side


@inner_kernel
def _fill_ellipsoid_foot(size, x, base, w):
    """Fill the closest point of an ellipsoid; return tau, mu and the length of x / (a^2 + mu).

    The closest point is a^2 x / (a^2 + mu); mu is the largest root of a convex function, which
    Newton's method approaches from below (Eberly, Distance from a point to an ellipsoid, 2013).
    """
    mu = -1e30
    for i in range(3):
        mu = max(mu, size[i] * abs(x[i]) - size[i] * size[i])
    mu = max(mu, (1e-9 - 1.0) * min(size[0], size[1], size[2]) ** 2)
    for _ in range(60):
        value, slope = -1.0, 0.0
        for i in range(3):
            over = 1.0 / (size[i] * size[i] + mu)
            q = size[i] * x[i] * over
            value += q * q
            slope -= 2.0 * q * q * over
        step = value / slope if slope < 0.0 else 0.0
        mu -= step
        if abs(step) <= 1e-17:
            break
    length = 0.0
    for i in range(3):
        w[i] = x[i] / (size[i] * size[i] + mu)
        base[i] = size[i] * size[i] * w[i]
        length += w[i] * w[i]
    length = max(math.sqrt(length), 1e-30)
    for i in range(3):
        w[i] /= length
    return mu * length, mu, length


@inner_kernel
def _solve(m, right, out):
    """Solve a symmetric system (3, 3)."""
    a, b, c, d, e, f = m[0, 0], m[0, 1], m[0, 2], m[1, 1], m[1, 2], m[2, 2]
    p, q, r = d * f - e * e, c * e - b * f, b * e - c * d
    det = a * p + b * q + c * r
    x, y, z = right[0], right[1], right[2]
    out[0] = (p * x + q * y + r * z) / det
    out[1] = (q * x + (a * f - c * c) * y + (b * c - a * e) * z) / det
    out[2] = (r * x + (b * c - a * e) * y + (a * d - b * b) * z) / det


@inner_kernel
def _project_out(vector, w):
    """Remove from a vector its component along w."""
    along = vector[0] * w[0] + vector[1] * w[1] + vector[2] * w[2]
    for i in range(3):
        vector[i] -= along * w[i]


@inner_kernel
def _pull_back_ellipsoid(size, mu, length, w, by_base, by_normal, out):
    """Fill db/dx^T t_b + dw/dx^T t_w of an ellipsoid."""
    inverse, m = stack_array((3,)), stack_array((3, 3))
    for i in range(3):
        inverse[i] = 1.0 / (size[i] * size[i])
    _project_out(by_normal, w)
    for i in range(3):
        by_base[i] += inverse[i] * by_normal[i] / length
    _project_out(by_base, w)
    # I + mu P A^-1 P with P = I - w w^T: its inverse maps a step of x perpendicular to w to that of
    # the closest point.
    bend = 0.0
    for i in range(3):
        bend += inverse[i] * w[i] * w[i]
    for i in range(3):
        for j in range(3):
            along = w[i] * w[j] * (bend - inverse[i] - inverse[j])
            same = 1.0 if i == j else 0.0
            m[i, j] = same + mu * (same * inverse[i] + along)
    _solve(m, by_base, out)
    _project_out(out, w)


@inner_kernel
def sheet_at(solids, g, face, x, normal_out):
    """Return f at a point of the geom's frame (3,); fill its gradient (3,)."""
    base, w = stack_array((3,)), stack_array((3,))
    by_base, by_normal = stack_array((3,)), stack_array((3,))
    kind, size = solids.geometry.kind[g], solids.geometry.size[g]
    if face >= 0:
        tau = _fill_flat_foot(kind, size, face, x, base, w)
        t = texture_on(solids, g, False, base, w, by_base, by_normal)
        _project_out(by_base, w)
        for i in range(3):
            normal_out[i] = w[i] - by_base[i]
        return tau - t
    if kind == ELLIPSOID:
        tau, mu, length = _fill_ellipsoid_foot(size, x, base, w)
        t = texture_on(solids, g, False, base, w, by_base, by_normal)
        _pull_back_ellipsoid(size, mu, length, w, by_base, by_normal, normal_out)
        for i in range(3):
            normal_out[i] = w[i] - normal_out[i]
        return tau - t
    tau, rho, on_side = _fill_round_foot(kind, size, x, base, w)
    t = texture_on(solids, g, on_side, base, w, by_base, by_normal)
    along_axis = by_base[2]
    for i in range(3):
        by_base[i] = (size[0] * by_base[i] + by_normal[i]) / rho
    _project_out(by_base, w)
    if on_side:
        by_base[2] = along_axis
    for i in range(3):
        normal_out[i] = w[i] - by_base[i]
    return tau - t


@inner_kernel
def lift(solids, g, face, x, normal_out):
    """Move a point of a smooth sheet (3,) onto the textured surface; fill the smooth normal."""
    base, by_base, by_normal = stack_array((3,)), stack_array((3,)), stack_array((3,))
    kind, size, on_side = solids.geometry.kind[g], solids.geometry.size[g], False
    if face >= 0:
        _fill_flat_foot(kind, size, face, x, base, normal_out)
    elif kind == ELLIPSOID:
        _fill_ellipsoid_foot(size, x, base, normal_out)
    else:
        _, _, on_side = _fill_round_foot(kind, size, x, base, normal_out)
    t = texture_on(solids, g, on_side, base, normal_out, by_base, by_normal)
    for i in range(3):
        x[i] = base[i] + t * normal_out[i]
