"""Directions and poses in small arrays, for the kernels of a tick."""

from __future__ import annotations

import math

from asperity._core.kernels import clear, inner_kernel
from asperity.geometry.rigid_body import fill_rotation


@inner_kernel
def place_tool(pose, centre, body_out, origin_out):
    """Fill the tool's rotation and position (3, 4), and its centre of mass (3,) in world axes."""
    fill_rotation(pose, body_out)
    for i in range(3):
        body_out[i, 3] = origin_out[i] = pose[i]
        for k in range(3):
            origin_out[i] += body_out[i, k] * centre[k]


@inner_kernel
def seen_from(origin, body, near_out):
    """Fill a body's rotation and its position as seen from a place (3, 4)."""
    for i in range(3):
        for j in range(3):
            near_out[i, j] = body[i, j]
        near_out[i, 3] = body[i, 3] - origin[i]


@inner_kernel
def into(body, v, out):
    """Fill a direction (3,) of world axes in a body's frame."""
    for i in range(3):
        out[i] = body[0, i] * v[0] + body[1, i] * v[1] + body[2, i] * v[2]


@inner_kernel
def out_of(body, v, out):
    """Fill a direction (3,) of a body's frame in world axes."""
    for i in range(3):
        out[i] = body[i, 0] * v[0] + body[i, 1] * v[1] + body[i, 2] * v[2]


@inner_kernel
def tolerance_for(textures, geometry, a, b, wanted):
    """Return the gap that counts as certified: a thousandth of the overlap's rms height."""
    if wanted > 0.0:
        return wanted
    square = 0.0
    for body in (a, b):
        if geometry.texture[body] >= 0:
            square += textures.scales[geometry.texture[body], 5] ** 2
    return max(1e-9, 1e-3 * math.sqrt(square))


@inner_kernel
def slid(known, last, body_a, point, origin, moved_out):
    """Fill how far the tool's material at `point` has moved since the last tick.

    `last` (3, 4) is the tool's last pose, if `known`; `point` is seen from `origin`.
    """
    if not known:
        clear(moved_out)
        return
    for i in range(3):
        moved_out[i] = point[i] + origin[i] - last[i, 3]
    for k in range(3):
        local = 0.0
        for i in range(3):
            local += body_a[i, k] * (point[i] + origin[i] - body_a[i, 3])
        for i in range(3):
            moved_out[i] -= last[i, k] * local
