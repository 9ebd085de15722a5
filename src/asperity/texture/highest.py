"""The highest point of a texture over any rectangle, from a few numbers read.

Search asks for it thousands of times a tick, over rectangles of all sizes that begin anywhere. In
a pyramid, whose blocks lie side by side, a rectangle that is as large as a block touches up to
nine, and what is read is the highest point of about twice its length and width. Here the highest
points of *windows* are kept, squares of 1, 2, 4, ... cells a side, which overlap: a window begins
after every quarter of its side. Those that begin at the rectangle's two ends cover it, and little
more. Half as many boxes are divided, and a level has a quarter of the numbers of the one below,
or as many where windows are of 4 cells or fewer.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import small_kernel

_QUARTER = 2
"""Windows begin after a side over two to this power, or after each cell."""
_EDGE = 1e-6
"""Rectangles that end this close to a cell's border end there [cells]."""

WHOLE = (0, 0, 0, 0, 1, 1, 0.0, 0.0)
"""What `windows_for` returns where the highest point of all will have to do."""

# Columns of a level.
_FIRST, _COLUMNS, _SHIFT = 0, 1, 2


def windows(
    highest: NDArray[np.float32], wraps: bool
) -> tuple[NDArray[np.float32], list[list[int]]]:
    """Return the highest points of all windows, level by level, and what there is to a level.

    Parameters
    ----------
    highest : (rows, columns) array
        Of each cell.
    wraps : bool
        Whether the first cells follow the last.

    Returns
    -------
    array, list
        The values. For each level: number of its first value, columns of windows, and by which
        power of two cells they are apart.
    """
    values, levels, first, side = [], [], 0, 1
    full = highest
    while True:
        shift = max(side.bit_length() - 1 - _QUARTER, 0)
        taken = full
        for axis in (0, 1):
            starts = np.arange(0, full.shape[axis], 1 << shift)
            if wraps:  # one more, for what begins between the last window and the seam
                starts = np.append(starts, starts[-1] + (1 << shift)) % full.shape[axis]
            taken = np.take(taken, starts, axis=axis)
        values.append(taken.ravel())
        levels.append([first, taken.shape[1], shift])
        first += taken.size
        if side >= max(full.shape):
            return np.concatenate(values), levels
        for axis in (0, 1):
            full = np.maximum(full, _later(full, side, axis, wraps))
        side *= 2


def _later(values: NDArray[np.float32], by: int, axis: int, wraps: bool) -> NDArray[np.float32]:
    """Return what lies so many cells on; beyond the last cell of a map that ends, that one."""
    count = values.shape[axis]
    places = np.arange(count) + by
    return np.take(values, places % count if wraps else np.minimum(places, count - 1), axis=axis)


@small_kernel
def cells_between(low, high, cells, wraps):
    """Return first cell and number of cells of [low, high] (in cells), brought into the map."""
    if wraps == 1:
        first = math.floor(low + _EDGE)
        count = max(math.ceil(high - _EDGE) - first, 1.0)
        if first < 0.0 or first >= cells:
            first -= cells * math.floor(first / cells)
        return int(first), int(min(count, cells))
    first = math.floor(min(max(low + _EDGE, 0.0), cells - 1.0))
    last = math.ceil(min(max(high - _EDGE, 1.0), cells)) - 1.0
    return int(first), int(max(last - first, 0.0)) + 1


@small_kernel
def _how_many(first, count, side, shift):
    """Return how many windows cover a stretch of cells."""
    step = 1 << shift
    covered = side - (first & (step - 1))
    if count <= covered:
        return 1
    # The last one begins up to a step late, those between up to a step early.
    left = count - side + step - 1 - covered
    return 2 if left <= 0 else 2 + (left + side - step) // (side - step + 1)


@small_kernel
def _last(first, count, side, shift, cells):
    """Return the number of the window that covers the end of a stretch of cells."""
    step = 1 << shift
    at = max(first + count - side + step - 1, first)
    # Only in a map that wraps does a stretch pass the last cell.
    return (at - cells if at >= cells + step - 1 else at) >> shift


@small_kernel
def _which(i, number, first, count, side, shift, cells):
    """Return the number of the i-th of so many windows, or of more than the stretch needs."""
    step = 1 << shift
    if i == 0:
        return first >> shift
    at = first + side - (first & (step - 1)) + (i - 1) * (side - step + 1)
    if i == number - 1 or at >= first + count - side + step - 1:
        return _last(first, count, side, shift, cells)
    return (at - cells if at >= cells else at) >> shift


