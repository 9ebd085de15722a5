"""Maps from points in three columns, on a grid or scattered; profiles from two columns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array

_OFF = 0.15
"""How far a point may lie from its place on a grid, in steps."""
_TWICE = 0.01
"""Largest share of points where there is one already, as at seams."""
_FILLED = 0.5
"""Least share of a grid's places that have a point."""


_FAR, _SEVERAL = 20.0, 100
"""Distance of a stray point, over the extent of 98 % of all, and least number of points to tell."""
MOST_PER_POINT = 400
"""Places of a map for each scattered point, at most: more would show nothing but the triangles."""


class Grid(NamedTuple):
    """Heights on a grid, row 0 at the least y, and how they came there."""

    values: Array
    pixel_size: tuple[float, float]
    note: str


def _places(x: Array) -> tuple[NDArray[np.int64], float] | None:
    """Return the index of each coordinate on even steps, and the step; None if they are uneven."""
    distinct = np.sort(x)
    gaps = np.diff(distinct)
    if gaps.size == 0 or gaps.max() == 0.0:
        return None
    wide = gaps[gaps > 0.1 * gaps.max()]
    step = float(np.median(wide))
    index = np.rint((x - distinct[0]) / step)
    if index.max() > 1e6:
        return None
    # A median of rounded coordinates is less exact than the whole length.
    step = float((distinct[-1] - distinct[0]) / max(index.max(), 1.0))
    at = (x - distinct[0]) / step
    if np.abs(at - np.rint(at)).max() > _OFF:
        return None
    return np.rint(at).astype(np.int64), step


def on_grid(x: Array, y: Array, z: Array) -> Grid | None:
    """Return points (n,) as a map, NaN at places without one; None if they lie on no grid."""
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        return None
    along_x, along_y = _places(x), _places(y)
    if along_x is None or along_y is None:
        return None
    (i, step_x), (j, step_y) = along_x, along_y
    columns, rows = int(i.max()) + 1, int(j.max()) + 1
    if x.size < _FILLED * rows * columns or rows * columns > 2**27:
        return None
    place = j * columns + i
    taken = np.zeros(rows * columns, dtype=bool)
    taken[place] = True
    twice = place.size - int(np.count_nonzero(taken))
    if twice > _TWICE * place.size:
        return None
    values = np.full(rows * columns, np.nan)
    values[place] = z
    note = f"{x.size} points on a grid of {columns} x {rows}"
    note += f", {twice} of them twice: the last counts" if twice else ""
    return Grid(values.reshape(rows, columns), (step_x, step_y), note)


def scattered(x: Array, y: Array, z: Array, pixel: float | None = None) -> Grid:
    """Return points (n,) that lie on no grid as a map, linear between them, NaN around them.

    Parameters
    ----------
    x, y, z : (n,) array
        n at least 4, not on a line.
    pixel : float, optional
        Step of the map, in the unit of x and y; by default the points' mean distance.
    """
    from scipy.interpolate import LinearNDInterpolator  # slow to import, and rarely needed

    good = np.isfinite(x) & np.isfinite(y) & np.isfinite(z)
    x, y, z = x[good], y[good], z[good]
    width, height = float(np.ptp(x)), float(np.ptp(y))
    step = pixel or (width * height / x.size) ** 0.5
    columns, rows = max(int(width / step), 1), max(int(height / step), 1)
    if rows * columns > MOST_PER_POINT * max(x.size, 1000):
        raise OverflowError("the step is too small for the points' extent")
    u = x.min() + step * (np.arange(columns) + 0.5)
    v = y.min() + step * (np.arange(rows) + 0.5)
    values = LinearNDInterpolator(np.column_stack([x, y]), z)(u[None, :], v[:, None])
    note = (
        f"{x.size} points that lie on no grid: between them the map is linear, {columns} x {rows}"
    )
    return Grid(np.asarray(values), (step, step), note)


def stray(x: Array, y: Array) -> int | None:
    """Return the point (of n) that is far from all others, as a damaged number makes it, or None.

    A map that reached it would be one of triangles between that point and the rest.
    """
    farthest, at = _FAR, None
    for places in (x, y):
        low, middle, high = np.quantile(places, [0.01, 0.5, 0.99], method="nearest")
        away = np.abs(places - middle)
        if high > low and (ratio := float(away.max()) / float(high - low)) > farthest:
            farthest, at = ratio, int(np.argmax(away))
    return at if x.size >= _SEVERAL else None


def profile(x: Array, z: Array) -> Grid | None:
    """Return places and heights (n,) as a line of heights at even steps; None if x does not grow.

    Uneven places get heights at their mean distance, linear between them.
    """
    if not np.isfinite(x).all() or x.size < 3:
        return None
    step = np.diff(x)
    if not (step > 0.0).all():
        if not (step < 0.0).all():
            return None
        x, z = x[::-1], z[::-1]
    mean = float((x[-1] - x[0]) / (x.size - 1))
    even = x[0] + mean * np.arange(x.size)
    # Decimals that were cut off are no uneven steps.
    off = float(np.abs(x - even).max()) / mean
    if off < 0.5:
        return Grid(z, (mean, mean), f"two columns: {x.size} places in a row, and heights")
    note = (
        f"two columns: {x.size} places in a row, up to {off:.2g} steps off even ones: "
        "their heights are interpolated"
    )
    return Grid(np.interp(even, x, z), (mean, mean), note)
