"""All textures, and maps of properties, of a scene in a few flat arrays for compiled kernels.

Kernels evaluate a texture's height and its derivatives up to the second at a point, and bounds over
a rectangle: no point of the texture in it is higher, no slope larger in size, no second derivative
larger. The cost of neither depends on the resolution. Bounds of slopes and second derivatives come
from pyramids over the Bezier points of the cells (a spline lies in their convex hull), read at the
level whose blocks are as large as the rectangle; highest points from overlapping windows
(`highest`).

Positions are counted in cells: cell `i` lies between the samples `i - 1` and `i` and depends on the
coefficients `i .. i + 3`. A wrapped texture of n samples has n cells that repeat; a clamped one has
n + 1 and continues level beyond its borders. Maps of stiffness are textures whose heights are minus
the compliance [m/N]. Maps of friction have samples in the place of coefficients, and no bounds.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array
from asperity._core.kernels import small_kernel
from asperity._core.structures import by_reference
from asperity.texture.highest import cells_between, texture_top
from asperity.texture.spline import curvature_weights, slope_weights, weights

_EDGE = 1e-6
"""A rectangle larger than a block by less than this counts as its size [cells]."""

TEXTURE_MAP = np.dtype([
    ("first_coefficient", np.int64),
    ("coefficient_columns", np.int64),
    ("rows", np.int64),
    ("columns", np.int64),
    ("wraps", np.int64),
    ("parts", np.int64),
    ("first_level", np.int64),
    ("level_count", np.int64),
    ("first_window_level", np.int64),
    ("cells_per_metre", np.float64, 2),
    ("max_abs_height", np.float64),
    ("max_abs_surface", np.float64),
    ("max_slope", np.float64),
    ("max_curvature", np.float64),
    ("max_third_derivative", np.float64),
    ("rms", np.float64),
    ("lowest", np.float64),
    ("highest", np.float64),
])  # fmt: skip
"""One texture of a scene.

`rows` and `columns` count cells, `coefficient_columns` spline coefficients. `wraps` is 1 or 0.
Each side of a cell is cut into `parts` with bounds of their own. `cells_per_metre` is along u and
v. `max_abs_height` and `max_curvature` (over all directions) bound the spline's coefficients, and
so the surface [m, 1/m]; `max_third_derivative` likewise [1/m^2]; `max_slope` [-].
`max_abs_surface` bounds the surface by its Bezier points, more sharply [m]. `rms` and
`lowest` are those of the samples, `highest` bounds the surface [m]; of a map of stiffness `lowest`
is that of its samples [N/m].
"""
LEVEL = np.dtype([("first", np.int64), ("rows", np.int64), ("columns", np.int64)])
"""One level of a pyramid: index of its first block, rows and columns of blocks."""
BLOCK_BOUNDS = np.dtype([("slope", np.float32), ("curvature", np.float32)])
"""Largest slope [-] and largest second derivative in any direction [1/m] of a block."""


@by_reference
class PackedTextures(NamedTuple):
    """The height fields of a scene, flattened; all lengths in metres."""

    coefficients: Array
    """Spline coefficients of all textures, each row-major."""
    bounds: NDArray[np.void]
    """`BLOCK_BOUNDS` of every block of every level."""
    levels: NDArray[np.void]
    """`LEVEL` of every level of every texture's pyramid, finest first."""
    maps: NDArray[np.void]
    """`TEXTURE_MAP` of every texture."""
    tops: NDArray[np.float32]
    """Highest points of windows [m]: see `highest`."""
    windows: NDArray[np.void]
    """`WINDOW_LEVEL` of every size of window of every texture, smallest first."""


@small_kernel
def _cell_at(textures, k, u, v):
    """Return the cell of (u, v) and the position in it.

    Returns
    -------
    first : int
        Index of the cell's first coefficient; -1 where u or v is not finite, as beside a round
        body.
    x, y : float
        Position in the cell, 0 to 1.
    slope_u, slope_v : float
        Factors of the slopes: 0 beyond a clamped border, where the surface is level, else 1.
    """
    texture = textures.maps[k]
    x, y = u * texture.cells_per_metre[0], v * texture.cells_per_metre[1]
    if not (x - x == 0.0 and y - y == 0.0):
        return np.int64(-1), 0.0, 0.0, 0.0, 0.0
    slope_u, slope_v = 1.0, 1.0
    columns, rows = float(texture.columns), float(texture.rows)
    if texture.wraps == 1:
        x, y = x + 0.5, y + 0.5
        # By a multiplication, whose latency is shorter than that of a division.
        x -= columns * math.floor(x * (1.0 / columns))
        y -= rows * math.floor(y * (1.0 / rows))
    else:
        if x < 0.0 or x > columns - 1.0:
            x, slope_u = min(max(x, 0.0), columns - 1.0), 0.0
        if y < 0.0 or y > rows - 1.0:
            y, slope_v = min(max(y, 0.0), rows - 1.0), 0.0
        x, y = x + 0.5, y + 0.5
    column = min(int(x), int(texture.columns) - 1)
    row = min(int(y), int(texture.rows) - 1)
    first = texture.first_coefficient + row * texture.coefficient_columns + column
    return first, x - column, y - row, slope_u, slope_v


