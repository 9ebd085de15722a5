r"""The highest contact of a sphere on a sampled height map, certified.

The two-dimensional twin of `disk_search`: over a bicubic spline `s(x, y)`, find the maximum of

    f(x, y) = s(x, y) + sqrt(r^2 - (x - u)^2 - (y - v)^2) - r.

All lengths are in samples. A node is a square block of `2**level` cells a side, or, at negative
levels, a square part of one cell. It is bounded twice:

- by the highest coefficient under it plus the sphere's lowest point over it, which costs nothing;
- by the second order. The curvature of the heights over the block is bounded by the pyramid, or,
  if that is less, by the curvature at the middle `c` plus what the third derivatives allow it to
  change; the sphere takes at least `1 / r` off, and what is left, `kappa`, decides. Below zero `f`
  is concave on the whole block, however many cells that is, and the tangent plane at its Newton
  point bounds it; otherwise `f(c) + |grad f(c)| h + kappa h^2 / 2` does.

A node is closed only by such a bound; what cannot be closed is quartered.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import kernel
from asperity.geometry.offsets.disk_search import cap
from asperity.texture.spline import evaluate_2d

_STACK = 512
_NEWTON_STEPS = 20
_LOWEST = -30
# Only where the relief is as tall as the sphere's radius is the rim of its disk ever searched
# this far; f has no finite slope there, so no bound would close the node.
_LOWEST_AT_RIM = -6


@kernel
def _evaluate(coefficients, x, y, u, v, radius):
    """Return f, f_x, f_y, f_xx, f_xy, f_yy at (x, y); -inf outside the sphere's disk."""
    column = min(max(math.floor(x), 0), coefficients.shape[1] - 4)
    row = min(max(math.floor(y), 0), coefficients.shape[0] - 4)
    s, s_x, s_y, s_xx, s_xy, s_yy = evaluate_2d(coefficients, row, column, y - row, x - column)
    dx, dy = x - u, y - v
    inside = radius * radius - dx * dx - dy * dy
    if inside <= 0.0:
        return -np.inf, 0.0, 0.0, 0.0, 0.0, 0.0
    root = math.sqrt(inside)
    cube = inside * root
    return (
        s + root - radius,
        s_x - dx / root,
        s_y - dy / root,
        s_xx - (inside + dx * dx) / cube,
        s_xy - dx * dy / cube,
        s_yy - (inside + dy * dy) / cube,
    )


@kernel
def _climb(coefficients, box, x, y, stride, u, v, radius):
    """Return (value, x, y, f_x, f_y) of a local maximum over a box, climbing from (x, y).

    Projected Newton where f is concave, steepest ascent where it is not; no step is longer than
    `stride`, and none goes down.
    """
    x0, x1, y0, y1 = box
    x, y = min(max(x, x0), x1), min(max(y, y0), y1)
    value, f_x, f_y, f_xx, f_xy, f_yy = _evaluate(coefficients, x, y, u, v, radius)
    for _ in range(_NEWTON_STEPS):
        free_x = not ((x <= x0 and f_x <= 0.0) or (x >= x1 and f_x >= 0.0))
        free_y = not ((y <= y0 and f_y <= 0.0) or (y >= y1 and f_y >= 0.0))
        determinant = f_xx * f_yy - f_xy * f_xy
        if free_x and free_y and f_xx < 0.0 and determinant > 0.0:
            step_x = -(f_yy * f_x - f_xy * f_y) / determinant
            step_y = -(f_xx * f_y - f_xy * f_x) / determinant
        else:
            step_x = (-f_x / f_xx if f_xx < 0.0 else math.copysign(stride, f_x)) if free_x else 0.0
            step_y = (-f_y / f_yy if f_yy < 0.0 else math.copysign(stride, f_y)) if free_y else 0.0
        length = math.sqrt(step_x * step_x + step_y * step_y)
        if length < 1e-13:
            break
        scale = min(1.0, stride / length)
        for _ in range(8):
            next_x = min(max(x + scale * step_x, x0), x1)
            next_y = min(max(y + scale * step_y, y0), y1)
            result = _evaluate(coefficients, next_x, next_y, u, v, radius)
            if result[0] >= value:
                break
            scale *= 0.25
        if result[0] < value:
            break
        x, y = next_x, next_y
        value, f_x, f_y, f_xx, f_xy, f_yy = result
    return value, x, y, f_x, f_y


