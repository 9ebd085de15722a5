"""Points of PTX, Leica's text of scans, each in its frame.

A scan is columns and rows, the scanner's place and axes, a matrix (4, 4) for rows `x y z 1`, and a
line for each point; `0 0 0` is where nothing was seen.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from asperity._core.arrays import Array
from asperity._core.files import columns_of, text_of
from asperity._core.unpacking import content_of
from asperity.errors import AsperityError

_PLACE, _MATRIX = slice(0, 10), slice(6, 10)
"""Lines above the points of a scan, and those of its matrix."""


def read_ptx(path: Path) -> tuple[Array, tuple[str, ...]]:
    """Return the points (n, 3) of all scans in a file, in their common frame, and notes.

    Raises
    ------
    AsperityError
        A file that is damaged or cut short; one line.
    """
    lines = text_of(content_of(path)).rstrip().split("\n")
    at, scans, unseen = 0, [], 0
    while at < len(lines):
        head = lines[at:][_PLACE]
        try:
            count = int(head[0]) * int(head[1])
            matrix = np.array([line.split() for line in head[_MATRIX]], dtype=np.float64)
            if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
                raise ValueError(matrix.shape)
        except (ValueError, IndexError):
            raise AsperityError(
                f"{path}: line {at + 1} begins no scan; valid: columns, rows, and 8 lines of its "
                "place, as a .ptx file has them"
            ) from None
        first = at + len(head)
        body = lines[first : first + count]
        places = columns_of(body, (0, 1, 2))
        if places is None or len(places) < count:
            raise AsperityError(
                f"{path}: damaged or cut short: the scan at line {at + 1} counts {count} points, "
                f"{0 if places is None else len(places)} lines of x, y, z follow"
            )
        seen = places.any(axis=1)
        unseen += int(np.count_nonzero(~seen))
        scans.append(places[seen] @ matrix[:3, :3] + matrix[3, :3])
        at = first + count
    notes = [f"{len(scans)} scans put together"] if len(scans) > 1 else []
    if unseen:
        notes.append(f"{unseen} points at 0 0 0, where nothing was seen, are left out")
    return np.concatenate(scans), tuple(notes)
