"""A recording as files that other programs take: CSV, WAV and PNG.

Everything here takes the dataset that `open_recording` gives, or a part of one:

>>> data = asperity.open_recording("out/record").sel(time=slice(1.0, 3.0))
>>> write_csv(data, Path("felt.csv"))
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError
from asperity.runs.sound import Sound, from_acceleration
from asperity.runs.tool_motion import Traces, traces

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

_BLOCK = 20_000
"""Rows that are written at once: a long recording is never in memory as a whole."""
_WHOLE = ("contact_count", "flags")
_FEWEST = 8


def write_csv(data: xr.Dataset, path: Path) -> int:
    """Write one line a tick, with the units in the header; return how many ticks there were.

    Columns are named as the dataset's variables, with the axis after an underscore, then the unit
    in brackets: `contact_force_z [N]`. Numbers have nine digits.
    """
    columns = list(_columns(data))
    names = [name for name, _, _ in columns]
    ticks = data.sizes["time"]
    with open(path, "w", encoding="utf-8", newline="") as file:
        file.write(",".join(names) + "\n")
        for first in range(0, ticks, _BLOCK):
            part = data.isel(time=slice(first, first + _BLOCK)).load()
            rows = np.column_stack(
                [part[v].values if e is None else part[v].values[:, e] for _, v, e in columns]
            )
            formats = ["%d" if v in _WHOLE else "%.9g" for _, v, _ in columns]
            np.savetxt(file, rows, fmt=formats, delimiter=",")
    return ticks


def csv_bytes(data: xr.Dataset) -> bytes:
    """Return what `write_csv` writes."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recording.csv"
        write_csv(data, path)
        return path.read_bytes()


def _columns(data: xr.Dataset) -> Iterator[tuple[str, str, int | None]]:
    """Give each column's heading, its variable, and which of its elements it is."""
    yield f"time [{data['time'].attrs.get('units', 's')}]", "time", None
    for name in data.data_vars:
        values = data[name]
        units = values.attrs.get("units", "1")
        if values.dims == ("time",):
            yield f"{name} [{units}]", str(name), None
        else:
            for i, label in enumerate(data[values.dims[1]].values):
                yield f"{name}_{label} [{units}]", str(name), i


def traces_of(data: xr.Dataset) -> Traces:
    """Return the traces of a recording, or of a part of one; at least 8 ticks."""
    time = np.asarray(data["time"].values, dtype=np.float64)
    if len(time) < _FEWEST:
        raise AsperityError(f"{len(time)} ticks are too few; at least {_FEWEST} are needed")
    force, torque = data["contact_force"].values, data["contact_torque"].values
    known = "penetration_depth" in data
    depth = data["penetration_depth"].values if known else np.full(len(time), np.nan)
    return traces(time, data["tool_position"].values, np.hstack([force, torque]), depth)


def is_prescribed(data: xr.Dataset) -> bool:
    """Return whether the tool of a recording could not yield: texture did not shake it."""
    return data.attrs.get("hand") == "none" and data.attrs.get("coupling") == "direct"


def sound_of(shown: Traces, *, rate: int = 44100, source: str = "") -> Sound:
    """Return the acceleration of the tool as sound: its three axes in one wave (DFT321).

    The loudest sample stands 1 dB below full scale; `Sound.gain` is the acceleration at full scale.
    A loop of 1 kHz knows nothing above 500 Hz, and nothing is made up there.

    Parameters
    ----------
    shown : Traces
    rate : int
        Of the sound [Hz], 1000 to 192000.
    source : str
        Where it comes from, in words.
    """
    return from_acceleration(shown.wave(), shown.step, rate=rate, source=source)


def wav_bytes(sound: Sound) -> bytes:
    """Return what `Sound.write` writes."""
    out = io.BytesIO()
    sound.write(out)
    return out.getvalue()


def figures(shown: Traces, title: str) -> dict[str, Figure]:
    """Return the figures of a stretch: `traces` over time, and the `spectrum` of the shaking."""
    from asperity.runs.figures import shaking_figure, traces_figure

    return {"traces": traces_figure(shown, title), "spectrum": shaking_figure(shown, title)}


def png_bytes(figure: Figure) -> bytes:
    """Return a figure as PNG."""
    out = io.BytesIO()
    figure.savefig(out, format="png")
    return out.getvalue()


def part_of(data: xr.Dataset, start: float = 0.0, seconds: float | None = None) -> xr.Dataset:
    """Return the ticks from `start` on [s] for so many seconds; refuse where there are none."""
    time: Array = data["time"].values
    if not len(time):
        raise AsperityError("the recording has no ticks")
    end = np.inf if seconds is None else start + seconds
    out = data.isel(time=slice(*np.searchsorted(time, (start, end)).tolist()))
    if out.sizes["time"] == 0:
        raise AsperityError(
            f"no ticks from {start:g} s on: the recording goes from {time[0]:g} to {time[-1]:g} s"
        )
    return out
