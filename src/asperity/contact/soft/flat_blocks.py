"""Compressions of a block of taxels by a flat sheet with a planar map.

Distance from the sheet, and u and v on the texture, are linear in a taxel's position. All taxels of
a block take each step of their search together, so that the processor can overlap their memory
accesses. Height and slope of the texture are bounded over the part that the block can touch.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.soft.exits import STEPS, advance
from asperity.contact.soft.sheets import GRAZING, half_length
from asperity.texture.packed import texture_bounds, texture_slope

RAY = np.dtype([
    ("taxel", "i8"),
    # Distance from the smooth sheet and texture coordinates: at its start, and their rates.
    ("gap", "f8"), ("u", "f8"), ("v", "f8"), ("rate", "f8"), ("du", "f8"), ("dv", "f8"),
    ("aside", "f8"),  # sine of its angle with the normal
    # Position and bracket of the search on the ray, and the texture there.
    ("s", "f8"), ("low", "f8"), ("high", "f8"), ("floor", "f8"),
    ("t", "f8"), ("t_u", "f8"), ("t_v", "f8"), ("is_read", "?"),
], align=True)  # fmt: skip
"""The ray of a taxel over a flat sheet; `is_read` is whether `t_u` and `t_v` are those of its end.
"""
_SAME = 1e-13
"""Change of a slope that is negligible [-]."""


@inner_kernel
def fill_sheet(solids, relative, g, face, pose, rows_out, gradients_out):
    """Fill the linear functions u, v and distance from a flat sheet of a taxel's position.

    `rows_out` (3, 4) is in the frame of the skin, `gradients_out` (3, 3) in world axes; `pose` is
    the skin's.
    """
    geometry, axis, sign = solids.geometry, face >> 1, 1.0 if face & 1 else -1.0
    turn, at = geometry.rotation[g], geometry.position[g]
    origin = geometry.origin[geometry.surface[g]]
    level = half_length(geometry.kind[g], geometry.size[g], axis)
    for j in range(4):
        rows_out[0, j] = rows_out[1, j] = 0.0
        rows_out[2, j] = sign * relative[g, axis, j]
        for i in range(3):
            if i != axis:  # the texture is read at the foot of a point
                rows_out[0, j] += turn[0, i] * relative[g, i, j]
                rows_out[1, j] += turn[1, i] * relative[g, i, j]
    for row in range(2):
        rows_out[row, 3] += at[row] - origin[row] + turn[row, axis] * sign * level
    rows_out[2, 3] -= level
    for row in range(3):
        for i in range(3):
            gradients_out[row, i] = 0.0
            for j in range(3):
                gradients_out[row, i] += pose[i, j] * rows_out[row, j]


@inner_kernel
def _fill_rays(rows, highest, taxels, first, last, rays):
    """Fill the rays of the taxels `first` to `last` that start below `highest`; return the number.

    The array needs room for one more.
    """
    count = 0
    for t in range(first, last):
        ray, point, d = rays[count], taxels.point[t], taxels.inwards[t]
        x, y, z = point[0], point[1], point[2]
        ray.taxel = t
        ray.u = rows[0, 3] + (rows[0, 0] * x + rows[0, 1] * y + rows[0, 2] * z)
        ray.v = rows[1, 3] + (rows[1, 0] * x + rows[1, 1] * y + rows[1, 2] * z)
        ray.gap = rows[2, 3] + (rows[2, 0] * x + rows[2, 1] * y + rows[2, 2] * z)
        ray.du = rows[0, 0] * d[0] + rows[0, 1] * d[1] + rows[0, 2] * d[2]
        ray.dv = rows[1, 0] * d[0] + rows[1, 1] * d[1] + rows[1, 2] * d[2]
        ray.rate = rows[2, 0] * d[0] + rows[2, 1] * d[1] + rows[2, 2] * d[2]
        if ray.gap < highest:
            count += 1
    return count


@inner_kernel
def _bounds_below(textures, k, reach, rays, count):
    """Return bounds of the texture's height and slope where the rays may leave it."""
    u0, u1, v0, v1 = np.inf, -np.inf, np.inf, -np.inf
    for i in range(count):
        ray = rays[i]
        for level in (reach.lowest, reach.highest):
            s = max((level - ray.gap) / ray.rate, 0.0)
            u, v = ray.u + s * ray.du, ray.v + s * ray.dv
            u0, u1, v0, v1 = min(u0, u), max(u1, u), min(v0, v), max(v1, v)
    highest, slope, _ = texture_bounds(textures, k, u0, u1, v0, v1)
    return min(highest, reach.highest), min(slope, reach.slope)


