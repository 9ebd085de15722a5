"""All textures of a scene in a few flat arrays, as compiled kernels want them.

A texture is asked for two things: its height with all derivatives up to the second at a place,
and bounds over a rectangle: no point of the texture there is higher, no slope is larger in size,
no second derivative is larger. Both cost the same whatever the resolution: bounds of slopes and
second derivatives come from pyramids over the cells' Bezier points (in whose hull a spline lies),
read at the level whose blocks are as large as the rectangle; highest points from windows that
overlap (`highest`).

A place is counted in cells: cell `i` is the stretch between the samples `i - 1` and `i`, and
depends on the coefficients `i .. i + 3`. A wrapped texture of n samples has n cells that repeat;
a clamped one has n + 1, and goes on level beyond its borders.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import small_kernel
from asperity.texture.height_field import HeightField
from asperity.texture.highest import cells_between, texture_top, windows

_MOST_BLOCKS = 512**2
"""Cells are not cut into more blocks than this."""
_SIXTH, _TWO_THIRDS = 1.0 / 6.0, 2.0 / 3.0
_EDGE = 1e-6
"""Rectangles this little larger than a block count as its size [cells]."""


class PackedTextures(NamedTuple):
    """The height fields of a scene, flattened; all lengths in metres."""

    coefficients: NDArray[np.float64]
    """Spline coefficients of all textures, each row-major."""
    bounds: NDArray[np.float32]
    """For every block: largest slope, largest second derivative; shape (n, 2)."""
    levels: NDArray[np.int64]
    """For every level of every texture: first block, rows, columns; shape (n, 3)."""
    table: NDArray[np.int64]
    """First coefficient, rows, columns of coefficients; rows, columns of cells; first level,
    number of levels, whether it wraps; parts of a cell's side with bounds of their own; first
    level of windows; shape (textures, 10)."""
    scales: NDArray[np.float64]
    """Cells per metre along u and v; largest size of a height, of a slope, of a second derivative;
    rms height; lowest height; largest size of a third derivative; highest point; shape
    (textures, 9)."""
    tops: NDArray[np.float32]
    """Highest points of windows: see `highest`."""
    windows: NDArray[np.int64]
    """For every level of windows of every texture: first of `tops`, columns, by which power of two
    cells they are apart; shape (n, 3)."""


def pack(fields: Sequence[HeightField]) -> PackedTextures:
    """Return the textures `fields` as flat arrays. An empty sequence gives empty arrays."""
    levels: list[list[int]] = []
    coefficients, bounds, table, scales = [], [], [], []
    tops: list[NDArray[np.float32]] = []
    windowed: list[list[int]] = []
    first_coefficient = first_block = first_level = first_top = 0
    for field in fields:
        c = np.ascontiguousarray(field.coefficients)
        wraps = field.border == "wrap"
        rows, columns = (n - 4 if wraps else n - 3 for n in c.shape)
        parts = _parts(rows * columns)
        # A wrapped texture's last cell is its first once more.
        cells = c[:-1, :-1] if wraps else c
        pyramid = _pyramid(cells, field.pixel_size, levels, first_block, parts)
        highest, more = windows(_up(_most(cells, 0, 0, parts=parts)), wraps)
        count = len(levels) - first_level
        table.append([
            first_coefficient, *c.shape, rows, columns, first_level, count, wraps, parts,
            len(windowed),
        ])  # fmt: skip
        windowed += [[first_top + first, *rest] for first, *rest in more]
        size = float(np.max(np.abs(c)))
        top = pyramid[-1]
        pu, pv = field.pixel_size
        bend = max(_largest(c, 2, 0) / pu**2, _largest(c, 0, 2) / pv**2)
        bend += _largest(c, 1, 1) / (pu * pv)
        third = _third(c, pu, pv)
        scales.append([
            1.0 / pu, 1.0 / pv, size, top[0], bend, field.rms, field.lowest, third,
            float(highest.max()),
        ])  # fmt: skip
        coefficients.append(c.ravel())
        bounds.append(pyramid)
        tops.append(highest)
        first_top += len(highest)
        first_coefficient += c.size
        first_block += len(pyramid)
        first_level = len(levels)
    return PackedTextures(
        np.concatenate([np.zeros(0), *coefficients]),
        np.concatenate([np.zeros((0, 2), np.float32), *bounds]),
        np.array(levels, dtype=np.int64).reshape(-1, 3),
        np.array(table, dtype=np.int64).reshape(-1, 10),
        np.array(scales, dtype=np.float64).reshape(-1, 9),
        np.concatenate([np.zeros(0, np.float32), *tops]),
        np.array(windowed, dtype=np.int64).reshape(-1, 3),
    )


def _parts(cells: int) -> int:
    """Return into how many parts a side of each cell is cut, for bounds: more in coarse maps."""
    parts = 1
    while parts < 4 and cells * (2 * parts) ** 2 <= _MOST_BLOCKS:
        parts *= 2
    return parts


def _pyramid(
    c: NDArray[np.float64],
    pixel_size: tuple[float, float],
    levels: list[list[int]],
    first: int,
    parts: int,
) -> NDArray[np.float32]:
    """Return bounds of slope and bend of all blocks, and add each level to `levels`."""
    pu, pv = pixel_size
    most = functools.partial(_most, c, parts=parts)
    slope = np.hypot(most(1, 0, True) / pu, most(0, 1, True) / pv)
    # Gershgorin: no eigenvalue of the Hessian exceeds the larger row sum.
    bend = np.maximum(most(2, 0) / pu**2, most(0, 2) / pv**2)
    bend += most(1, 1, True) / (pu * pv)
    # Rounded up: a bound in single precision is a bound still.
    level = np.stack([_up(slope), _up(bend)], axis=-1)
    blocks = []
    while True:
        blocks.append(level.reshape(-1, 2))
        levels.append([first, level.shape[0], level.shape[1]])
        first += len(blocks[-1])
        if max(level.shape[:2]) == 1:
            return np.concatenate(blocks)
        for axis in (0, 1):
            if level.shape[axis] > 1:
                starts = np.arange(0, level.shape[axis], 2)
                level = np.maximum.reduceat(level, starts, axis=axis)


def _most(
    c: NDArray[np.float64], along_u: int, along_v: int, size: bool = False, parts: int = 1
) -> NDArray:
    """Return for every cell the largest value (or its size) of a partial derivative, or more.

    Within a cell the derivative is a polynomial, and lies in the hull of its Bezier points: those
    of the cell alone, while the spline's coefficients reach over its neighbours.
    """
    spline: NDArray[np.float64] = np.diff(np.diff(c, along_u, axis=1), along_v, axis=0)
    points = (
        across
        for along in _bezier_points(spline, 3 - along_v, parts)
        for across in _bezier_points(along.T, 3 - along_u, parts)
    )
    return functools.reduce(np.maximum, (np.abs(p) if size else p for p in points)).T


def _bezier_points(c: NDArray[np.float64], degree: int, parts: int) -> list[NDArray[np.float64]]:
    """Return the Bezier points of the pieces of uniform B-splines along the first axis.

    Each piece is cut into `parts`, a power of two.
    """
    n = len(c) - degree
    k = [c[i : i + n] for i in range(degree + 1)]
    if degree == 3:
        k = [
            (k[0] + 4.0 * k[1] + k[2]) / 6.0, (2.0 * k[1] + k[2]) / 3.0,
            (k[1] + 2.0 * k[2]) / 3.0, (k[1] + 4.0 * k[2] + k[3]) / 6.0,
        ]  # fmt: skip
    elif degree == 2:
        k = [0.5 * (k[0] + k[1]), k[1], 0.5 * (k[1] + k[2])]
    while parts > 1:
        # de Casteljau: the left half begins, the right half ends the rows of means.
        left, right = [k[0]], [k[-1]]
        while len(k) > 1:
            k = [0.5 * (one + two) for one, two in itertools.pairwise(k)]
            left.append(k[0])
            right.append(k[-1])
        pairs = zip(left, reversed(right), strict=True)
        k = [np.stack(pair, axis=1).reshape(-1, *c.shape[1:]) for pair in pairs]
        parts //= 2
    return k


def _largest(c: NDArray[np.float64], along_u: int, along_v: int) -> float:
    """Return the largest size of a coefficient of a partial derivative."""
    return float(np.max(np.abs(np.diff(np.diff(c, along_u, axis=1), along_v, axis=0))))


def _third(c: NDArray[np.float64], pu: float, pv: float) -> float:
    """Return the largest size of a third derivative along any direction."""
    parts = [_largest(c, 3 - k, k) / (pu ** (3 - k) * pv**k) for k in range(4)]
    # Of unit vectors (a, b), (|a| + |b|)^3 is at most this.
    return 2.0**1.5 * max(parts)


def _up(values: NDArray[np.float64]) -> NDArray[np.float32]:
    rounded = values.astype(np.float32)
    return np.where(rounded < values, np.nextafter(rounded, np.float32(np.inf)), rounded)


@small_kernel
def _cell_at(textures, k, u, v):
    """Return the place of a cell's first coefficient, and where (u, v) lies in the cell.

    And what slopes there count along u and v: 0 beyond a clamped border, where the surface is
    level. The place is -1 where (u, v) is no number.
    """
    table, scales = textures.table, textures.scales
    x, y = u * scales[k, 0], v * scales[k, 1]
    if not (x - x == 0.0 and y - y == 0.0):
        # Beyond a round body: no number is no index either.
        return np.int64(-1), 0.0, 0.0, 0.0, 0.0
    along, across = 1.0, 1.0
    columns, rows = float(table[k, 4]), float(table[k, 3])
    if table[k, 7] == 1:
        x, y = x + 0.5, y + 0.5
        # Not divided: what follows would wait for that.
        x -= columns * math.floor(x * (1.0 / columns))
        y -= rows * math.floor(y * (1.0 / rows))
    else:
        if x < 0.0 or x > columns - 1.0:
            x, along = min(max(x, 0.0), columns - 1.0), 0.0
        if y < 0.0 or y > rows - 1.0:
            y, across = min(max(y, 0.0), rows - 1.0), 0.0
        x, y = x + 0.5, y + 0.5
    column = min(int(x), int(table[k, 4]) - 1)
    row = min(int(y), int(table[k, 3]) - 1)
    return table[k, 0] + row * table[k, 2] + column, x - column, y - row, along, across


@small_kernel
def _blend(t):
    """Return the weights of four coefficients at t of [0, 1] of a cell."""
    r = 1.0 - t
    t2, r2 = t * t, r * r
    return (
        r2 * r * _SIXTH, _TWO_THIRDS - t2 + 0.5 * t2 * t, _TWO_THIRDS - r2 + 0.5 * r2 * r,
        t2 * t * _SIXTH,
    )  # fmt: skip


@small_kernel
def _blend_slope(t):
    """Return the derivatives of `_blend`."""
    r = 1.0 - t
    return -0.5 * r * r, 1.5 * t * t - 2.0 * t, 2.0 * r - 1.5 * r * r, 0.5 * t * t


@small_kernel
def texture_at(textures, k, u, v):
    """Return h, h_u, h_v, h_uu, h_uv, h_vv of texture `k` at (u, v) [m]."""
    place, t, q, along, across = _cell_at(textures, k, u, v)
    if place < 0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    a0, a1, a2, a3 = _blend(t)
    b0, b1, b2, b3 = _blend_slope(t)
    c0, c1, c2, c3 = 1.0 - t, 3.0 * t - 2.0, 1.0 - 3.0 * t, t
    w, dw = _blend(q), _blend_slope(q)
    ddw = (1.0 - q, 3.0 * q - 2.0, 1.0 - 3.0 * q, q)
    h = h_u = h_v = h_uu = h_uv = h_vv = 0.0
    c, width = textures.coefficients, textures.table[k, 2]
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
    su, sv = textures.scales[k, 0] * along, textures.scales[k, 1] * across
    return h, h_u * su, h_v * sv, h_uu * su * su, h_uv * su * sv, h_vv * sv * sv


@small_kernel
def texture_slope(textures, k, u, v):
    """Return the first three of `texture_at`: h, h_u, h_v."""
    place, t, q, along, across = _cell_at(textures, k, u, v)
    if place < 0:
        return 0.0, 0.0, 0.0
    a0, a1, a2, a3 = _blend(t)
    b0, b1, b2, b3 = _blend_slope(t)
    w, dw = _blend(q), _blend_slope(q)
    h = h_u = h_v = 0.0
    c, width = textures.coefficients, textures.table[k, 2]
    for i in range(4):
        k0, k1, k2, k3 = c[place], c[place + 1], c[place + 2], c[place + 3]
        value = a0 * k0 + a1 * k1 + a2 * k2 + a3 * k3
        h += w[i] * value
        h_v += dw[i] * value
        h_u += w[i] * (b0 * k0 + b1 * k1 + b2 * k2 + b3 * k3)
        place += width
    return h, h_u * textures.scales[k, 0] * along, h_v * textures.scales[k, 1] * across


@small_kernel
def slope_bounds(textures, k, u0, u1, v0, v1):
    """Return (largest slope, largest second derivative) over a rectangle [m].

    The largest second derivative is 0 or more where the rectangle passes a clamped border.
    """
    table, scales, bounds = textures.table, textures.scales, textures.bounds
    # From here on in parts of cells.
    parts, wraps, first = table[k, 8], table[k, 7], table[k, 5]
    columns, rows, half = table[k, 4] * parts, table[k, 3] * parts, 0.5 * parts
    su, sv = scales[k, 0] * parts, scales[k, 1] * parts
    x0, x1, y0, y1 = u0 * su + half, u1 * su + half, v0 * sv + half, v1 * sv + half
    top = table[k, 6] - 1
    size = x1 - x0 if x1 - x0 > y1 - y0 else y1 - y0
    level, side, enough = 0, 1.0, 0.5 * size - _EDGE
    while level < top and not side >= enough:
        level, side = level + 1, 2.0 * side
    if level == top or not (x1 - x0 < 1e9 and y1 - y0 < 1e9):
        # All of the texture; also where a place is no number.
        block = textures.levels[first + top, 0]
        return float(bounds[block, 0]), max(float(bounds[block, 1]), 0.0)
    outside = False
    if wraps == 0:
        # Beyond its samples the surface is as high as at the last of them.
        last_x, last_y = columns - half, rows - half
        outside = x0 < half or y0 < half or x1 > last_x or y1 > last_y
        x0, x1 = min(max(x0, half), last_x), min(max(x1, half), last_x)
        y0, y1 = min(max(y0, half), last_y), min(max(y1, half), last_y)
    column, wide = cells_between(x0, x1, float(columns), wraps)
    row, tall = cells_between(y0, y1, float(rows), wraps)
    start, width = textures.levels[first + level, 0], textures.levels[first + level, 2]
    slope, bend = 0.0, -np.inf
    while tall > 0:
        c, left = column, wide
        while left > 0:
            block = start + (row >> level) * width + (c >> level)
            slope = max(slope, float(bounds[block, 0]))
            bend = max(bend, float(bounds[block, 1]))
            after = min(((c >> level) + 1) << level, columns)
            left -= after - c
            c = 0 if after == columns else after
        after = min(((row >> level) + 1) << level, rows)
        tall -= after - row
        row = 0 if after == rows else after
    return slope, max(bend, 0.0) if outside else bend


@small_kernel
def texture_bounds(textures, k, u0, u1, v0, v1):
    """Return (highest point, largest slope, largest second derivative) over a rectangle [m]."""
    slope, bend = slope_bounds(textures, k, u0, u1, v0, v1)
    return texture_top(textures, k, u0, u1, v0, v1), slope, bend
