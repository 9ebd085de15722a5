"""Finding and opening what commands read."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from asperity.errors import AsperityError

if TYPE_CHECKING:
    import xarray as xr


def measured_folder(given: Path | None) -> Path | None:
    """Return the folder of measured surfaces: the given one, or the usual one where it is."""
    if given is not None:
        if not given.is_dir():
            raise AsperityError(f"no such folder of measured surfaces: {given}")
        return given
    beside = Path("../shared/data/measured")
    return beside if beside.is_dir() else None


def open_dataset(path: Path) -> xr.Dataset:
    """Return a dataset that `asperity` wrote, read into memory."""
    import xarray as xr

    if not os.path.exists(path):
        raise AsperityError(f"no such file: {path}; give one that asperity study wrote")
    if path.is_dir():
        raise AsperityError(f"{path} is a folder; give a .nc file in it")
    if path.stat().st_size == 0:
        raise AsperityError(f"{path} is empty; give a .nc file that asperity study wrote")
    try:
        with xr.open_dataset(path, engine="h5netcdf") as data:
            data.load()
    except Exception as error:  # h5netcdf raises several kinds for files that are not HDF5
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise AsperityError(f"{path} is not a dataset that can be read: {reason}") from None
    if data.attrs.get("schema") != 1:
        raise AsperityError(f"{path} is no run of asperity's; give one that asperity study wrote")
    return data