@small_kernel
def _evaluate(textures, k, rays, active, count):
    """Fill height and slope of the texture at the current points of some rays."""
    for i in range(count):
        ray = rays[active[i]]
        t, t_u, t_v = texture_slope(textures, k, ray.u + ray.s * ray.du, ray.v + ray.s * ray.dv)
        ray.t, ray.t_u, ray.t_v = t, t_u, t_v


@small_kernel
def _is_pressed(taxels, ray):
    return 0.0 < ray.s < 2.0 * taxels.thickness[ray.taxel]


@inner_kernel
def leave_sheet(solids, g, rows, taxels, first, last, rays, active):
    """Fill the `rays` of the taxels `first` to `last` that a flat sheet compresses.

    Parameters
    ----------
    solids : Solids
    g : int
        The geom of the sheet.
    rows : (3, 4) array
        Of `fill_sheet`.
    rays : (last - first + 1,) RAY records
        `s` is filled with the compression, `t_u` and `t_v` with the slope there.
    active : (last - first,) array of int
        Filled with the numbers of the rays of compressed taxels.

    Returns
    -------
    int
        The number of these.
    """
    reach, k = solids.reach[g], solids.geometry.texture[solids.geometry.surface[g]]
    count = _fill_rays(rows, reach.highest, taxels, first, last, rays)
    highest, slope, left = reach.highest, reach.slope, 0
    middle = 0.5 * (reach.lowest + reach.highest)
    if k >= 0 and count > 0:
        highest, slope = _bounds_below(solids.textures, k, reach, rays, count)
    for i in range(count):
        ray = rays[i]
        ray.high, ray.low = (highest - ray.gap) / ray.rate, (reach.lowest - ray.gap) / ray.rate
        ray.s, ray.floor, ray.is_read = ray.high, ray.low, k < 0
        ray.t_u = ray.t_v = 0.0
        if k >= 0 and ray.high > 0.0:
            ray.aside = math.sqrt(max(1.0 - ray.rate * ray.rate, 0.0))
            if ray.rate > slope * ray.aside:
                ray.s = min(max((middle - ray.gap) / ray.rate, 0.0), ray.high)
            active[left] = i
            left += 1
    for _ in range(STEPS):
        if left == 0:
            break
        _evaluate(solids.textures, k, rays, active, left)
        going, left = left, 0
        for i in range(going):
            ray = rays[active[i]]
            value = ray.gap + ray.s * ray.rate - ray.t
            if value > 0.0 and ray.s <= 0.0:
                ray.s = -np.inf
                continue
            steep = slope * ray.aside
            search = (ray.rate > steep, reach.bend * ray.aside * ray.aside, ray.rate + steep)
            rise = ray.rate - ray.t_u * ray.du - ray.t_v * ray.dv
            s, ray.low, ray.high, is_found = advance(ray.s, value, rise, ray.low, ray.high, search)
            if is_found:
                ray.is_read = reach.bend * abs(s - ray.s) < _SAME
                ray.s = s
                continue
            ray.s = s
            if ray.s < ray.floor:
                ray.s = -np.inf
                continue
            active[left] = active[i]
            left += 1
    left = pressed = 0
    for i in range(count):
        if not rays[i].is_read and _is_pressed(taxels, rays[i]):
            active[left] = i
            left += 1
    _evaluate(solids.textures, k, rays, active, left)
    for i in range(count):
        if _is_pressed(taxels, rays[i]):
            active[pressed] = i
            pressed += 1
    return pressed


@inner_kernel
def fill_across(ray, gradients, m_out):
    """Fill m = N / (N.d), world axes (3,), at a ray's exit from a flat sheet."""
    rise = max(ray.rate - ray.t_u * ray.du - ray.t_v * ray.dv, GRAZING)
    for i in range(3):
        normal = gradients[2, i] - ray.t_u * gradients[0, i] - ray.t_v * gradients[1, i]
        m_out[i] = normal / rise
