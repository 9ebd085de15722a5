"""Types of arrays in annotations; shapes and units are in the docstrings."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]


def row_lengths(rows: Array) -> Array:
    """Return the lengths (n,) of rows (n, k): those of `np.linalg.norm`, which takes longer."""
    squares: Array = np.linalg.vecdot(rows, rows)
    return np.sqrt(squares, out=squares)
