"""The highest point of a texture over any rectangle, from a few stored values.

The contact search needs it thousands of times a tick, over rectangles of all sizes and positions.
In a pyramid of disjoint blocks, a rectangle as large as a block touches up to nine of them, so the
result is the highest point of an area about twice as long and wide. Stored here instead are the
highest points of overlapping *windows*: squares of 1, 2, 4, ... cells a side, of which one begins
after every quarter of a side. The windows at the two ends of a rectangle cover it and little more.
With them the search divides half as many boxes. Each level has a quarter as many values as the one
below, or as many where windows have 4 cells a side or fewer.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import small_kernel

_QUARTER = 2
"""Neighbouring windows begin a side divided by two to this power apart, or one cell."""
_EDGE = 1e-6
"""A rectangle that ends within this distance of a cell's border ends at the border [cells]."""

WINDOW_LEVEL = np.dtype([("first", np.int64), ("columns", np.int64), ("shift", np.int64)])
"""One size of window: index of its first value; windows in a row; neighbours begin `2**shift` cells
apart."""


class WindowCover(NamedTuple):
    """Windows that cover any rectangle of one size: result of `windows_for`."""

    first: int
    """Index of the level's first value."""
    columns: int
    """Windows in a row of the level."""
    shift: int
    """Neighbouring windows begin `2**shift` cells apart."""
    side: int
    """Cells along a side of a window; 0: only the whole texture covers the rectangle."""
    along: int
    """Windows needed along u."""
    across: int
    """Windows needed along v."""
    width: float
    """Of the rectangle [cells]."""
    height: float
    """Of the rectangle [cells]."""


WHOLE = WindowCover(0, 0, 0, 0, 1, 1, 0.0, 0.0)
"""The cover of a rectangle as large as the texture: its highest point of all."""


def windows(
    highest: NDArray[np.float32], wraps: bool
) -> tuple[NDArray[np.float32], NDArray[np.void]]:
    """Return the highest points of all windows, level by level, and the levels.

    Parameters
    ----------
    highest : (rows, columns) array
        Highest point of each cell.
    wraps : bool
        Whether the first cells follow the last.

    Returns
    -------
    values : (n,) array
    levels : (m,) array of WINDOW_LEVEL
    """
    values: list[NDArray[np.float32]] = []
    levels: list[tuple[int, int, int]] = []
    first, side = 0, 1
    full = highest
    while True:
        shift = max(side.bit_length() - 1 - _QUARTER, 0)
        taken = full
        for axis in (0, 1):
            starts = np.arange(0, full.shape[axis], 1 << shift)
            if wraps:  # one more, for rectangles that begin between the last window and the seam
                starts = np.append(starts, starts[-1] + (1 << shift)) % full.shape[axis]
            taken = np.take(taken, starts, axis=axis)
        values.append(taken.ravel())
        levels.append((first, taken.shape[1], shift))
        first += taken.size
        if side >= max(full.shape):
            return np.concatenate(values), np.array(levels, dtype=WINDOW_LEVEL)
        for axis in (0, 1):
            full = np.maximum(full, _shifted(full, side, axis, wraps))
        side *= 2


def _shifted(values: NDArray[np.float32], by: int, axis: int, wraps: bool) -> NDArray[np.float32]:
    """Return the values `by` cells further; past the end of a clamped map, its last cell."""
    count = values.shape[axis]
    places = np.arange(count) + by
    return np.take(values, places % count if wraps else np.minimum(places, count - 1), axis=axis)


@small_kernel
def cells_between(low, high, cells, half, wraps):
    """Return the first cell and the number of cells of [low, high] (in cells), within the map.

    Beyond a clamped border, from `half` to `cells - half`, the surface is as high as at the border.
    """
    if wraps == 1:
        first = math.floor(low + _EDGE)
        count = max(math.ceil(high - _EDGE) - first, 1.0)
        if first < 0.0 or first >= cells:
            first -= cells * math.floor(first / cells)
        return int(first), int(min(count, cells))
    low, high = min(max(low, half), cells - half), min(max(high, half), cells - half)
    first = math.floor(min(max(low + _EDGE, 0.0), cells - 1.0))
    last = math.ceil(min(max(high - _EDGE, 1.0), cells)) - 1.0
    return int(first), int(max(last - first, 0.0)) + 1


@small_kernel
def _count(first, count, side, shift):
    """Return how many windows cover a range of cells."""
    step = 1 << shift
    covered = side - (first & (step - 1))
    if count <= covered:
        return 1
    # The last window begins up to a step late, those between up to a step early.
    rest = count - side + step - 1 - covered
    return 2 if rest <= 0 else 2 + (rest + side - step) // (side - step + 1)


@small_kernel
def _last(first, count, side, shift, cells):
    """Return the index of the window that covers the end of a range of cells."""
    step = 1 << shift
    at = max(first + count - side + step - 1, first)
    # Only in a map that wraps does a range pass the last cell.
    return (at - cells if at >= cells + step - 1 else at) >> shift


