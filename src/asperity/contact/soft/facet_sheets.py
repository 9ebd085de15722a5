"""Distance of a point outside the displaced surface of a facet, along the facet's normals.

The surface is `p = a + t(a) w(a) / |w(a)|` with a on the plane of the facet. A point q of the
facet's frame has the foot a with `q = a + h w(a)`, and the distance

    f(q) = h |w(a)| - t(a),

as in `sheets`, but with interpolated normals. The matrix of `dq = A (da, dh)` has the columns
`e_x + h w_x`, `e_y + h w_y` and w; its inverse gives grad f.
"""

from __future__ import annotations

import math

from asperity._core.kernels import inner_kernel, small_kernel
from asperity._core.stack import stack_array
from asperity.contact.soft.sheets import TRIPLANAR, texture_on
from asperity.texture.packed import texture_slope

OUTSIDE, BEYOND, NEAR, WITHIN = range(-1, 3)
"""Position of a foot: outside a facet, on its extension beyond an edge, near such an edge, within.
"""
_FOOT_STEPS = 20
_STEEPEST = 0.05
"""Lower limit of w's part along the facet's normal, reached only far beyond the borders."""


@inner_kernel
def where_on(facet, x, y):
    """Return the position of (x, y) on a facet: `OUTSIDE`, `BEYOND`, `NEAR` or `WITHIN`."""
    place = WITHIN
    for k in range(facet.sides):
        border = facet.borders[k]
        over, reach = border[0] + border[1] * x + border[2] * y, border[3]
        if over > reach:
            return OUTSIDE
        if over > 0.0:
            place = BEYOND
        elif over > -reach:
            place = min(place, NEAR)
    return place


@small_kernel
def is_far(facet, x, y, margin):
    """Return whether (x, y) is outside a facet by more than a margin [m]."""
    for k in range(facet.sides):
        border = facet.borders[k]
        if border[0] + border[1] * x + border[2] * y > border[3] + margin:
            return True
    return False


@small_kernel
def along_axis(facet, i, x):
    """Return component `i` of a direction (3,) of the geom's frame in a facet's axes."""
    axis = facet.axes[i]
    return axis[0] * x[0] + axis[1] * x[1] + axis[2] * x[2]


@small_kernel
def from_origin(facet, i, x):
    """Return component `i` of a point (3,) of the geom's frame in a facet's axes [m]."""
    axis, at = facet.axes[i], facet.origin
    return axis[0] * (x[0] - at[0]) + axis[1] * (x[1] - at[1]) + axis[2] * (x[2] - at[2])


@inner_kernel
def _height(solids, g, facet, x, y, w):
    """Return the texture's height at (x, y) of a facet, and its derivatives; `w` (3,) is known."""
    geometry = solids.geometry
    surface = geometry.surface[g]
    k = geometry.texture[surface]
    if k < 0:
        return 0.0, 0.0, 0.0
    if geometry.mapping[surface] != TRIPLANAR:
        place = facet.place
        t, t_u, t_v = texture_slope(
            solids.textures, k, place[0, 0] + place[1, 0] * x + place[2, 0] * y,
            place[0, 1] + place[1, 1] * x + place[2, 1] * y,
        )  # fmt: skip
        return t, t_u * place[1, 0] + t_v * place[1, 1], t_u * place[2, 0] + t_v * place[2, 1]
    base, normal = stack_array((3,)), stack_array((3,))
    by_base, by_normal = stack_array((3,)), stack_array((3,))
    for i in range(3):
        base[i] = facet.origin[i] + x * facet.axes[0, i] + y * facet.axes[1, i]
        normal[i] = 0.0
        for j in range(3):
            normal[i] += w[j] * facet.axes[j, i]
    t = texture_on(solids, g, False, base, normal, by_base, by_normal)
    t_x = t_y = 0.0
    for i in range(3):
        t_x += by_base[i] * facet.axes[0, i]
        t_y += by_base[i] * facet.axes[1, i]
        for j in range(3):
            t_x += by_normal[i] * facet.axes[j, i] * facet.w[1, j]
            t_y += by_normal[i] * facet.axes[j, i] * facet.w[2, j]
    return t, t_x, t_y


@inner_kernel
def facet_sheet(solids, g, facet, q, gradient_out, foot_out):
    """Return f at a point in a facet's axes (3,); fill its gradient (3,) and the foot (2,)."""
    w = stack_array((3,))
    x, y, h = fill_foot(facet, q, w)
    foot_out[0], foot_out[1] = x, y
    t, t_x, t_y = _height(solids, g, facet, x, y, w)
    if facet.is_level:
        gradient_out[0], gradient_out[1], gradient_out[2] = -t_x, -t_y, 1.0
        return h - t
    by_x, by_y = facet.w[1], facet.w[2]
    one, two = stack_array((3,)), stack_array((3,))
    size = along_x = along_y = 0.0
    for i in range(3):
        one[i], two[i] = h * by_x[i], h * by_y[i]
        size += w[i] * w[i]
        along_x += w[i] * by_x[i]
        along_y += w[i] * by_y[i]
    one[0] += 1.0
    two[1] += 1.0
    size = math.sqrt(size)
    from_x, from_y = h * along_x / size - t_x, h * along_y / size - t_y
    det = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        det += one[i] * (two[j] * w[k] - two[k] * w[j])
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        gradient_out[i] = (
            from_x * (two[j] * w[k] - two[k] * w[j])
            + from_y * (w[j] * one[k] - w[k] * one[j])
            + size * (one[j] * two[k] - one[k] * two[j])
        ) / det
    return h * size - t


@inner_kernel
def fill_foot(facet, q, w_out):
    """Return the foot (x, y) of a point and h, and fill w there (3,).

    The foot is linear in h, and h depends little on the foot.
    """
    w, h = facet.w, q[2]
    x, y = q[0], q[1]
    if facet.is_level:
        w_out[0], w_out[1], w_out[2] = 0.0, 0.0, 1.0
        return x, y, h
    for _ in range(_FOOT_STEPS):
        a, b, c, d = 1.0 + h * w[1, 0], h * w[2, 0], h * w[1, 1], 1.0 + h * w[2, 1]
        right, up = q[0] - h * w[0, 0], q[1] - h * w[0, 1]
        det = a * d - b * c
        x, y = (d * right - b * up) / det, (a * up - c * right) / det
        for i in range(3):
            w_out[i] = w[0, i] + x * w[1, i] + y * w[2, i]
        w_out[2] = max(w_out[2], _STEEPEST)
        step = q[2] / w_out[2] - h
        h += step
        if abs(step) <= 1e-16 * abs(h) + 1e-19:
            break
    return x, y, h
