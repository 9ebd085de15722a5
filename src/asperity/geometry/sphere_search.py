r"""The highest contact of a sphere on a sampled height map, certified.

The two-dimensional twin of `disk_search`: over a bicubic spline `s(x, y)`, find the maximum of

    f(x, y) = s(x, y) + sqrt(r^2 - (x - u)^2 - (y - v)^2) - r.

All lengths are in samples. Blocks of cells are bounded by the pyramid plus the sphere's lowest
point over the block. Inside a cell the surface's second differences bound its Hessian
(Gershgorin), the sphere takes at least `1 / r` off, and what is left, `kappa`, decides: below
zero `f` is concave on the cell, so the tangent plane at the Newton point bounds it; otherwise
`f(c) + |grad f(c)| h + kappa h^2 / 2` from the middle of the box does. A box is closed only by
such a bound; what cannot be closed is quartered.
"""

from __future__ import annotations

import math

import numpy as np

from asperity.compiled import kernel
from asperity.geometry.disk_search import cap
from asperity.texture.spline import evaluate_2d

_STACK = 512
_NEWTON_STEPS = 20
_SMALLEST = 1e-9
# Only where the relief is as tall as the sphere's radius is the rim of its disk ever searched
# this far; f has no finite slope there, so no bound would close the box.
_SMALLEST_AT_RIM = 1.0 / 64.0


