"""Support functions of convex geoms, exact and smoothed.

The support function of a solid is `h(n) = max n . x` over its points x relative to its centre; its
gradient is the support point. All geoms are symmetric about their centres. Lengths in metres.
"""

from __future__ import annotations

import math

from asperity._core.kernels import clear, inner_kernel
from asperity._core.stack import stack_array
from asperity.geometry.bodies import KINDS

PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX = (KINDS.index(kind) for kind in KINDS[:6])
ROUNDING = 0.01
"""Angle over which the smoothed support functions round edges and corners [rad]."""


@inner_kernel
def support(kind, size, axes, n, point_out):
    """Return the support function of a geom along a unit vector n; fill its support point (3,).

    If a face or an edge is normal to n, the point is its middle. `axes` (3, 3) has the geom's axes
    in columns. A plane has no size.
    """
    local, p = stack_array((3,)), stack_array((3,))
    clear(p)
    for i in range(3):
        local[i] = axes[0, i] * n[0] + axes[1, i] * n[1] + axes[2, i] * n[2]
    if kind in (SPHERE, CAPSULE):
        for i in range(3):
            p[i] = size[0] * local[i]
        if kind == CAPSULE and local[2] != 0.0:
            p[2] += math.copysign(size[1], local[2])
    elif kind == ELLIPSOID:
        height = 0.0
        for i in range(3):
            height += (size[i] * local[i]) ** 2
        for i in range(3):
            p[i] = size[i] * size[i] * local[i] / math.sqrt(height)
    elif kind == CYLINDER:
        across = math.hypot(local[0], local[1])
        if across > 0.0:
            p[0], p[1] = size[0] * local[0] / across, size[0] * local[1] / across
        if local[2] != 0.0:
            p[2] = math.copysign(size[1], local[2])
    elif kind == BOX:
        for i in range(3):
            if local[i] != 0.0:
                p[i] = math.copysign(size[i], local[i])
    height = 0.0
    for i in range(3):
        height += p[i] * local[i]
        point_out[i] = axes[i, 0] * p[0] + axes[i, 1] * p[1] + axes[i, 2] * p[2]
    return height


@inner_kernel
def _add_term(axes, scale, n, gradient, hessian):
    """Add `sqrt(n . Q n)` with `Q = sum_i scale_i axis_i axis_i^T` to a support function.

    `scale` is a tuple. Returns the term; its gradient (3,) and Hessian (3, 3) are added.
    """
    turned = stack_array((3,))
    clear(turned)
    for k in range(3):
        along = axes[0, k] * n[0] + axes[1, k] * n[1] + axes[2, k] * n[2]
        for i in range(3):
            turned[i] += scale[k] * along * axes[i, k]
    value = math.sqrt(n[0] * turned[0] + n[1] * turned[1] + n[2] * turned[2])
    for i in range(3):
        gradient[i] += turned[i] / value
        for j in range(3):
            q = 0.0
            for k in range(3):
                q += scale[k] * axes[i, k] * axes[j, k]
            hessian[i, j] += q / value - turned[i] * turned[j] / value**3
    return value


@inner_kernel
def add_smooth_support(kind, size, axes, n, gradient, hessian):
    """Return a smoothed support function along a unit vector n; add its derivatives by n.

    Edges and corners are rounded over the angle `ROUNDING`, so that the function is smooth and
    strictly convex across n. `gradient` is (3,), `hessian` (3, 3).
    """
    e = ROUNDING * ROUNDING
    total = 0.0
    if kind == ELLIPSOID:
        scale = (size[0] * size[0], size[1] * size[1], size[2] * size[2])
        total = _add_term(axes, scale, n, gradient, hessian)
    elif kind == BOX:
        for k in range(3):
            square = size[k] * size[k]
            scale = (
                square * (e + (1.0 if k == 0 else 0.0)), square * (e + (1.0 if k == 1 else 0.0)),
                square * (e + (1.0 if k == 2 else 0.0)),
            )  # fmt: skip
            total += _add_term(axes, scale, n, gradient, hessian)
    elif kind != PLANE:
        square = size[0] * size[0]
        flat = square * e if kind == CYLINDER else square
        wide = square * (1.0 + e) if kind == CYLINDER else square
        total = _add_term(axes, (wide, wide, flat), n, gradient, hessian)
        if kind != SPHERE:
            square = size[1] * size[1]
            total += _add_term(
                axes, (square * e, square * e, square * (1.0 + e)), n, gradient, hessian
            )
    return total
