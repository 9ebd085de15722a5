"""Other ways to a force: depths on a grid, and laws that look at one point of the texture."""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import clear, inner_kernel
from asperity._core.stack import stack_array
from asperity.contact.narrow_phase.geom_depth import BodyGeoms, DepthQuery, smooth_texture_under
from asperity.contact.narrow_phase.grid import DepthGrid, grid_depth
from asperity.contact.response.point_laws import (
    SIIRA_PAI,
    filter_noise,
    noise_across,
    textured_point_force,
)


@inner_kernel
def _turned(body, centre, axis, angle, out):
    """Fill a body's pose turned about an axis of world through `centre` by a small angle."""
    c, s = math.cos(angle), math.sin(angle)
    one, two = (axis + 1) % 3, (axis + 2) % 3
    for j in range(4):
        shift_one = centre[one] if j == 3 else 0.0
        shift_two = centre[two] if j == 3 else 0.0
        p, q = body[one, j] - shift_one, body[two, j] - shift_two
        out[axis, j] = body[axis, j]
        out[one, j] = c * p - s * q + shift_one
        out[two, j] = s * p + c * q + shift_two


@inner_kernel
def _differences(textures, geometry, query, grid, space, out):
    """Fill depth, point, m and point x m by the paper's eleven depths on a grid.

    The first is the depth itself; two along each axis across n and about each axis give the
    gradient, and along n it is 1 (Eq. 3). The origin is the tool's centre of mass.
    """
    sample, n, body_a = stack_array((8,)), query.normal, query.a.frame
    samples = DepthGrid(grid.window, grid.grid, 0.0, 1.0)
    grid_depth(textures, geometry, query, samples, space, sample)
    out.depth = sample[0]
    if sample[0] == -np.inf:
        return
    for k in range(3):
        out.point[k] = sample[1 + k]
    moved = stack_array((3, 4))
    body = BodyGeoms(query.a.geoms, query.a.number, moved)
    moved_query = DepthQuery(body, query.b, n, query.guess)
    centre, gradient, turn = stack_array((3,)), stack_array((3,)), stack_array((3,))
    clear(centre)
    for axis in range(6):
        difference = 0.0
        step = grid.step if axis < 3 else grid.step / grid.lever
        for sign in (-1.0, 1.0):
            if axis < 3:
                for i in range(3):
                    for j in range(4):
                        moved[i, j] = body_a[i, j]
                moved[axis, 3] += sign * step
                along = n[axis]
                for i in range(3):
                    # Across n only: along it the derivative is known.
                    moved[i, 3] -= sign * step * along * n[i]
            else:
                _turned(body_a, centre, axis - 3, sign * step, moved)
            grid_depth(textures, geometry, moved_query, samples, space, sample)
            value = sample[0] if sample[0] > -np.inf else out.depth
            difference += sign * value
        if axis < 3:
            gradient[axis] = difference / (2.0 * step)
        else:
            turn[axis - 3] = difference / (2.0 * step)
    for k in range(3):
        out.slope_normal[k] = n[k] - gradient[k]
        out.moment[k] = -turn[k]


@inner_kernel
def depth_on_grid(textures, geometry, query, grid, space, out):
    """Replace a certified depth and its gradient by those of a grid round its place."""
    if out.depth == -np.inf:
        return
    centre = stack_array((3,))
    for k in range(3):
        centre[k] = out.point[k]
    query = DepthQuery(query.a, query.b, query.normal, centre)
    if not grid.soft:
        _differences(textures, geometry, query, grid, space, out)
        return
    sample = stack_array((8,))
    samples = DepthGrid(grid.window, grid.grid, grid.beta, grid.soft_area)
    grid_depth(textures, geometry, query, samples, space, sample)
    out.depth = sample[0]
    for k in range(3):
        out.moment[k], out.slope_normal[k] = sample[1 + k], sample[4 + k]


@inner_kernel
def advance_noise(state, baseline, dt):
    """Draw the next values of Siira & Pai's noise, once a tick."""
    if baseline.law == SIIRA_PAI:
        filter_noise(state, math.exp(-2.0 * math.pi * baseline.noise_bandwidth * dt))


@inner_kernel
def baseline_force(
    textures, geometry, memory, count_b, body_b, n, place, moved, push, depth, baseline,
    space, force_out,
):  # fmt: skip
    """Fill the force of a baseline, from B's texture under the smooth tool's deepest place."""
    gradient, noise = stack_array((3,)), stack_array((3,))
    clear(gradient)
    clear(noise)
    height = 0.0
    if baseline.law == SIIRA_PAI:
        along = moved[0] * n[0] + moved[1] * n[1] + moved[2] * n[2]
        slid = moved[0] ** 2 + moved[1] ** 2 + moved[2] ** 2 - along * along
        if slid > 1e-24:
            noise_across(memory.noise, n, baseline.noise_level, noise)
    else:
        height = smooth_texture_under(
            textures, geometry, BodyGeoms(memory.geoms[1], count_b, body_b), n, place, space,
            gradient,
        )  # fmt: skip
    textured_point_force(
        baseline.law, push, n, gradient, height, depth, baseline.ho_gain, noise, force_out
    )