@kernel
def _evaluate(coefficients, x, y, u, v, radius):
    """Return f, f_x, f_y, f_xx, f_xy, f_yy at (x, y); -inf outside the sphere's disk."""
    column = min(max(int(math.floor(x)), 0), coefficients.shape[1] - 4)
    row = min(max(int(math.floor(y)), 0), coefficients.shape[0] - 4)
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
def _climb(coefficients, box, x, y, u, v, radius):
    """Return (value, x, y, f_x, f_y) of a local maximum over a box, climbing from (x, y).

    Projected Newton where f is concave, steepest ascent of at most a sample where it is not,
    and no step that goes down.
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
            step_x = (-f_x / f_xx if f_xx < 0.0 else math.copysign(1.0, f_x)) if free_x else 0.0
            step_y = (-f_y / f_yy if f_yy < 0.0 else math.copysign(1.0, f_y)) if free_y else 0.0
        length = math.sqrt(step_x * step_x + step_y * step_y)
        if length < 1e-13:
            break
        scale = min(1.0, 1.0 / length)
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
def hessian_ceiling(coefficients, row, column):
    """Return a bound from above on the largest eigenvalue of the surface's Hessian over a cell.

    Along each axis the second derivative lies in the hull of the second differences of the
    cell's 4 x 4 coefficients; the mixed one in the hull of the 3 x 3 mixed differences.
    """
    xx = yy = -np.inf
    xy = 0.0
    for a in range(4):
        for b in range(2):
            c = coefficients[row + a]
            xx = max(xx, c[column + b] - 2.0 * c[column + b + 1] + c[column + b + 2])
            yy = max(
                yy,
                coefficients[row + b, column + a]
                - 2.0 * coefficients[row + b + 1, column + a]
                + coefficients[row + b + 2, column + a],
            )
    for a in range(3):
        c, d = coefficients[row + a], coefficients[row + a + 1]
        for b in range(3):
            mixed = d[column + b + 1] - d[column + b] - c[column + b + 1] + c[column + b]
            xy = max(xy, abs(mixed))
    return max(xx, yy) + xy


@kernel
def _box_bound(coefficients, box, surface, highest, u, v, radius):
    """Return (upper bound of f over a box, value, x, y of its best known place).

    `surface` bounds the curvature of the heights over the box's cell, `highest` the heights.
    """
    x0, x1, y0, y1 = box
    dx, dy = max(x0 - u, u - x1, 0.0), max(y0 - v, v - y1, 0.0)
    near = dx * dx + dy * dy
    coarse = highest + cap(near, radius)
    dx, dy = max(u - x0, x1 - u), max(v - y0, y1 - v)
    if dx * dx + dy * dy >= radius * radius * (1.0 - 1e-9):
        x, y = min(max(u, x0), x1), min(max(v, y0), y1)
        return coarse, _evaluate(coefficients, x, y, u, v, radius)[0], x, y
    ceiling = surface - 1.0 / math.sqrt(radius * radius - near)
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    if ceiling < 0.0:
        value, x, y, f_x, f_y = _climb(coefficients, box, x, y, u, v, radius)
    else:
        value, f_x, f_y, _, _, _ = _evaluate(coefficients, x, y, u, v, radius)
    half_x, half_y = max(x1 - x, x - x0), max(y1 - y, y - y0)
    bound = value + max(f_x * (x1 - x), f_x * (x0 - x)) + max(f_y * (y1 - y), f_y * (y0 - y))
    bound += 0.5 * max(ceiling, 0.0) * (half_x * half_x + half_y * half_y)
    return min(bound, coarse), value, x, y


@kernel
def _search_cell(coefficients, row, column, u, v, radius, tolerance, best, boxes):
    """Search one cell; return the best (value, x, y), given the one known so far."""
    surface = hessian_ceiling(coefficients, row, column)
    highest = np.max(coefficients[row : row + 4, column : column + 4])
    box = (float(column), column + 1.0, float(row), row + 1.0)
    bound, value, x, y = _box_bound(coefficients, box, surface, highest, u, v, radius)
    if bound <= best[0] + tolerance:
        return best
    # A good incumbent first: it closes most of the boxes that come after.
    value, x, y, _, _ = _climb(coefficients, box, x, y, u, v, radius)
    if value > best[0]:
        best = (value, x, y)
    boxes[0, 0], boxes[0, 1], boxes[0, 2], boxes[0, 3], boxes[0, 4] = (
        box[0], box[1], box[2], box[3], bound,
    )  # fmt: skip
    top = 1
    while top > 0:
        top -= 1
        if boxes[top, 4] <= best[0] + tolerance:
            continue
        x0, x1, y0, y1 = boxes[top, 0], boxes[top, 1], boxes[top, 2], boxes[top, 3]
        size = 0.5 * (x1 - x0)
        dx, dy = max(u - x0, x1 - u), max(v - y0, y1 - v)
        at_rim = dx * dx + dy * dy >= radius * radius * (1.0 - 1e-9)
        if size < (_SMALLEST_AT_RIM if at_rim else _SMALLEST):
            continue
        start = top
        for k in range(4):
            left, low = x0 + size * (k & 1), y0 + size * (k >> 1)
            box = (left, left + size, low, low + size)
            bound, value, x, y = _box_bound(coefficients, box, surface, highest, u, v, radius)
            if value > best[0]:
                best = (value, x, y)
            if bound <= best[0] + tolerance:
                continue
            # Insertion keeps the most promising box on top of the stack.
            place = top
            while place > start and boxes[place - 1, 4] > bound:
                boxes[place] = boxes[place - 1]
                place -= 1
            for axis in range(4):
                boxes[place, axis] = box[axis]
            boxes[place, 4] = bound
            top += 1
    return best


@kernel
def _block_bound(pyramid, level, row, column, u, v, radius):
    """Return an upper bound of f over a block of the pyramid."""
    rows, columns = pyramid.shapes[0, 0], pyramid.shapes[0, 1]
    x0, x1 = column << level, min((column + 1) << level, columns)
    y0, y1 = row << level, min((row + 1) << level, rows)
    dx, dy = max(x0 - u, u - x1, 0.0), max(y0 - v, v - y1, 0.0)
    place = pyramid.offsets[level] + row * pyramid.shapes[level, 1] + column
    return pyramid.values[place] + cap(dx * dx + dy * dy, radius)


@kernel
def search(coefficients, pyramid, u, v, radius, tolerance, guess_x, guess_y, nodes, bounds, boxes):
    """Return (offset height, x, y of the contact) in samples, for a sphere above (u, v).

    Parameters
    ----------
    coefficients : (nv + 4 + 2 margin, nu + 4 + 2 margin) array
        Spline coefficients, padded by at least `radius + 1` cells; divided by the pixel size.
    pyramid : MaxPyramid
        Of those coefficients.
    u, v : float
        Place of the sphere's centre [samples], counted from the first cell's start.
    tolerance : float
        The result is at most this far below the true maximum [samples].
    guess_x, guess_y : float
        A place to start from; the last contact, say.
    nodes, bounds, boxes : (512, 3) int64, (512,) and (128, 5) float64 arrays
        Working memory.
    """
    rows, columns = float(pyramid.shapes[0, 0]), float(pyramid.shapes[0, 1])
    whole = (0.0, columns, 0.0, rows)
    centre = _evaluate(coefficients, u, v, u, v, radius)[0]
    if _evaluate(coefficients, guess_x, guess_y, u, v, radius)[0] < centre:
        guess_x, guess_y = u, v
    value, x, y, _, _ = _climb(coefficients, whole, guess_x, guess_y, u, v, radius)
    best = (value, x, y)
    level = pyramid.offsets.size - 1
    nodes[0, 0], nodes[0, 1], nodes[0, 2] = level, 0, 0
    bounds[0] = np.inf
    top = 1
    while top > 0:
        top -= 1
        if bounds[top] <= best[0] + tolerance:
            continue
        level, row, column = nodes[top, 0], nodes[top, 1], nodes[top, 2]
        if level == 0:
            best = _search_cell(
                coefficients, row, column, u, v, radius, tolerance, best, boxes
            )
            continue
        start = top
        for k in range(4):
            r, c = 2 * row + (k >> 1), 2 * column + (k & 1)
            if r >= pyramid.shapes[level - 1, 0] or c >= pyramid.shapes[level - 1, 1]:
                continue
            bound = _block_bound(pyramid, level - 1, r, c, u, v, radius)
            if bound <= best[0] + tolerance:
                continue
            # Insertion keeps the most promising child on top of the stack.
            place = top
            while place > start and bounds[place - 1] > bound:
                bounds[place] = bounds[place - 1]
                nodes[place] = nodes[place - 1]
                place -= 1
            bounds[place] = bound
            nodes[place, 0], nodes[place, 1], nodes[place, 2] = level - 1, r, c
            top += 1
    # Certified in height, the contact is known only to the square root of that; the slope needs it.
    value, x, y, _, _ = _climb(coefficients, whole, best[1], best[2], u, v, radius)
    return value, x, y


@kernel
def search_many(
    coefficients, pyramid, places_u, places_v, radius, tolerance, heights_out, contacts_out
):
    """Fill the offset height and the contact's x and y for every place; see `search`."""
    nodes = np.empty((_STACK, 3), dtype=np.int64)
    bounds = np.empty(_STACK)
    boxes = np.empty((128, 5))
    shift_x = shift_y = 0.0
    for i in range(places_u.size):
        u, v = places_u[i], places_v[i]
        height, x, y = search(
            coefficients, pyramid, u, v, radius, tolerance,
            u + shift_x, v + shift_y, nodes, bounds, boxes,
        )  # fmt: skip
        heights_out[i] = height
        contacts_out[i, 0], contacts_out[i, 1] = x, y
        shift_x, shift_y = x - u, y - v
