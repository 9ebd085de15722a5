"""Points of LAS and its packed form LAZ, which laspy reads."""

from __future__ import annotations

import importlib
from pathlib import Path

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError

_MOST_PACKED = 200
"""By how much LAZ may pack points."""


_NOISE = (7, 18)
"""Classes of noise, low and high (LAS 1.4-R15, table 17)."""


def read_las(path: Path) -> tuple[Array, None, tuple[str, ...]]:
    """Return the points (n, 3) of a LAS or LAZ file, no unit, and notes.

    Points that it marks as withheld or as noise are left out.

    Raises
    ------
    AsperityError
        A file that is damaged or cut short, or laspy is not installed; one line.
    """
    try:
        laspy = importlib.import_module("laspy")
    except ImportError:
        raise AsperityError(
            f"{path}: {path.suffix} files need a reader that is not installed; "
            "valid: pip install 'asperity[las]', or a text of x, y and z"
        ) from None
    _check_las_head(path)
    try:
        with laspy.open(path) as file:
            count, size = file.header.point_count, file.header.point_format.size
            if count * size > _MOST_PACKED * path.stat().st_size:
                raise AsperityError(
                    f"{path}: it is cut short or damaged: its head counts {count} points"
                )
            cloud = file.read()
    except (MemoryError, KeyboardInterrupt, SystemExit, AsperityError):
        raise
    except BaseException:  # also panics of lazrs, which are no `Exception`
        raise AsperityError(
            f"{path}: cannot be read as a {path.suffix} file: it is damaged or cut short"
        ) from None
    if len(cloud.xyz) < count:
        raise AsperityError(
            f"{path}: it is cut short: its head counts {count} points, there are {len(cloud.xyz)}"
        )
    places = np.asarray(cloud.xyz, dtype=np.float64)
    withheld = np.asarray(cloud.withheld, dtype=bool)
    left_out = withheld | np.isin(np.asarray(cloud.classification), _NOISE)
    if not left_out.any() or left_out.all():
        return places, None, ()
    count = np.count_nonzero(left_out)
    note = f"{count} points are left out: the file marks them as noise or withheld"
    return places[~left_out], None, (note,)


def _check_las_head(path: Path) -> None:
    """Refuse a LAS file whose head counts more records than it can hold: laspy reads them all."""
    with path.open("rb") as file:
        head = file.read(375)
    if head[:4] != b"LASF" or len(head) < 227:
        raise AsperityError(f"{path}: cannot be read as a {path.suffix} file: it has no head LASF")
    records = int.from_bytes(head[100:104], "little") * 54
    if head[25] >= 4 and len(head) == 375:  # extended ones of LAS 1.4
        records += int.from_bytes(head[243:247], "little") * 60
    if records > path.stat().st_size:
        raise AsperityError(
            f"{path}: it is cut short or damaged: its head counts records of {records} bytes"
        )
