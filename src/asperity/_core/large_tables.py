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
    options: dict[str, Any] = {}
    if tuple(map(int, pandas.__version__.split(".")[:2])) < (3, 1):  # then exact by default
        options["float_precision"] = "round_trip"
    try:
        table = pandas.read_csv(
            io.BytesIO(text.encode()),
            header=None,
            sep=r"\s+" if separator is None else separator,
            comment="#" if "#" in text else None,
            quoting=csv.QUOTE_NONE,
            keep_default_na=False,  # so that words and empty cells are no numbers
            skipinitialspace=True,
            low_memory=False,
            **options,
        )
    except (ValueError, OverflowError):  # of pandas' parser too
        return None
    chosen = range(table.shape[1]) if columns is None else columns
    if max(chosen, default=0) >= table.shape[1]:
        return None
    parts = [table[at].to_numpy() for at in chosen]
    if any(part.dtype.kind not in "iuf" for part in parts):
        return None
    return np.stack(parts, axis=1, dtype=np.float64, casting="unsafe")
