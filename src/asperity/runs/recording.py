"""`recording.h5`: what happened in a run, tick by tick, in HDF5 with dimension scales.

Written while the run goes on and flushed every half second, so that a killed run leaves a file
that opens. Any reader of HDF5 or netCDF-4 opens it. `open_recording` gives it as a labelled dataset
that is read when it is looked at, `read_recording` as arrays in memory.
"""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from asperity._core.arrays import Array, Indices
from asperity._core.data import table_beside
from asperity.errors import AsperityError, OutputError
from asperity.runs.recording_file import RecordingFile
from asperity.simulation.simulation import Rollout
from asperity.simulation.tool_contact import FLAGS

SCHEMA = 1
FLUSH_SECONDS = 0.5
_CHUNK = 1024
_POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")
_WRENCH = ("fx", "fy", "fz", "tx", "ty", "tz")
_VARIABLES: dict[str, tuple[list[str], str, str, str]] = table_beside(__file__, "variables.toml")[
    "recording"
]
_LATER = {"penetration_depth"}
"""Variables that older recordings of the same schema lack; NaN there."""


@dataclass(frozen=True, eq=False)
class Recording:
    """A recording in memory: the variables of the file, and its attributes.

    `time` (n,) [s], `handle_pose`, `tool_pose` (n, 7), `contact_wrench`, `device_wrench` (n, 6)
    [N, N m], `contact_count`, `flags` (n,), `penetration_depth` (n,) [m], NaN where the file does
    not say it.
    """

    time: Array
    handle_pose: Array
    tool_pose: Array
    contact_wrench: Array
    device_wrench: Array
    contact_count: Indices
    flags: Indices
    penetration_depth: Array
    attributes: dict[str, Any] = field(default_factory=dict)