@small_kernel
def _window(i, number, first, count, side, shift, cells):
    """Return the index of the i-th of `number` windows over a range of cells.

    Windows beyond those that the range needs repeat the last.
    """
    step = 1 << shift
    if i == 0:
        return first >> shift
    at = first + side - (first & (step - 1)) + (i - 1) * (side - step + 1)
    if i == number - 1 or at >= first + count - side + step - 1:
        return _last(first, count, side, shift, cells)
    return (at - cells if at >= cells else at) >> shift


@small_kernel
def windows_for(textures, k, width, height):
    """Return a `WindowCover` for any rectangle of texture `k` of this width and height [m].

    It is chosen once for many rectangles of one size: see `top_over`.
    """
    texture = textures.maps[k]
    parts = texture.parts
    columns, rows = texture.columns * parts, texture.rows * parts
    wide = width * texture.cells_per_metre[0] * parts
    tall = height * texture.cells_per_metre[1] * parts
    if not (wide < columns and tall < rows):
        return WHOLE
    # Wherever the rectangle begins, it touches at most one cell more than its length has.
    more_x, more_y = int(wide) + 2, int(tall) + 2
    less, more = (more_x, more_y) if more_x < more_y else (more_y, more_x)
    level, side, step = texture.first_window_level, 1, 1
    while 2 * (side - step + 1) < less or 4 * side <= more:
        level, side = level + 1, 2 * side
        step = max(side >> _QUARTER, 1)
    size = textures.windows[level]
    along = _count(step - 1, min(more_x, columns), side, size.shift)
    across = _count(step - 1, min(more_y, rows), side, size.shift)
    return WindowCover(size.first, size.columns, size.shift, side, along, across, wide, tall)


@small_kernel
def _cells_from(at, size, cells, half, wraps):
    """Return the first cell and the number of cells of [at, at + size] (in cells)."""
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
def top_over(textures, k, cover, u, v):
    """Return the highest point of texture `k` over a rectangle that begins at (u, v) [m].

    The windows extend a little beyond the rectangle, so the result is an upper bound. `cover` is
    the `WindowCover` for the rectangle's size.
    """
    start, columns, shift, side, along, across, wide, tall = cover
    texture, tops = textures.maps[k], textures.tops
    parts, wraps = texture.parts, texture.wraps
    half = 0.5 * parts
    cells_x, cells_y = texture.columns * parts, texture.rows * parts
    x = u * texture.cells_per_metre[0] * parts + half
    y = v * texture.cells_per_metre[1] * parts + half
    if side == 0 or not (abs(x) < 1e9 and abs(y) < 1e9):
        # This includes NaN.
        return texture.highest
    column, count_x = _cells_from(x, wide, float(cells_x), half, wraps)
    row, count_y = _cells_from(y, tall, float(cells_y), half, wraps)
    # Usually two windows along each axis suffice; independent reads overlap their latency.
    left, right = column >> shift, _last(column, count_x, side, shift, cells_x)
    here = start + columns * (row >> shift)
    there = start + columns * _last(row, count_y, side, shift, cells_y)
    high = max(tops[here + left], tops[here + right])
    high = max(high, max(tops[there + left], tops[there + right]))
    for i in range(across if along > 2 or across > 2 else 0):
        line = start + columns * _window(i, across, row, count_y, side, shift, cells_y)
        for j in range(along):
            high = max(high, tops[line + _window(j, along, column, count_x, side, shift, cells_x)])
    return float(high)


@small_kernel
def texture_top(textures, k, u0, u1, v0, v1):
    """Return the highest point of texture `k` over a rectangle [m].

    The windows extend a little beyond the rectangle, so the result is an upper bound.
    """
    texture = textures.maps[k]
    parts, wraps = texture.parts, texture.wraps
    columns, rows, half = texture.columns * parts, texture.rows * parts, 0.5 * parts
    su, sv = texture.cells_per_metre[0] * parts, texture.cells_per_metre[1] * parts
    x0, x1, y0, y1 = u0 * su + half, u1 * su + half, v0 * sv + half, v1 * sv + half
    if not (x1 - x0 < columns and y1 - y0 < rows and abs(x0) < 1e9 and abs(y0) < 1e9):
        # This includes NaN.
        return texture.highest
    column, wide = cells_between(x0, x1, float(columns), half, wraps)
    row, tall = cells_between(y0, y1, float(rows), half, wraps)
    less, more = (wide, tall) if wide < tall else (tall, wide)
    level, side = texture.first_window_level, 1
    while 2 * side <= less or 4 * side <= more:
        level, side = level + 1, 2 * side
    tops, size = textures.tops, textures.windows[level]
    start, width, shift = size.first, size.columns, size.shift
    across, along = _count(row, tall, side, shift), _count(column, wide, side, shift)
    high = -np.inf
    for i in range(across):
        line = start + width * _window(i, across, row, tall, side, shift, rows)
        for j in range(along):
            high = max(high, tops[line + _window(j, along, column, wide, side, shift, columns)])
    return high
