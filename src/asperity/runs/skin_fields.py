"""Pressure and shear of a soft body or of a rigid tool over time: in a recording, and read from it.

The group `skin` of `recording.h5` holds `time` (frames,) [s], `pressure` (frames, rows, columns)
and `shear` (frames, rows, columns, 2) [Pa], and where the rows and columns lie [m].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError
from asperity.runs.recording import recording_file


@dataclass(frozen=True, eq=False)
class SkinFields:
    """Pressure and shear of a skin, a frame each.

    `time` (n,) [s]; `pressure` (n, rows, columns) [Pa]; `shear` (n, rows, columns, 2) [Pa], along
    columns and along rows; `column`, `row`: where the middles of columns and rows lie, seen along
    the direction that the skin faces [m].
    """

    time: Array
    pressure: Array
    shear: Array
    column: Array
    row: Array


class FieldGrid(Protocol):
    """Where fields are: rows and columns, and the grid's ends along columns and rows [m]."""

    @property
    def taxels(self) -> Sequence[int]: ...  # noqa: D102
    @property
    def extent(self) -> tuple[float, float, float, float]: ...  # noqa: D102


class Fields(Protocol):
    """Pressure (rows, columns) and shear (rows, columns, 2) of the last pose [Pa]."""

    @property
    def pressure(self) -> Array: ...  # noqa: D102
    @property
    def shear(self) -> Array: ...  # noqa: D102


class FieldWriter:
    """Adds frames to an open recording.

    Parameters
    ----------
    file : h5py.File
    grid : FieldGrid
    """

    def __init__(self, file: Any, grid: FieldGrid) -> None:
        rows, columns = grid.taxels
        group = file.create_group("skin")
        first, last, low, high = grid.extent
        group["column"] = first + (np.arange(columns) + 0.5) * ((last - first) / columns)
        group["row"] = low + (np.arange(rows) + 0.5) * ((high - low) / rows)
        texts = {
            "time": ((), "s", "time since the first tick"),
            "pressure": ((rows, columns), "Pa", "pressure along the ray of each taxel"),
            "shear": ((rows, columns, 2), "Pa", "traction across it, along columns and rows"),
        }
        self._data = {}
        for name, (shape, unit, text) in texts.items():
            data = group.create_dataset(
                name, (0, *shape), "f8" if name == "time" else "f4", maxshape=(None, *shape),
                chunks=(1 if shape else 256, *shape), compression="gzip" if shape else None,
                compression_opts=1 if shape else None,
            )  # fmt: skip
            data.attrs.update(units=unit, long_name=text)
            self._data[name] = data
        for name in ("column", "row"):
            group[name].attrs.update(units="m", long_name=f"middle of each {name}")

    def add(self, time: float, fields: Fields) -> None:
        """Add the fields of the last pose."""
        count = len(self._data["time"])
        values = {"time": time, "pressure": fields.pressure, "shear": fields.shear}
        for name in ("pressure", "shear", "time"):
            self._data[name].resize(count + 1, axis=0)
            self._data[name][count] = values[name]


def read_fields(path: str | Path) -> SkinFields:
    """Return the pressure and shear fields in a recording.

    Parameters
    ----------
    path : str or Path
        `recording.h5`, or the folder it is in.

    Raises
    ------
    AsperityError
        There is no such file, or it has no fields.
    """
    import h5py

    file = recording_file(path)
    try:
        with h5py.File(file, "r") as opened:
            group = opened.get("skin")
            if group is None:
                raise AsperityError(f"{file} has no pressure fields; record with --field-rate-hz")
            n = len(group["time"])
            parts = {name: group[name][:n] for name in ("time", "pressure", "shear")}
            return SkinFields(**parts, column=group["column"][:], row=group["row"][:])
    except OSError as error:
        reason = " ".join(str(error).split())
        raise AsperityError(f"{file} cannot be read as HDF5: {reason}") from None
