"""Numbers of large texts: pandas parses them several times faster than NumPy.

Only plain tables are parsed: anything else is left to readers that know what to say of it. Small
texts are too, since the import of pandas takes longer than they do.
"""

from __future__ import annotations

import csv
import importlib
import io
from collections.abc import Sequence
from typing import Any

import numpy as np

from asperity._core.arrays import Array

LARGE = 200_000
"""Characters from which a text is large."""


def numbers_of(
    text: str, separator: str | None, columns: Sequence[int] | None = None
) -> Array | None:
    """Return the numbers of a large text, (rows, columns), as exact as NumPy's.

    Parameters
    ----------
    text : str
        Rows with decimal points; what stands behind a # and blank lines are left out.
    separator : str or None
        None where white space separates.
    columns : sequence of int, optional
        By default all.

    Returns
    -------
    array or None
        None for a text that is not large, or in which a row of these columns is cut short, longer
        than the first, or holds anything but numbers (`nan` too).
    """
    if len(text) < LARGE:
        return None
    pandas = importlib.import_module("pandas")
    content = text.encode()
    options: dict[str, Any] = {}
    if tuple(map(int, pandas.__version__.split(".")[:2])) < (3, 1):  # then exact by default
        options["float_precision"] = "round_trip"
    if not any(letter in content for letter in (b"r", b"R", b"l", b"L")):
        options["dtype"] = np.float64  # faster, but takes True and False for numbers
    try:
        table = pandas.read_csv(
            io.BytesIO(content),
            header=None,
            sep=r"\s+" if separator is None else separator,
            comment="#" if b"#" in content else None,
            quoting=csv.QUOTE_NONE,
            keep_default_na=False,  # so that words and empty cells are no numbers
            skipinitialspace=True,
            low_memory=False,
            **options,
        )
    except (ValueError, OverflowError):  # of pandas' parser too
        return None
    if columns is not None:
        if max(columns, default=0) >= table.shape[1]:
            return None
        table = table.iloc[:, list(columns)]
    if any(dtype.kind not in "iuf" for dtype in table.dtypes):
        return None
    return np.ascontiguousarray(table.to_numpy(dtype=np.float64))
