"""Upper bounds of a spline surface over blocks of cells.

A B-spline lies in the convex hull of its coefficients, so the largest of the coefficients that a
cell depends on bounds the surface over that cell from above. A pyramid of such maxima lets a
search discard whole regions, and what it finds is then certified, not merely likely.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class MaxPyramid(NamedTuple):
    """Maxima over blocks of `2**level` cells a side, all levels in one flat array."""

    values: NDArray[np.float64]
    """Level after level, each row-major."""
    offsets: NDArray[np.int64]
    """Where each level begins in `values`, shape (levels,)."""
    shapes: NDArray[np.int64]
    """Rows and columns of each level, shape (levels, 2); a 1-D spline has one row."""


def max_pyramid(coefficients: NDArray[np.float64]) -> MaxPyramid:
    """Return the pyramid of maxima of the cells of padded spline `coefficients`.

    Parameters
    ----------
    coefficients : (n,) or (nv, nu) array
        As `asperity.texture.spline.spline_coefficients` returns them: cell `i` depends on
        entries `i .. i + 3`.
    """
    level = np.atleast_2d(coefficients)
    if coefficients.ndim == 2:
        level = np.maximum.reduce([level[a : level.shape[0] - 3 + a] for a in range(4)])
    level = np.maximum.reduce([level[:, a : level.shape[1] - 3 + a] for a in range(4)])
    levels = [level]
    while max(level.shape) > 1:
        level = _halve(_halve(level, 0), 1)
        levels.append(level)
    sizes = [entry.size for entry in levels]
    return MaxPyramid(
        values=np.concatenate([entry.ravel() for entry in levels]),
        offsets=np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64),
        shapes=np.array([entry.shape for entry in levels], dtype=np.int64),
    )


def _halve(level: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    """Return the maxima of neighbouring pairs along `axis`; an odd one at the end stays."""
    if level.shape[axis] == 1:
        return level
    return np.maximum.reduceat(level, np.arange(0, level.shape[axis], 2), axis=axis)
