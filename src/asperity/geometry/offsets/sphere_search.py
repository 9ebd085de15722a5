r"""The highest contact of a sphere on a sampled height map, certified by branch and bound.

The two-dimensional counterpart of `disk_search`: over a bicubic spline `s(x, y)`, find the maximum
of

    f(x, y) = s(x, y) + sqrt(r^2 - (x - u)^2 - (y - v)^2) - r.

All lengths are in samples. A node is a square block of `2**level` cells a side or, at negative
levels, a square part of one cell. It has two bounds:

- the highest coefficient under it plus the sphere's height over its nearest point, which needs no
  evaluation;
- a second-order bound. The curvature of the heights over the block is bounded by the pyramid or, if
  that is less, by the curvature at the middle `c` plus the change that the third derivatives allow.
  The sphere subtracts at least `1 / r`; the difference is `kappa`. If it is negative, `f` is
  concave on the whole block, however many cells that is, and the tangent plane at its maximum
  bounds it; otherwise `f(c) + |grad f(c)| h + kappa h^2 / 2` does.

A node is pruned only by such a bound; all others are quartered.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from asperity._core.kernels import inner_kernel, kernel
from asperity.geometry.offsets.disk_search import cap
from asperity.texture.spline import evaluate_2d

_NEWTON_STEPS = 20
_LOWEST = -30
"""Level below which a node is not divided."""
_LOWEST_AT_RIM = -6
"""The same for nodes at the rim of the sphere's disk, where the slope of f is infinite, so that no
bound prunes them. They matter only where the relief is as tall as the sphere's radius."""
STACK_SIZE = 512
"""Nodes that a search keeps at most."""
NODE = np.dtype([
    ("level", np.int64), ("row", np.int64), ("column", np.int64), ("bound", np.float64),
])  # fmt: skip
"""A node of the search and the upper bound of f over it [samples]."""


class Sphere(NamedTuple):
    """A sphere above a height map; all in samples."""

    u: float
    """Of its centre, counted from the start of the first cell."""
    v: float
    """Of its centre."""
    radius: float


class Block(NamedTuple):
    """A square block of `2**level` cells a side."""

    level: int
    row: int
    column: int


@kernel
def _evaluate(coefficients, x, y, sphere):
    """Return f, f_x, f_y, f_xx, f_xy, f_yy at (x, y); -inf outside the sphere's disk."""
    u, v, radius = sphere
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


@inner_kernel
def _newton_ascent(coefficients, box, x, y, stride, sphere):
    """Return (value, x, y, f_x, f_y) of a local maximum over a box, starting from (x, y).

    Projected Newton steps where f is concave, steepest ascent elsewhere; no step is longer than
    `stride`, and none decreases f.
    """
    x0, x1, y0, y1 = box
    x, y = min(max(x, x0), x1), min(max(y, y0), y1)
    value, f_x, f_y, f_xx, f_xy, f_yy = _evaluate(coefficients, x, y, sphere)
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
            result = _evaluate(coefficients, next_x, next_y, sphere)
            if result[0] >= value:
                break
            scale *= 0.25
        if result[0] < value:
            break
        x, y = next_x, next_y
        value, f_x, f_y, f_xx, f_xy, f_yy = result
    return value, x, y, f_x, f_y


@inner_kernel
def _height_curvature(f_xx, f_xy, f_yy, dx, dy, radius):
    """Return the largest second derivative of the heights, from those of f at (dx, dy)."""
    inside = radius * radius - dx * dx - dy * dy
    cube = inside * math.sqrt(inside)
    xx, yy = f_xx + (inside + dx * dx) / cube, f_yy + (inside + dy * dy) / cube
    xy = f_xy + dx * dy / cube
    half = 0.5 * (xx - yy)
    return 0.5 * (xx + yy) + math.sqrt(half * half + xy * xy)


@inner_kernel
def _size_of(level):
    """Return 2**level by a shift."""
    return float(1 << level) if level >= 0 else 1.0 / float(1 << -level)