@kernel
def _surface_bend(f_xx, f_xy, f_yy, dx, dy, radius):
    """Return the largest second derivative of the heights alone, from those of f at (dx, dy)."""
    inside = radius * radius - dx * dx - dy * dy
    cube = inside * math.sqrt(inside)
    xx, yy = f_xx + (inside + dx * dx) / cube, f_yy + (inside + dy * dy) / cube
    xy = f_xy + dx * dy / cube
    half = 0.5 * (xx - yy)
    return 0.5 * (xx + yy) + math.sqrt(half * half + xy * xy)


@kernel
def _size_of(level):
    """Return 2**level, without the cost of a power."""
    return float(1 << level) if level >= 0 else 1.0 / float(1 << -level)


@kernel
def _bound(coefficients, pyramid, level, row, column, u, v, radius, enough):
    """Return (upper bound of f over a node, value, x, y of the best place seen in it).

    Once the bound falls to `enough` it is not sharpened, and no place is looked at.
    """
    size = _size_of(level)
    x0, x1 = column * size, min((column + 1) * size, float(pyramid.shapes[0, 1]))
    y0, y1 = row * size, min((row + 1) * size, float(pyramid.shapes[0, 0]))
    dx, dy = max(x0 - u, u - x1, 0.0), max(y0 - v, v - y1, 0.0)
    near = dx * dx + dy * dy
    down = max(-level, 0)
    level = max(level, 0)
    place = pyramid.offsets[level]
    place += (row >> down) * pyramid.shapes[level, 1] + (column >> down)
    coarse = pyramid.heights[place] + cap(near, radius)
    if coarse <= enough:
        return coarse, -np.inf, u, v
    dx, dy = max(u - x0, x1 - u), max(v - y0, y1 - v)
    if dx * dx + dy * dy >= radius * radius * (1.0 - 1e-9):
        # Part of the node lies beyond the sphere, where f has no slope to bound it by.
        x, y = min(max(u, x0), x1), min(max(v, y0), y1)
        return coarse, _evaluate(coefficients, x, y, u, v, radius)[0], x, y
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    value, f_x, f_y, f_xx, f_xy, f_yy = _evaluate(coefficients, x, y, u, v, radius)
    bend = _surface_bend(f_xx, f_xy, f_yy, x - u, y - v, radius)
    # Each entry of the Hessian changes by at most `change` * (|dx| + |dy|) over the node.
    bend += 2.0 * pyramid.changes[place] * (0.5 * (x1 - x0) + 0.5 * (y1 - y0))
    kappa = min(pyramid.curvatures[place], bend) - 1.0 / math.sqrt(radius * radius - near)
    half_x, half_y = x1 - x, y1 - y
    bound = value + abs(f_x) * half_x + abs(f_y) * half_y
    bound += 0.5 * max(kappa, 0.0) * (half_x * half_x + half_y * half_y)
    if kappa < 0.0 and bound > enough:
        box = (x0, x1, y0, y1)
        value, x, y, f_x, f_y = _climb(coefficients, box, x, y, size, u, v, radius)
        bound = value + max(f_x * (x1 - x), f_x * (x0 - x))
        bound += max(f_y * (y1 - y), f_y * (y0 - y))
    return min(bound, coarse), value, x, y


