"""Depth from samples on a grid, as Otaduy and Lin (2004) compute it, and its soft maximum.

They render both surfaces along n on a grid, take the largest overlap of the samples, and the
gradient by central differences: eleven renderings. The *soft maximum*

    delta_soft = (1 / beta) log( (1 / A0) integral of exp(beta d) dA )

with a fixed reference area A0 weights all points near the deepest. Its gradient is the mean of
theirs with the weights exp(beta d); A's slope counts at each (u, v), since these stay with B.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from asperity._core.kernels import clear, inner_kernel
from asperity._core.stack import stack_array
from asperity.contact.narrow_phase.displaced_surface import height_at
from asperity.contact.narrow_phase.geom_depth import fill_facing_patches
from asperity.contact.narrow_phase.smooth_base import root_at


@inner_kernel
def _is_within(patch, x, y):
    """Return whether (x, y) is within a patch."""
    if x < patch.rectangle[0] or x > patch.rectangle[1]:
        return False
    if y < patch.rectangle[2] or y > patch.rectangle[3]:
        return False
    r = root_at(patch, x, y)[0] if patch.bulge > 0.0 else 1.0
    for i in range(patch.border_count):
        border = patch.borders[i]
        g = border.constant + border.from_x * x + border.from_y * y + border.from_root * r
        if not g + border.from_square * (x * x + y * y) <= 0.0:
            return False
    return True


@inner_kernel
def _highest_patch(textures, patches, count, u, v, point):
    """Return the height over (u, v) of the highest of some patches, and its slopes."""
    best, best_u, best_v = -np.inf, 0.0, 0.0
    for i in range(count):
        z, g1, g2, _, _, _, x, y = height_at(textures, patches[i], u, v, point)
        if z > best and _is_within(patches[i], x, y):
            best, best_u, best_v = z, g1, g2
    return best, best_u, best_v


class DepthGrid(NamedTuple):
    """A square grid of samples, and the parameters of the depth computed from it."""

    window: float
    """Side of the square [m]."""
    samples: int
    """Samples per side."""
    beta: float
    """Sharpness of the soft maximum [1/m]; 0: the deepest sample."""
    area: float
    """Reference area A0 of the soft maximum [m^2]."""


@inner_kernel
def grid_depth(textures, geometry, query, grid, memory, result_out):
    """Fill `result_out` (8,) with a depth from samples on a grid.

    The grid, a `DepthGrid`, is centred at `query.guess`. Filled are the depth [m] (-inf if nothing
    overlaps along n), the deepest sample's point (3,) on A and m (3,); for the soft maximum the
    mean of point x m and the mean m. Last is the number of samples at which both have a surface.
    """
    frame, n, centre = stack_array((3, 3)), query.normal, query.guess
    made_a, made_b = fill_facing_patches(geometry, query, frame, memory)
    window, beta = grid.window, grid.beta
    cu = frame[0, 0] * centre[0] + frame[0, 1] * centre[1] + frame[0, 2] * centre[2]
    cv = frame[1, 0] * centre[0] + frame[1, 1] * centre[1] + frame[1, 2] * centre[2]
    point = memory.search[0].surface
    pitch = window / grid.samples
    clear(result_out)
    best = -np.inf
    total, count = 0.0, 0
    p, m, mean, moment = stack_array((3,)), stack_array((3,)), stack_array((3,)), stack_array((3,))
    clear(mean)
    clear(moment)
    for i in range(grid.samples):
        for j in range(grid.samples):
            u = cu + (i + 0.5) * pitch - 0.5 * window
            v = cv + (j + 0.5) * pitch - 0.5 * window
            a, a_u, a_v = _highest_patch(textures, memory.patches_a, made_a, u, v, point)
            if a == -np.inf:
                continue
            b, b_u, b_v = _highest_patch(textures, memory.patches_b, made_b, u, v, point)
            d = a + b
            if d == -np.inf:
                continue
            count += 1
            if beta == 0.0:
                if d > best:
                    best = d
                    for k in range(3):
                        result_out[1 + k] = frame[0, k] * u + frame[1, k] * v - n[k] * a
                        result_out[4 + k] = n[k] - b_u * frame[0, k] - b_v * frame[1, k]
                continue
            if d > best:
                scale = math.exp(beta * (best - d)) if total > 0.0 else 0.0
                total *= scale
                for k in range(3):
                    mean[k] *= scale
                    moment[k] *= scale
                best = d
            weight = math.exp(beta * (d - best))
            total += weight
            for k in range(3):
                p[k] = frame[0, k] * u + frame[1, k] * v - n[k] * a
                # A's own z points down: its slope over (u, v) along n has the other sign.
                m[k] = n[k] + a_u * frame[0, k] + a_v * frame[1, k]
            for k in range(3):
                one, two = (k + 1) % 3, (k + 2) % 3
                mean[k] += weight * m[k]
                moment[k] += weight * (p[one] * m[two] - p[two] * m[one])
    result_out[0], result_out[7] = best, count
    if beta > 0.0 and total > 0.0:
        result_out[0] = best + math.log(total * pitch * pitch / grid.area) / beta
        for k in range(3):
            result_out[1 + k], result_out[4 + k] = moment[k] / total, mean[k] / total