@kernel
def _bound(coefficients, pyramid, block, sphere, enough):
    """Return (upper bound of f over a block; value, x, y of the highest point found in it).

    A bound of at most `enough` is not tightened, and no point is evaluated.
    """
    level, row, column = block
    u, v, radius = sphere
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
        # Part of the block lies beyond the sphere, where f is undefined.
        x, y = min(max(u, x0), x1), min(max(v, y0), y1)
        return coarse, _evaluate(coefficients, x, y, sphere)[0], x, y
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    value, f_x, f_y, f_xx, f_xy, f_yy = _evaluate(coefficients, x, y, sphere)
    curvature = _height_curvature(f_xx, f_xy, f_yy, x - u, y - v, radius)
    # Each entry of the Hessian changes by at most `changes` * (|dx| + |dy|) over the block.
    curvature += 2.0 * pyramid.changes[place] * (0.5 * (x1 - x0) + 0.5 * (y1 - y0))
    kappa = min(pyramid.curvatures[place], curvature) - 1.0 / math.sqrt(radius * radius - near)
    half_x, half_y = x1 - x, y1 - y
    bound = value + abs(f_x) * half_x + abs(f_y) * half_y
    bound += 0.5 * max(kappa, 0.0) * (half_x * half_x + half_y * half_y)
    if kappa < 0.0 and bound > enough:
        box = (x0, x1, y0, y1)
        value, x, y, f_x, f_y = _newton_ascent(coefficients, box, x, y, size, sphere)
        bound = value + max(f_x * (x1 - x), f_x * (x0 - x))
        bound += max(f_y * (y1 - y), f_y * (y0 - y))
    return min(bound, coarse), value, x, y


@inner_kernel
def _can_be_divided(block, sphere):
    """Return whether a block is large enough to be quartered."""
    level, row, column = block
    u, v, radius = sphere
    if level > _LOWEST_AT_RIM:
        return True
    size = _size_of(level)
    dx = max(u - column * size, (column + 1) * size - u)
    dy = max(v - row * size, (row + 1) * size - v)
    return level > _LOWEST and dx * dx + dy * dy < radius * radius * (1.0 - 1e-9)


@kernel
def _put(node, block, bound):
    """Store a block and its bound in a node."""
    node.level, node.row, node.column = block
    node.bound = bound


@kernel
def search(coefficients, pyramid, sphere, tolerance, guess, stack):
    """Return (offset height, x, y of the contact) in samples.

    Parameters
    ----------
    coefficients : (nv + 4 + 2 margin, nu + 4 + 2 margin) array
        Spline coefficients, padded by at least `radius + 1` cells; divided by the pixel size.
    pyramid : Pyramid
        Bounds of those coefficients.
    sphere : Sphere
    tolerance : float
        The result is at most this far below the true maximum [samples].
    guess : (float, float)
        Starting point (x, y) [samples], for example the previous contact.
    stack : (STACK_SIZE,) array of NODE
        Working memory.
    """
    guess_x, guess_y = guess
    rows, columns = float(pyramid.shapes[0, 0]), float(pyramid.shapes[0, 1])
    centre = _evaluate(coefficients, sphere.u, sphere.v, sphere)[0]
    if _evaluate(coefficients, guess_x, guess_y, sphere)[0] < centre:
        guess_x, guess_y = sphere.u, sphere.v
    box = (0.0, columns, 0.0, rows)
    stride = max(1.0, 0.1 * sphere.radius)
    value, x, y, _, _ = _newton_ascent(coefficients, box, guess_x, guess_y, stride, sphere)
    best = (value, x, y)
    _put(stack[0], Block(pyramid.offsets.size - 1, 0, 0), np.inf)
    top = 1
    while top > 0:
        top -= 1
        if stack[top].bound <= best[0] + tolerance:
            continue
        level, row, column = stack[top].level, stack[top].row, stack[top].column
        if not _can_be_divided(Block(level, row, column), sphere):
            continue
        level -= 1
        half = _size_of(level)
        start = top
        for k in range(4):
            r, c = 2 * row + (k >> 1), 2 * column + (k & 1)
            if r * half >= rows or c * half >= columns:
                continue
            enough, child = best[0] + tolerance, Block(level, r, c)
            bound, value, x, y = _bound(coefficients, pyramid, child, sphere, enough)
            if value > best[0]:
                best = (value, x, y)
            if bound <= best[0] + tolerance:
                continue
            # Sorted insertion keeps the child with the highest bound on top of the stack.
            place = top
            while place > start and stack[place - 1].bound > bound:
                below = stack[place - 1]
                _put(stack[place], Block(below.level, below.row, below.column), below.bound)
                place -= 1
            _put(stack[place], child, bound)
            top += 1
    # The search ends within the tolerance of the maximum; the slope needs its exact position.
    value, x, y, _, _ = _newton_ascent(coefficients, box, best[1], best[2], 1.0, sphere)
    return value, x, y


@kernel
def search_many(
    coefficients, pyramid, places_u, places_v, radius, tolerance, heights_out, contacts_out
):
    """Fill the offset height and the contact's x and y above every (u, v); see `search`."""
    stack = np.empty(STACK_SIZE, NODE)
    shift_x = shift_y = 0.0
    for i in range(places_u.size):
        u, v = places_u[i], places_v[i]
        height, x, y = search(
            coefficients, pyramid, Sphere(u, v, radius), tolerance, (u + shift_x, v + shift_y),
            stack,
        )  # fmt: skip
        heights_out[i] = height
        contacts_out[i, 0], contacts_out[i, 1] = x, y
        shift_x, shift_y = x - u, y - v
