"""Body frames and directions in small arrays, for the kernels of a tick.

A frame is an array (3, 4): the rotation matrix, whose columns are the body's axes, and the
position of its origin [m].
"""

from __future__ import annotations

import math

from asperity._core.kernels import clear, inner_kernel
from asperity.geometry.rigid_body import fill_rotation


@inner_kernel
def fill_tool_frame(pose, centre, frame_out, centre_out):
    """Fill the tool's frame (3, 4) at a pose (7,), and its centre of mass (3,) in world axes."""
    fill_rotation(pose, frame_out)
    for i in range(3):
        frame_out[i, 3] = centre_out[i] = pose[i]
        for k in range(3):
            centre_out[i] += frame_out[i, k] * centre[k]


@inner_kernel
def fill_relative_frame(origin, frame, frame_out):
    """Fill a frame (3, 4) whose position is relative to `origin` (3,); the axes stay."""
    for i in range(3):
        for j in range(3):
            frame_out[i, j] = frame[i, j]
        frame_out[i, 3] = frame[i, 3] - origin[i]


@inner_kernel
def to_body(frame, v, out):
    """Fill the components in a body's axes of a vector (3,) given in world axes."""
    for i in range(3):
        out[i] = frame[0, i] * v[0] + frame[1, i] * v[1] + frame[2, i] * v[2]


@inner_kernel
def to_world(frame, v, out):
    """Fill the components in world axes of a vector (3,) given in a body's axes."""
    for i in range(3):
        out[i] = frame[i, 0] * v[0] + frame[i, 1] * v[1] + frame[i, 2] * v[2]


@inner_kernel
def fill_origin(frame, out):
    """Fill the origin (3,) of the world in a body's frame [m]."""
    for i in range(3):
        out[i] = 0.0
        for k in range(3):
            out[i] -= frame[k, i] * frame[k, 3]


@inner_kernel
def add_to_world(frame, halves, out_io):
    """Add to two vectors in world axes, (6,), two that are given in a body's axes, (6,)."""
    for part in range(0, 6, 3):
        x, y, z = halves[part], halves[part + 1], halves[part + 2]
        for i in range(3):
            out_io[part + i] += frame[i, 0] * x + frame[i, 1] * y + frame[i, 2] * z


@inner_kernel
def depth_tolerance(textures, geometry, surfaces, wanted):
    """Return the gap between bounds at which a depth counts as certified [m].

    `wanted` if positive; otherwise a thousandth of the rms height of the textures of two
    `surfaces` together.
    """
    if wanted > 0.0:
        return wanted
    square = 0.0
    for surface in surfaces:
        if geometry.texture[surface] >= 0:
            square += textures.maps[geometry.texture[surface]].rms ** 2
    return max(1e-9, 1e-3 * math.sqrt(square))


@inner_kernel
def material_displacement(known, last, frame, point, origin, displacement_out):
    """Fill the displacement (3,) since the last tick of the tool's material at a point [m].

    `last` (3, 4) is the tool's frame one tick before; if it is not `known`, the displacement is
    zero. `point` (3,) is relative to `origin` (3,).
    """
    if not known:
        clear(displacement_out)
        return
    for i in range(3):
        displacement_out[i] = point[i] + origin[i] - last[i, 3]
    for k in range(3):
        local = 0.0
        for i in range(3):
            local += frame[i, k] * (point[i] + origin[i] - frame[i, 3])
        for i in range(3):
            displacement_out[i] -= last[i, k] * local