class RecordingWriter:
    """Writes a recording while it happens. A context manager.

    Parameters
    ----------
    path : Path
        Must not exist.
    attributes : mapping
        Texts and numbers to keep with it: scene, tick, and the like.
    clock : callable
        Monotonic time [s], which determines when to flush.

    Raises
    ------
    OutputError
        The file exists or, now or later, cannot be written: the disk is full.
    """

    def __init__(
        self, path: Path, attributes: Mapping[str, Any] | None = None, *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:  # fmt: skip
        import h5py

        self._clock = clock
        self._disk = RecordingFile(path)
        self._file = h5py.File(self._disk, "w")
        _lay_out(self._file, h5py)
        for key, value in {**(attributes or {}), "schema": SCHEMA}.items():
            self._file.attrs[key] = value
        self._waiting: dict[str, list[Any]] = {"time": [], **{name: [] for name in _VARIABLES}}
        self._flushed = clock()
        self.file = self._file
        """The open HDF5 file, for groups besides the ticks."""
        self._file.flush()
        try:
            self._disk.check()
        except OutputError:
            self._close()
            raise

    def add(self, **row: ArrayLike) -> None:
        """Add one tick: `time` and every variable; without `penetration_depth` it is NaN."""
        for name, waiting in self._waiting.items():
            waiting.append(row.get(name, np.nan) if name in _LATER else row[name])
        late = self._clock() - self._flushed >= FLUSH_SECONDS
        if late or len(self._waiting["time"]) >= _CHUNK:
            self._write()
        if late:
            self._flush()

    def add_rows(self, rows: Mapping[str, NDArray[Any]]) -> None:
        """Add many ticks: arrays whose first axis is time."""
        self._write()
        self._append(rows)
        if self._clock() - self._flushed >= FLUSH_SECONDS:
            self._flush()

    def close(self) -> None:
        """Write the remaining rows and close the file."""
        if self._file:
            try:
                self._write()
            finally:
                self._close()
            self._disk.check()

    def _close(self) -> None:
        self._file.close()
        self._disk.close()

    def _write(self) -> None:
        if self._waiting["time"]:
            self._append({name: np.array(rows) for name, rows in self._waiting.items()})
            for rows in self._waiting.values():
                rows.clear()

    def _append(self, rows: Mapping[str, NDArray[Any]]) -> None:
        old = self._file["time"].shape[0]
        new = old + len(rows["time"])
        # Time last: a reader takes as many rows as there are times.
        for name in (*_VARIABLES, "time"):
            self._file[name].resize(new, axis=0)
            known = name in rows or name not in _LATER
            self._file[name][old:new] = rows[name] if known else np.nan
        self._disk.check()

    def _flush(self) -> None:
        self._file.flush()
        self._disk.check()
        self._flushed = self._clock()

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def described() -> dict[str, tuple[tuple[str, ...], dict[str, Any]]]:
    """Return the dimensions and the attributes of each variable but time."""
    masks = np.array(list(FLAGS), dtype=np.int32)
    # As the CF conventions say it.
    meanings = " ".join(text.replace(",", "").replace(" ", "_") for text in FLAGS.values())
    out: dict[str, tuple[tuple[str, ...], dict[str, Any]]] = {
        name: (tuple(dims), {"units": units, "long_name": text})
        for name, (dims, _, units, text) in _VARIABLES.items()
    }
    out["flags"][1].update({"flag_masks": masks, "flag_meanings": meanings})
    return out


def _lay_out(file: Any, h5py: Any) -> None:
    """Make the datasets, empty, with dimension scales, units and explanations."""
    text = h5py.string_dtype()
    scales = {
        "time": file.create_dataset("time", (0,), "f8", maxshape=(None,), chunks=(_CHUNK,)),
        "pose": file.create_dataset("pose", data=np.array(_POSE, dtype=object), dtype=text),
        "wrench": file.create_dataset("wrench", data=np.array(_WRENCH, dtype=object), dtype=text),
    }
    for name, scale in scales.items():
        scale.make_scale(name)
    scales["time"].attrs.update(units="s", long_name="time since the first tick")
    for name, (dims, attributes) in described().items():
        shape = (0, *(scales[dim].shape[0] for dim in dims[1:]))
        kind = _VARIABLES[name][1]
        data = file.create_dataset(
            name, shape, kind, maxshape=(None, *shape[1:]), chunks=(_CHUNK, *shape[1:])
        )
        data.attrs.update(attributes)
        for axis, dim in enumerate(dims):
            data.dims[axis].attach_scale(scales[dim])


def write_recording(
    rollout: Rollout, path: str | Path, attributes: Mapping[str, Any] | None = None
) -> None:
    """Write what came of a trajectory to a new file."""
    path = Path(path)
    if path.exists():
        raise AsperityError(f"{path} exists; give another name")
    with RecordingWriter(path, attributes) as writer:
        writer.add_rows(variables_of(rollout))


def variables_of(rollout: Rollout, ticks: slice = slice(None)) -> dict[str, NDArray[Any]]:
    """Return the variables of a recording that a rollout has, as `add_rows` takes them."""
    found = {name: getattr(rollout, name) for name in ("time", *_VARIABLES)}
    return {name: values[ticks] for name, values in found.items() if values is not None}


def recording_file(path: str | Path) -> Path:
    """Return the recording that a user means: the file, or `recording.h5` in a folder.

    Raises
    ------
    AsperityError
        There is none.
    """
    path = Path(path)
    file = path / "recording.h5" if path.is_dir() else path
    if not file.is_file():
        raise AsperityError(f"no such recording: {file}; give a recording.h5 of asperity run")
    return file


def read_recording(path: str | Path) -> Recording:
    """Return a recording, also one whose writer was killed: then as far as it got."""
    with _opened(recording_file(path)) as file:
        there = [name for name in ("time", *_VARIABLES) if name in file]
        rows = min(file[name].shape[0] for name in there)
        arrays = {name: file[name][:rows] for name in there}
        attributes = {key: _plain(value) for key, value in file.attrs.items()}
    for name in ("contact_count", "flags"):
        arrays[name] = arrays[name].astype(np.int64)
    for name in _LATER - arrays.keys():
        arrays[name] = np.full(rows, np.nan)
    return Recording(**arrays, attributes=attributes)


def read_attributes(path: Path) -> dict[str, Any]:
    """Return the attributes of a recording."""
    with _opened(path) as file:
        return {key: _plain(value) for key, value in file.attrs.items()}


def add_attribute(path: Path, name: str, value: str) -> None:
    """Keep another text with a recording that is finished."""
    import h5py

    with h5py.File(path, "r+") as file:
        file.attrs[name] = value


def require_recording(path: Path) -> int:
    """Return how many whole ticks a file has; raise where it is no recording of asperity's."""
    with _opened(path) as file:
        return int(min(file[name].shape[0] for name in ("time", *_VARIABLES) if name in file))


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Give the HDF5 file of a recording, checked to be one."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            schema = _plain(file.attrs.get("schema"))
            missing = [
                name for name in ("time", *_VARIABLES) if name not in file and name not in _LATER
            ]
            if schema != SCHEMA or missing:
                reason = f"no {missing[0]}" if missing else f"schema {schema!r}, valid: {SCHEMA}"
                raise AsperityError(f"{path} is no recording of asperity's: {reason}")
            yield file
    except OSError as error:
        if error.errno in (errno.EAGAIN, errno.EACCES) and os.access(path, os.R_OK):
            raise AsperityError(
                f"{path} cannot be read yet: it is still being written; stop the recording first"
            ) from None
        reason = " ".join(str(error).split())
        raise AsperityError(f"{path} cannot be read as HDF5: {reason}") from None


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value
