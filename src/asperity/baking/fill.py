"""Smooth filling of gaps in a map, at a cost independent of their size."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from asperity._core.arrays import Array

_ROUNDS = 8
"""Smoothing passes at each scale."""


def filled(grid: Array) -> Array:
    """Return a map with its NaNs replaced by a smooth continuation of their surroundings.

    Means of the known values are computed on coarser and coarser grids; the gaps are filled from
    the coarsest grid down and smoothed on each.
    """
    known = np.isfinite(grid)
    if not known.any():
        return np.zeros(grid.shape)
    values, weights = [np.where(known, grid, 0.0)], [known.astype(np.float64)]
    while min(values[-1].shape) > 1 and (weights[-1] == 0.0).any():
        v, w = (_summed(a) for a in (values[-1] * weights[-1], weights[-1]))
        values.append(np.where(w > 0.0, v / np.maximum(w, 1e-300), 0.0))
        weights.append(np.minimum(w, 1.0))
    whole = values[-1]
    for v, w in zip(values[-2::-1], weights[-2::-1], strict=True):
        rows, columns = v.shape
        coarse = ndimage.zoom(whole, 2, order=1, mode="nearest", grid_mode=True)
        whole = np.where(w > 0.0, v, coarse[:rows, :columns])
        for _ in range(_ROUNDS):
            mean = ndimage.uniform_filter(whole, 3, mode="nearest")
            whole = np.where(w > 0.0, v, mean)
    return np.where(known, grid, whole)


def _summed(array: Array) -> Array:
    """Return sums over blocks of two by two; an odd last row or column is a block by itself."""
    rows, columns = array.shape
    even = np.pad(array, ((0, rows % 2), (0, columns % 2)))
    return np.asarray(even.reshape(even.shape[0] // 2, 2, -1, 2).sum(axis=(1, 3)))
