"""A recording as an xarray Dataset: every quantity under its own name, with one unit each.

The file keeps poses and wrenches as they travel, in one array each, whose numbers have two units.
Here they are apart: `handle_position` [m] and `handle_orientation` [1], `contact_force` [N] and
`contact_torque` [N m]. Nothing is read before it is looked at, so that an hour at 1 kHz, which is
some 800 MB, opens at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from asperity._core.data import table_beside
from asperity.errors import AsperityError
from asperity.runs.recording import described, recording_file, require_recording

if TYPE_CHECKING:
    import xarray as xr

_AXES, _PARTS = ("x", "y", "z"), ("w", "x", "y", "z")
_SPLIT = table_beside(__file__, "variables.toml")["dataset"]
_WHOLE = ("penetration_depth", "contact_count", "flags")


def open_recording(file: str | Path) -> xr.Dataset:
    """Open a recording as a dataset with named dimensions and units.

    Also one whose session was killed: then as far as it got. One that is still being written has
    to be stopped first. The data are read from the file when they are used; `.load()` takes all of
    them into memory, `.close()` or a `with` block gives the file back.

    Parameters
    ----------
    file : str or Path
        `recording.h5`, or the folder it is in.

    Returns
    -------
    xarray.Dataset
        Over `time` [s]: `handle_position`, `tool_position` [m] and `contact_force`,
        `device_force` [N], `contact_torque`, `device_torque` [N m] over `axis` (x, y, z; those of
        the world); `handle_orientation`, `tool_orientation` over `quaternion` (w, x, y, z);
        `penetration_depth` [m] (absent from older recordings), `contact_count`, `flags` (its
        attributes say what each bit means). `units` and `long_name` are attributes of each. The
        dataset's attributes say what it was recorded from: `scene`, `source`, `device` or
        `trajectory`, `dt` [s], `coupling`, `version`, and `document`, the scene's settings (JSON).

    Raises
    ------
    AsperityError
        There is no such file, it is no recording, or it is still being written.

    Examples
    --------
    >>> data = asperity.open_recording("out/record")
    >>> data.contact_force.sel(axis="z", time=slice(1.0, 2.0)).plot()
    """
    import xarray as xr

    path = recording_file(file)
    rows = require_recording(path)
    try:
        raw = xr.open_dataset(
            path, engine="h5netcdf", decode_times=False, decode_timedelta=False, cache=False
        )
    except (OSError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise AsperityError(f"{path} cannot be opened: {reason}") from None
    # Killed amid a flush, some variables may have more rows than there are times.
    out = _split(raw.isel(time=slice(rows)))
    out.set_close(raw.close)
    return out


def dataset_of(variables: Mapping[str, NDArray[Any]], attributes: Mapping[str, Any]) -> xr.Dataset:
    """Return the dataset that `open_recording` would give of arrays that are in memory.

    Parameters
    ----------
    variables : mapping
        `time` and every variable of a recording, as `RecordingWriter.add_rows` takes them.
    attributes : mapping
        Of the recording.
    """
    import xarray as xr

    text = described()
    raw = xr.Dataset(
        {
            name: (text[name][0], values, text[name][1])
            for name, values in variables.items()
            if name in text
        },
        coords={"time": ("time", variables["time"], {"units": "s"})},
        attrs=dict(attributes),
    )
    return _split(raw)


def _split(raw: xr.Dataset) -> xr.Dataset:
    """Return the variables of a file apart, each with one unit."""
    import xarray as xr

    parts: dict[str, Any] = {}
    for name, (whole, first, dim, units, text) in _SPLIT.items():
        along = raw[whole].dims[1]
        count = len(_AXES if dim == "axis" else _PARTS)
        part = (
            raw[whole]
            .isel({along: slice(first, first + count)})
            .drop_vars([along], errors="ignore")
        )
        parts[name] = part.rename({along: dim}).assign_attrs(units=units, long_name=text)
        if dim == "axis":
            parts[name].attrs["frame"] = "world"
    for name in _WHOLE:
        if name in raw:
            parts[name] = raw[name]
    return xr.Dataset(
        parts,
        coords={"axis": np.array(_AXES), "quaternion": np.array(_PARTS)},
        attrs={key: value for key, value in raw.attrs.items() if value != ""},
    )