@small_kernel
def windows_for(textures, k, width, height):
    """Return what windows cover any rectangle of texture `k` that is so wide and high [m].

    They are chosen once for many rectangles of one size: see `top_over`.

    Returns
    -------
    tuple
        Where the level begins, its columns, shift and side; how many windows along a row and a
        column; width and height [cells]. `WHOLE`, if only the whole texture covers it.
    """
    table, scales = textures.table, textures.scales
    parts = table[k, 8]
    columns, rows = table[k, 4] * parts, table[k, 3] * parts
    wide, tall = width * scales[k, 0] * parts, height * scales[k, 1] * parts
    if not (wide < columns and tall < rows):
        return WHOLE
    # Wherever it begins: a cell more than its length has.
    more_x, more_y = int(wide) + 2, int(tall) + 2
    less, more = (more_x, more_y) if more_x < more_y else (more_y, more_x)
    level, side, step = table[k, 9], 1, 1
    while 2 * (side - step + 1) < less or 4 * side <= more:
        level, side = level + 1, 2 * side
        step = max(side >> _QUARTER, 1)
    windows = textures.windows
    along = _how_many(step - 1, min(more_x, columns), side, windows[level, _SHIFT])
    across = _how_many(step - 1, min(more_y, rows), side, windows[level, _SHIFT])
    first, width_of = windows[level, _FIRST], windows[level, _COLUMNS]
    return first, width_of, windows[level, _SHIFT], side, along, across, wide, tall


@small_kernel
def _begins(at, size, cells, half, wraps):
    """Return first cell and number of cells of a stretch that begins `at`, all in cells."""
    if wraps == 1:
        low = at + _EDGE
        if low < 0.0 or low >= cells:
            low -= cells * math.floor(low / cells)
        first = min(int(low), int(cells) - 1)
        return first, min(max(math.ceil(low + size - 2.0 * _EDGE) - first, 1), int(cells))
    low, high = min(max(at, half), cells - half), min(max(at + size, half), cells - half)
    first = int(min(low + _EDGE, cells - 1.0))
    return first, max(math.ceil(max(high - _EDGE, 1.0)) - first, 1)


@small_kernel
def top_over(textures, k, chosen, u, v):
    """Return the highest point of texture `k` over a rectangle that begins at (u, v) [m].

    Or a little more. `chosen` is what `windows_for` has returned for its size.
    """
    start, columns, shift, side, along, across, wide, tall = chosen
    table, scales, tops = textures.table, textures.scales, textures.tops
    parts, wraps = table[k, 8], table[k, 7]
    half = 0.5 * parts
    cells_x, cells_y = table[k, 4] * parts, table[k, 3] * parts
    x, y = u * scales[k, 0] * parts + half, v * scales[k, 1] * parts + half
    if side == 0 or not (abs(x) < 1e9 and abs(y) < 1e9):
        # Also where a place is no number.
        return scales[k, 8]
    column, count_x = _begins(x, wide, float(cells_x), half, wraps)
    row, count_y = _begins(y, tall, float(cells_y), half, wraps)
    # Mostly there are two along each; what is read at once is waited for once.
    left, right = column >> shift, _last(column, count_x, side, shift, cells_x)
    here = start + columns * (row >> shift)
    there = start + columns * _last(row, count_y, side, shift, cells_y)
    high = max(tops[here + left], tops[here + right])
    high = max(high, max(tops[there + left], tops[there + right]))
    for i in range(across if along > 2 or across > 2 else 0):
        line = start + columns * _which(i, across, row, count_y, side, shift, cells_y)
        for j in range(along):
            high = max(high, tops[line + _which(j, along, column, count_x, side, shift, cells_x)])
    return float(high)


@small_kernel
def texture_top(textures, k, u0, u1, v0, v1):
    """Return the highest point of texture `k` over a rectangle [m], or a little more."""
    table, scales = textures.table, textures.scales
    parts, wraps = table[k, 8], table[k, 7]
    columns, rows, half = table[k, 4] * parts, table[k, 3] * parts, 0.5 * parts
    su, sv = scales[k, 0] * parts, scales[k, 1] * parts
    x0, x1, y0, y1 = u0 * su + half, u1 * su + half, v0 * sv + half, v1 * sv + half
    if not (x1 - x0 < columns and y1 - y0 < rows and abs(x0) < 1e9 and abs(y0) < 1e9):
        # Also where a place is no number.
        return scales[k, 8]
    if wraps == 0:
        # Beyond its samples the surface is as high as at the last of them.
        last_x, last_y = columns - half, rows - half
        x0, x1 = min(max(x0, half), last_x), min(max(x1, half), last_x)
        y0, y1 = min(max(y0, half), last_y), min(max(y1, half), last_y)
    column, wide = cells_between(x0, x1, float(columns), wraps)
    row, tall = cells_between(y0, y1, float(rows), wraps)
    less, more = (wide, tall) if wide < tall else (tall, wide)
    level, side = table[k, 9], 1
    while 2 * side <= less or 4 * side <= more:
        level, side = level + 1, 2 * side
    windows, tops = textures.windows, textures.tops
    start, width, shift = windows[level, _FIRST], windows[level, _COLUMNS], windows[level, _SHIFT]
    across, along = _how_many(row, tall, side, shift), _how_many(column, wide, side, shift)
    high = -np.inf
    for i in range(across):
        line = start + width * _which(i, across, row, tall, side, shift, rows)
        for j in range(along):
            high = max(high, tops[line + _which(j, along, column, wide, side, shift, columns)])
    return high
