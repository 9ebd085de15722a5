r"""Depth on a grid: the paper's way, and the soft maximum.

The paper draws both surfaces along n on a grid, takes the largest overlap of the samples, and
the gradient by central differences: eleven drawings. The *soft maximum*

    delta_soft = (1 / beta) log( (1 / A0) integral of exp(beta d) dA )

with a fixed reference area A0 weighs all places near the deepest; its gradient is the mean of
theirs with the weights exp(beta d), A's slope counting at each place (u, v), since these stay
with B.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import clear, inner_kernel
from asperity._core.stack import stack_array
from asperity.contact.narrow_phase.displaced_surface import POINT_SIZE, height_at, root_at
from asperity.contact.narrow_phase.geom_depth import all_charts, frame_round
from asperity.contact.narrow_phase.surface_patch import RECTANGLE, ROWS, C


@inner_kernel
def _within(chart, x, y):
    """Return whether a place lies within a chart's borders."""
    if x < chart[RECTANGLE] or x > chart[RECTANGLE + 1]:
        return False
    if y < chart[RECTANGLE + 2] or y > chart[RECTANGLE + 3]:
        return False
    r = root_at(chart, x, y)[0] if chart[C] > 0.0 else 1.0
    for i in range(int(chart[ROWS])):
        row = ROWS + 1 + 6 * i
        g = chart[row] + chart[row + 1] * x + chart[row + 2] * y + chart[row + 3] * r
        if not g + chart[row + 4] * (x * x + y * y) <= 0.0:
            return False
    return True


@inner_kernel
def _highest(textures, charts, count, u, v, work):
    """Return the height over (u, v) of the highest of some charts, and its slopes."""
    best, best_u, best_v = -np.inf, 0.0, 0.0
    for i in range(count):
        z, g1, g2, _, _, _, x, y = height_at(textures, charts[i], u, v, work)
        if z > best and _within(charts[i], x, y):
            best, best_u, best_v = z, g1, g2
    return best, best_u, best_v


@inner_kernel
def grid_depth(
    textures, geometry, geoms_a, count_a, geoms_b, count_b, body_a, body_b, n, centre, window,
    grid, beta, area, space, result_out,
):  # fmt: skip
    """Fill `result_out` (8,) with a depth from samples on a grid.

    `centre` (3,), seen from the origin of the contact, is the middle of the square of side
    `window` [m] with `grid` samples a side. With `beta` = 0 the depth is that of the deepest
    sample; else it is the soft maximum with the reference area `area` [m^2]. Left are: depth [m],
    (-inf if nothing overlaps along n), the deepest sample's place (3,) on A and m (3,); for the
    soft maximum, mean m and, in the place's stead, mean place x m. Last the number of samples
    that counted.
    """
    frame = stack_array((3, 3))
    frame_round(n, frame)
    made_b = all_charts(geometry, geoms_b, count_b, frame, body_b, space.charts_b)
    for i in range(3):
        frame[2, i] = -n[i]
    made_a = all_charts(geometry, geoms_a, count_a, frame, body_a, space.charts_a)
    cu = frame[0, 0] * centre[0] + frame[0, 1] * centre[1] + frame[0, 2] * centre[2]
    cv = frame[1, 0] * centre[0] + frame[1, 1] * centre[1] + frame[1, 2] * centre[2]
    work = stack_array((POINT_SIZE,))
    pitch = window / grid
    clear(result_out)
    best = -np.inf
    total, count = 0.0, 0
    p, m, mean, moment = stack_array((3,)), stack_array((3,)), stack_array((3,)), stack_array((3,))
    clear(mean)
    clear(moment)
    for i in range(grid):
        for j in range(grid):
            u = cu + (i + 0.5) * pitch - 0.5 * window
            v = cv + (j + 0.5) * pitch - 0.5 * window
            a, a_u, a_v = _highest(textures, space.charts_a, made_a, u, v, work)
            if a == -np.inf:
                continue
            b, b_u, b_v = _highest(textures, space.charts_b, made_b, u, v, work)
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
        result_out[0] = best + math.log(total * pitch * pitch / area) / beta
        for k in range(3):
            result_out[1 + k], result_out[4 + k] = moment[k] / total, mean[k] / total
