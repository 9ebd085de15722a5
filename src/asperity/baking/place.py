"""Choice of a stroke for a probe over an arbitrary surface.

Seen from above the object is a height map, and the probe moves straight and level. The stroke is
the longest line over which the map changes so little that the probe stays in contact.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy import ndimage

from asperity._core.arrays import Array
from asperity.baking.rays import FullSurface

DIAMETER = 3e-3
"""Radius of the probe's tip on objects of ten times that size or more [m]."""
_SHARE = 0.1
PRESSED = 0.5
"""Initial depth of the probe, in radii of its tip; a deeper one would reach around edges."""
_LEVEL = 0.4
"""Largest change of height along the line, in that depth."""
_SAMPLES = 256
_LENGTHS = (0.6, 0.45, 0.3, 0.2, 0.12, 0.08, 0.05, 0.03, 0.02)
"""Lengths of the line, in extents of the object, longest first."""
_LONGEST = 0.06
"""[m]."""
_CLEARANCE = 2e-4


class Stroke(NamedTuple):
    """Start of the probe's centre [m], and its line: direction [rad], length [m]."""

    start: Array
    direction: float
    length: float
    radius: float


def stroke_over(surface: FullSurface, triangles: Array) -> Stroke:
    """Return a level line over the top of a surface, and the probe's start.

    Parameters
    ----------
    surface : FullSurface
    triangles : (m, 3, 3) array
        Its triangles [m].
    """
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    extent = float((high - low)[:2].max())
    radius = 0.5 * min(DIAMETER, _SHARE * float((high - low).max()))
    step, level = extent / _SAMPLES, _LEVEL * PRESSED * radius
    x, y = (np.arange(low[k] + 0.5 * step, high[k] + 0.5 * step, step) for k in (0, 1))
    points = np.stack([*np.meshgrid(x, y), np.full((len(y), len(x)), high[2])], axis=-1)
    fallen = surface.seen(points.reshape(-1, 3), np.array([0.0, 0.0, -1.0]))
    top = high[2] - fallen.reshape(points.shape[:2])  # NaN: no surface
    best: tuple[float, Array, float, float] | None = None
    for share in _LENGTHS:
        length = min(share * extent, _LONGEST)
        for axis, direction in ((1, 0.0), (0, 0.5 * np.pi)):
            found = _flattest(top, max(2, round(length / step)), axis, level)
            if found is None:
                continue
            change, row, column = found
            if best is None or change < 0.5 * best[0]:
                place = np.array([x[column], y[row], _highest(top, row, column, radius / step)])
                best = (change, place, direction, length)
        if best is not None and best[0] < level:
            break
    if best is None:  # no surface from above: the probe begins over the middle
        middle = 0.5 * (low + high)
        best = (0.0, np.array([middle[0], middle[1], high[2]]), 0.0, 0.1 * extent)
    _, place, direction, length = best
    place[2] += radius + _CLEARANCE
    return Stroke(place, direction, float(length), radius)


def _flattest(top: Array, count: int, axis: int, level: float) -> tuple[float, int, int] | None:
    """Return the range of a map along the best line of `count` samples, and its first sample.

    Of the lines that are level enough it is the one farthest from edges beside it.
    """
    if top.shape[axis] <= count:
        return None
    windows = np.lib.stride_tricks.sliding_window_view(top, count, axis=axis)
    whole: Any = np.isfinite(windows).all(axis=-1)
    if not whole.any():
        return None
    change = np.where(whole, np.ptp(np.where(whole[..., None], windows, 0.0), axis=-1), np.inf)
    seen: Any = np.pad(np.isfinite(top), 1)
    margin = np.asarray(ndimage.distance_transform_edt(seen))[1:-1, 1:-1]
    room = np.lib.stride_tricks.sliding_window_view(margin, count, axis=axis).min(axis=-1)
    worth = np.where(whole, np.maximum(change, level) - level * room / room.max(), np.inf)
    row, column = np.unravel_index(int(np.argmin(worth)), worth.shape)
    return float(change[row, column]), int(row), int(column)


def _highest(top: Array, row: int, column: int, reach: float) -> float:
    """Return the highest position within some samples of another."""
    r = int(np.ceil(reach)) + 1
    part = top[max(row - r, 0) : row + r + 1, max(column - r, 0) : column + r + 1]
    return float(np.nanmax(part))
