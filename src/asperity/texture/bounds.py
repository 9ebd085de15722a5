"""Upper bounds of a spline surface and its derivatives over blocks of cells.

A B-spline lies in the convex hull of its coefficients, so the largest coefficient on which a cell
depends bounds the surface over that cell. Its second derivatives are B-splines of the second
differences of the coefficients. Pyramids of such maxima let a search prune whole regions with a
certificate.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array, Indices


class Pyramid(NamedTuple):
    """Bounds over blocks of `2**level` cells a side, all levels in flat arrays."""

    heights: Array
    """Upper bound of the surface; level after level, each row-major."""
    curvatures: Array
    """Upper bound of the second derivative in any direction [per sample squared]."""
    changes: Array
    """Upper bound of the absolute third derivative [per sample cubed]."""
    offsets: Indices
    """Index of the first entry of each level, (levels,)."""
    shapes: Indices
    """Rows and columns of each level, (levels, 2); a 1-D spline has one row."""


def pyramid_of(coefficients: Array) -> Pyramid:
    """Return the bounds of the cells of padded spline `coefficients`, and of blocks of them.

    Parameters
    ----------
    coefficients : (n,) or (nv, nu) array
        As from `asperity.texture.spline.spline_coefficients`: cell `i` depends on entries
        `i .. i + 3`.
    """
    c = np.atleast_2d(coefficients)
    if coefficients.ndim == 2:
        along_u, along_v = _derivative(c, 2, 0), _derivative(c, 0, 2)
        # Gershgorin: no eigenvalue of the Hessian exceeds the larger row sum.
        curvatures = np.maximum(along_u, along_v) + _derivative(c, 1, 1, size=True)
        thirds = [_derivative(c, nu, 3 - nu, size=True) for nu in range(4)]
        level = (_derivative(c, 0, 0), curvatures, np.maximum.reduce(thirds))
    else:
        third = np.abs(np.diff(c, 3, axis=1))
        level = (_running(c, 4, 1), _running(np.diff(c, 2, axis=1), 2, 1), third)
    levels = [level]
    while max(level[0].shape) > 1:
        level = tuple(halved(halved(part, 0), 1) for part in level)  # type: ignore[assignment]
        levels.append(level)
    sizes = [entry[0].size for entry in levels]
    heights, curvatures, changes = (
        np.concatenate([entry[k].ravel() for entry in levels]) for k in range(3)
    )
    offsets = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64)
    shapes = np.array([entry[0].shape for entry in levels], dtype=np.int64)
    return Pyramid(heights, curvatures, changes, offsets, shapes)


def _derivative(c: Array, order_u: int, order_v: int, size: bool = False) -> Array:
    """Return the largest (or largest absolute) coefficient of a partial derivative for every cell.

    The derivative of order m of a cubic B-spline is a B-spline of the m-th differences, of which a
    cell depends on 4 - m.
    """
    differences = np.diff(np.diff(c, order_u, axis=1), order_v, axis=0)
    values = np.abs(differences) if size else differences
    return _running(_running(values, 4 - order_v, 0), 4 - order_u, 1)


def _running(values: Array, width: int, axis: int) -> Array:
    """Return the running maximum of `width` neighbours along `axis`."""
    count = values.shape[axis] - width + 1
    return np.maximum.reduce([values.take(range(a, a + count), axis) for a in range(width)])


def halved(level: NDArray[Any], axis: int) -> NDArray[Any]:
    """Return the maxima of neighbouring pairs along `axis`; an odd last entry is kept."""
    if level.shape[axis] == 1:
        return level
    level = np.moveaxis(level, axis, 0)
    out = level[::2].copy()
    np.maximum(out[: len(level) // 2], level[1::2], out=out[: len(level) // 2])
    return np.moveaxis(out, 0, axis)