@kernel
def _may_be_divided(pyramid, level, row, column, u, v, radius):
    """Return whether a node is large enough to be quartered."""
    if level > _LOWEST_AT_RIM:
        return True
    size = _size_of(level)
    dx = max(u - column * size, (column + 1) * size - u)
    dy = max(v - row * size, (row + 1) * size - v)
    return level > _LOWEST and dx * dx + dy * dy < radius * radius * (1.0 - 1e-9)


@kernel
def search(coefficients, pyramid, u, v, radius, tolerance, guess_x, guess_y, nodes, bounds):
    """Return (offset height, x, y of the contact) in samples, for a sphere above (u, v).

    Parameters
    ----------
    coefficients : (nv + 4 + 2 margin, nu + 4 + 2 margin) array
        Spline coefficients, padded by at least `radius + 1` cells; divided by the pixel size.
    pyramid : Pyramid
        Of those coefficients.
    u, v : float
        Place of the sphere's centre [samples], counted from the first cell's start.
    tolerance : float
        The result is at most this far below the true maximum [samples].
    guess_x, guess_y : float
        A place to start from; the last contact, say.
    nodes, bounds : (512, 3) int64 and (512,) float64 arrays
        Working memory.
    """
    rows, columns = float(pyramid.shapes[0, 0]), float(pyramid.shapes[0, 1])
    centre = _evaluate(coefficients, u, v, u, v, radius)[0]
    if _evaluate(coefficients, guess_x, guess_y, u, v, radius)[0] < centre:
        guess_x, guess_y = u, v
    box = (0.0, columns, 0.0, rows)
    stride = max(1.0, 0.1 * radius)
    value, x, y, _, _ = _climb(coefficients, box, guess_x, guess_y, stride, u, v, radius)
    best = (value, x, y)
    nodes[0, 0], nodes[0, 1], nodes[0, 2] = pyramid.offsets.size - 1, 0, 0
    bounds[0] = np.inf
    top = 1
    while top > 0:
        top -= 1
        if bounds[top] <= best[0] + tolerance:
            continue
        level, row, column = nodes[top, 0], nodes[top, 1], nodes[top, 2]
        if not _may_be_divided(pyramid, level, row, column, u, v, radius):
            continue
        level -= 1
        half = _size_of(level)
        start = top
        for k in range(4):
            r, c = 2 * row + (k >> 1), 2 * column + (k & 1)
            if r * half >= rows or c * half >= columns:
                continue
            enough = best[0] + tolerance
            bound, value, x, y = _bound(coefficients, pyramid, level, r, c, u, v, radius, enough)
            if value > best[0]:
                best = (value, x, y)
            if bound <= best[0] + tolerance:
                continue
            # Insertion keeps the most promising child on top of the stack.
            place = top
            while place > start and bounds[place - 1] > bound:
                bounds[place] = bounds[place - 1]
                for axis in range(3):
                    nodes[place, axis] = nodes[place - 1, axis]
                place -= 1
            bounds[place] = bound
            nodes[place, 0], nodes[place, 1], nodes[place, 2] = level, r, c
            top += 1
    # The search ends within the tolerance of the maximum; the slope wants its very place.
    value, x, y, _, _ = _climb(coefficients, box, best[1], best[2], 1.0, u, v, radius)
    return value, x, y


@kernel
def search_many(
    coefficients, pyramid, places_u, places_v, radius, tolerance, heights_out, contacts_out
):
    """Fill the offset height and the contact's x and y for every place; see `search`."""
    nodes = np.empty((_STACK, 3), dtype=np.int64)
    bounds = np.empty(_STACK)
    shift_x = shift_y = 0.0
    for i in range(places_u.size):
        u, v = places_u[i], places_v[i]
        height, x, y = search(
            coefficients, pyramid, u, v, radius, tolerance,
            u + shift_x, v + shift_y, nodes, bounds,
        )  # fmt: skip
        heights_out[i] = height
        contacts_out[i, 0], contacts_out[i, 1] = x, y
        shift_x, shift_y = x - u, y - v
