"""The highest point of every cell of a cubic spline, by branch and bound over all cells at once.

In a cell the spline lies below its highest Bezier point, and reaches those at the corners. Cells
where the two differ are cut in four by de Casteljau's algorithm until they do not, if they may be
higher than all around them. A search for the deepest point of a flat tool then needs to look into
the cells that its rim cuts, and into few others.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array

_FROM_SPLINE = np.array([[1, 4, 1, 0], [0, 4, 2, 0], [0, 2, 4, 0], [0, 1, 4, 1]]) / 6.0
"""Bezier points of a cell from its four coefficients."""
_LEFT = np.array([[8, 0, 0, 0], [4, 4, 0, 0], [2, 4, 2, 0], [1, 3, 3, 1]]) / 8.0
"""Bezier points of the left half of a cell; reversed both ways, of the right half."""
_HALVES = (_LEFT, _LEFT[::-1, ::-1])
_ROUNDS = 12
_MOST = 400_000
"""Largest number of pieces that are divided at a time; of larger maps bounds are not sharpened."""


def sharpen_peaks(bounds: Array, coefficients: Array, parts: int, tolerance: float) -> Array:
    """Return sharper bounds of the highest point of each part of each cell of a cubic spline.

    Parameters
    ----------
    bounds : (rows * parts, columns * parts) array
        Upper bounds to sharpen [m].
    coefficients : (rows + 3, columns + 3) array
        Of the uniform cubic B-spline [m].
    parts : int
        Number of parts of a cell's side, a power of two.
    tolerance : float
        Bounds of cells that may be higher than all their neighbours reach are sharpened until they
        are at most this much too high [m], above 0.

    Returns
    -------
    (rows * parts, columns * parts) array
        Not below the spline anywhere; `bounds` itself where there are too many cells to divide.
    """
    reached = _at_corners(coefficients, parts)
    reached = np.maximum.reduce(
        [reached[:-1, :-1], reached[1:, :-1], reached[:-1, 1:], reached[1:, 1:]]
    )
    # A cell below its neighbours is seldom the highest of an area: its bound may stay as it is.
    around = _highest_around(_highest_around(reached).T).T
    open_rows, open_columns = np.nonzero(bounds - around > tolerance)
    if not 0 < len(open_rows) <= _MOST:
        return bounds
    points = _bezier_points(coefficients, open_rows, open_columns, parts)
    owner = np.arange(len(open_rows))
    low, closed = reached[open_rows, open_columns], reached[open_rows, open_columns].copy()
    for _ in range(_ROUNDS):
        high = points.max(axis=(1, 2))
        corners = np.maximum.reduce(
            [points[:, 0, 0], points[:, 0, 3], points[:, 3, 0], points[:, 3, 3]]
        )
        np.maximum.at(low, owner, corners)
        is_open = high > low[owner] + tolerance
        np.maximum.at(closed, owner[~is_open], high[~is_open])
        points, owner = points[is_open], owner[is_open]
        if len(owner) == 0 or len(owner) > _MOST:
            break
        points = np.concatenate([a @ points @ b.T for a in _HALVES for b in _HALVES])
        owner = np.tile(owner, 4)
    if len(owner):
        np.maximum.at(closed, owner, points.max(axis=(1, 2)))
    sharp = bounds.copy()
    sharp[open_rows, open_columns] = np.minimum(
        sharp[open_rows, open_columns], np.maximum(closed, low)
    )
    return sharp


def _highest_around(values: Array) -> Array:
    """Return the largest of each value and its two neighbours along the first axis."""
    padded = np.pad(values, ((1, 1), (0, 0)), mode="edge")
    largest: Array = np.maximum(np.maximum(padded[:-2], padded[1:-1]), padded[2:])
    return largest


def _at_corners(c: Array, parts: int) -> Array:
    """Return the spline at the corners of all parts, (rows * parts + 1, columns * parts + 1)."""
    for _ in range(2):
        lines = []
        for k in range(parts):
            t = k / parts
            r = 1.0 - t
            w = (r**3, 3 * t**3 - 6 * t**2 + 4, 3 * r**3 - 6 * r**2 + 4, t**3)
            lines.append((w[0] * c[:-3] + w[1] * c[1:-2] + w[2] * c[2:-1] + w[3] * c[3:]) / 6.0)
        inside = np.stack(lines, axis=1).reshape(-1, c.shape[1])
        last = (c[-3] + 4.0 * c[-2] + c[-1]) / 6.0
        c = np.vstack([inside, last]).T
    return c


def _bezier_points(c: Array, rows: NDArray, columns: NDArray, parts: int) -> Array:
    """Return the Bezier points (n, 4, 4) of the given parts of cells."""
    steps = np.arange(4)
    i, j = rows // parts, columns // parts
    cells = c[i[:, None, None] + steps[:, None], j[:, None, None] + steps]
    points = _FROM_SPLINE @ cells @ _FROM_SPLINE.T
    size = parts
    rows, columns = rows % parts, columns % parts
    while size > 1:
        size //= 2
        halves = np.stack(_HALVES)
        points = halves[rows // size] @ points @ halves[columns // size].transpose(0, 2, 1)
        rows, columns = rows % size, columns % size
    return points
