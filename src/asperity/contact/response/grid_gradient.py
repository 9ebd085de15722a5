"""Depths and gradients from samples on a grid, instead of the certified search.

Both start from the deepest point of the search. Central differences are the paper's method; the
soft maximum averages over all points near the deepest one (see `narrow_phase.grid`).
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import clear, inner_kernel
from asperity._core.stack import stack_array
from asperity.contact.narrow_phase.geom_depth import BodyGeoms, DepthQuery
from asperity.contact.narrow_phase.grid import DepthGrid, grid_depth


@inner_kernel
def _rotate_frame(frame, centre, axis, angle, frame_out):
    """Fill a frame (3, 4) rotated about a world axis through `centre` (3,) by an angle [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    one, two = (axis + 1) % 3, (axis + 2) % 3
    for j in range(4):
        shift_one = centre[one] if j == 3 else 0.0
        shift_two = centre[two] if j == 3 else 0.0
        p, q = frame[one, j] - shift_one, frame[two, j] - shift_two
        frame_out[axis, j] = frame[axis, j]
        frame_out[one, j] = c * p - s * q + shift_one
        frame_out[two, j] = s * p + c * q + shift_two


@inner_kernel
def _samples(grid):
    """Return the `DepthGrid` of a method."""
    if grid.soft:
        return DepthGrid(grid.window, grid.grid, grid.beta, grid.soft_area)
    return DepthGrid(grid.window, grid.grid, 0.0, 1.0)


@inner_kernel
def _move_frame(frame, n, axis, step, frame_out):
    """Fill a frame (3, 4) displaced by `step` along a world axis, 0 to 2, or rotated about one.

    Axes 3 to 5 are rotations about the origin by `step` [rad]. Displacements [m] are projected
    perpendicular to n, along which the derivative is known.
    """
    if axis >= 3:
        centre = stack_array((3,))
        clear(centre)
        _rotate_frame(frame, centre, axis - 3, step, frame_out)
        return
    for i in range(3):
        for j in range(4):
            frame_out[i, j] = frame[i, j]
    frame_out[axis, 3] += step
    along = n[axis]
    for i in range(3):
        frame_out[i, 3] -= step * along * n[i]


@inner_kernel
def _central_differences(model, grid, query, workspace, result_io):
    """Replace depth, point and gradient by those of the paper's eleven depths on a grid.

    The first is the depth itself. Two along each axis perpendicular to n, and two about each axis,
    give the gradient; along n it is 1 (Eq. 3). The origin is the tool's centre of mass.
    """
    n, sample, moved = query.normal, stack_array((8,)), stack_array((3, 4))
    samples = _samples(grid)
    moved_tool = BodyGeoms(query.a.geoms, query.a.number, moved, query.a.stretch)
    moved_query = DepthQuery(moved_tool, query.b, n, query.guess)
    grid_depth(model.textures, model.geometry, query, samples, workspace, sample)
    result_io.depth = sample[0]
    if sample[0] == -np.inf:
        return
    for k in range(3):
        result_io.point[k] = sample[1 + k]
    gradient = stack_array((6,))
    for axis in range(6):
        difference = 0.0
        step = grid.step if axis < 3 else grid.step / grid.lever
        for sign in (-1.0, 1.0):
            _move_frame(query.a.frame, n, axis, sign * step, moved)
            grid_depth(model.textures, model.geometry, moved_query, samples, workspace, sample)
            value = sample[0] if sample[0] > -np.inf else result_io.depth
            difference += sign * value
        gradient[axis] = difference / (2.0 * step)
    for k in range(3):
        result_io.slope_normal[k] = n[k] - gradient[k]
        result_io.moment[k] = -gradient[3 + k]


@inner_kernel
def depth_on_grid(model, grid, query, workspace, result_io):
    """Replace a certified depth and its gradient by those of a grid around its point.

    Parameters
    ----------
    model : SceneModel
    grid : GridMethod
    query : DepthQuery
    workspace : Workspace
    result_io : PENETRATION
    """
    if result_io.depth == -np.inf:
        return
    centre, sample = stack_array((3,)), stack_array((8,))
    for k in range(3):
        centre[k] = result_io.point[k]
    centred = DepthQuery(query.a, query.b, query.normal, centre)
    if not grid.soft:
        _central_differences(model, grid, centred, workspace, result_io)
        return
    grid_depth(model.textures, model.geometry, centred, _samples(grid), workspace, sample)
    result_io.depth = sample[0]
    for k in range(3):
        result_io.moment[k], result_io.slope_normal[k] = sample[1 + k], sample[4 + k]
