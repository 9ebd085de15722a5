"""Input files of commands: measured surfaces and datasets that `asperity` wrote."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from asperity.errors import AsperityError

if TYPE_CHECKING:
    import xarray as xr


def measured_folder(given: Path | None) -> Path | None:
    """Return the folder of measured surfaces: the given one, else the default one if it exists."""
    if given is not None:
        if not given.is_dir():
            raise AsperityError(f"no such folder of measured surfaces: {given}")
        return given
    default = Path("../shared/data/measured")
    return default if default.is_dir() else None


def open_dataset(path: Path) -> xr.Dataset:
    """Return a dataset that `asperity study` or `asperity demo` wrote, read into memory."""
    import xarray as xr

    if not os.path.exists(path):
        raise AsperityError(f"no such file: {path}; give a .nc file that asperity study wrote")
    if path.is_dir():
        found = sorted(file.name for file in path.glob("*.nc"))
        if found:
            raise AsperityError(f"{path} is a folder; give a .nc file in it: {', '.join(found)}")
        raise AsperityError(
            f"{path} is a folder without a .nc file that asperity study wrote"
            + "; for the sound of a run: asperity export" * (path / "recording.h5").is_file()
        )
    if path.stat().st_size == 0:
        raise AsperityError(f"{path} is empty; give a .nc file that asperity study wrote")
    try:
        with xr.open_dataset(path, engine="h5netcdf") as data:
            data.load()
    except Exception as error:  # h5netcdf raises several kinds for files that are not HDF5
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise AsperityError(f"{path} cannot be read as a dataset: {reason}") from None
    if data.attrs.get("schema") != 1:
        raise AsperityError(
            f"{path} was not written by asperity (schema {data.attrs.get('schema')!r}, must be 1); "
            "give a .nc file that asperity study wrote"
        )
    return data