@small_kernel
def texture_at(textures, k, u, v):
    """Return h, h_u, h_v, h_uu, h_uv, h_vv of texture `k` at (u, v) [m]."""
    place, t, q, slope_u, slope_v = _cell_at(textures, k, u, v)
    if place < 0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    a0, a1, a2, a3 = weights(t)
    b0, b1, b2, b3 = slope_weights(t)
    c0, c1, c2, c3 = curvature_weights(t)
    w, dw, ddw = weights(q), slope_weights(q), curvature_weights(q)
    h = h_u = h_v = h_uu = h_uv = h_vv = 0.0
    c, width = textures.coefficients, textures.maps[k].coefficient_columns
    for i in range(4):
        k0, k1, k2, k3 = c[place], c[place + 1], c[place + 2], c[place + 3]
        value = a0 * k0 + a1 * k1 + a2 * k2 + a3 * k3
        slope = b0 * k0 + b1 * k1 + b2 * k2 + b3 * k3
        h += w[i] * value
        h_v += dw[i] * value
        h_vv += ddw[i] * value
        h_u += w[i] * slope
        h_uv += dw[i] * slope
        h_uu += w[i] * (c0 * k0 + c1 * k1 + c2 * k2 + c3 * k3)
        place += width
    scale = textures.maps[k].cells_per_metre
    su, sv = scale[0] * slope_u, scale[1] * slope_v
    return h, h_u * su, h_v * sv, h_uu * su * su, h_uv * su * sv, h_vv * sv * sv


@small_kernel
def linear_at(textures, k, u, v):
    """Return map `k` of friction at (u, v), linear between its samples; nan if either is nan."""
    place, t, q, _, _ = _cell_at(textures, k, u, v)
    if place < 0:
        return np.nan
    c, width = textures.coefficients, textures.maps[k].coefficient_columns
    low = place + width + 1
    high = low + width
    below, above = c[low] + t * (c[low + 1] - c[low]), c[high] + t * (c[high + 1] - c[high])
    return below + q * (above - below)


@small_kernel
def texture_slope(textures, k, u, v):
    """Return h, h_u, h_v of texture `k` at (u, v) [m]."""
    h, h_u, h_v, _, _, _ = texture_at(textures, k, u, v)
    return h, h_u, h_v


@small_kernel
def slope_bounds(textures, k, u0, u1, v0, v1):
    """Return (largest slope [-], largest second derivative [1/m]) over a rectangle [m].

    The latter is 0 or more where the rectangle extends beyond a clamped border.
    """
    texture, bounds = textures.maps[k], textures.bounds
    # From here on in parts of cells.
    parts, wraps, first = texture.parts, texture.wraps, texture.first_level
    columns, rows, half = texture.columns * parts, texture.rows * parts, 0.5 * parts
    su, sv = texture.cells_per_metre[0] * parts, texture.cells_per_metre[1] * parts
    x0, x1, y0, y1 = u0 * su + half, u1 * su + half, v0 * sv + half, v1 * sv + half
    top = texture.level_count - 1
    size = x1 - x0 if x1 - x0 > y1 - y0 else y1 - y0
    level, side, enough = 0, 1.0, 0.5 * size - _EDGE
    while level < top and not side >= enough:
        level, side = level + 1, 2.0 * side
    if level == top or not (x1 - x0 < 1e9 and y1 - y0 < 1e9):
        # The whole texture; this includes NaN.
        block = textures.levels[first + top].first
        return float(bounds[block].slope), max(float(bounds[block].curvature), 0.0)
    last_x, last_y = columns - half, rows - half
    outside = wraps == 0 and (x0 < half or y0 < half or x1 > last_x or y1 > last_y)
    column, wide = cells_between(x0, x1, float(columns), half, wraps)
    row, tall = cells_between(y0, y1, float(rows), half, wraps)
    start, width = textures.levels[first + level].first, textures.levels[first + level].columns
    slope, curvature = 0.0, -np.inf
    while tall > 0:
        c, left = column, wide
        while left > 0:
            block = start + (row >> level) * width + (c >> level)
            slope = max(slope, float(bounds[block].slope))
            curvature = max(curvature, float(bounds[block].curvature))
            after = min(((c >> level) + 1) << level, columns)
            left -= after - c
            c = 0 if after == columns else after
        after = min(((row >> level) + 1) << level, rows)
        tall -= after - row
        row = 0 if after == rows else after
    return slope, max(curvature, 0.0) if outside else curvature


@small_kernel
def texture_bounds(textures, k, u0, u1, v0, v1):
    """Return (highest point, largest slope, largest second derivative) over a rectangle [m]."""
    slope, curvature = slope_bounds(textures, k, u0, u1, v0, v1)
    return texture_top(textures, k, u0, u1, v0, v1), slope, curvature
