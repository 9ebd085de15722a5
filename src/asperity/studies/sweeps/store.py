"""The Zarr store of a sweep: an array for each kept number, `error` and `state`, chunked alike.

The writing process may be killed at any moment. Therefore:

- an empty store is created under a temporary name and renamed when it is complete;
- one process writes, a block of combinations at a time. A block is one chunk, so one file, of
  every array; Zarr writes a file under a temporary name and renames it, so it is old or new;
- numbers and errors of a block are written before its states. A block counts once it has states.

After a kill, a block without states may have some of its numbers; it is computed again and
overwritten. Chunks carry checksums. All of them are read when a sweep is resumed, and blocks that
cannot be read are computed again.

Blocks are written through Zarr rather than by xarray's `to_zarr(region=...)`, which does not
document the order in which it writes variables and takes four times as long.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from asperity._core.lock import locked
from asperity._core.output import output_errors
from asperity.errors import AsperityError, OutputError
from asperity.studies.sweeps.batch import (
    DONE,
    FAILED,
    WAITING,
    BatchOutcome,
    error_line,
    program,
)
from asperity.studies.sweeps.new_store import (
    MORE,
    SCHEMA,
    SweepBlock,
    blocks,
    consolidate,
    create_store,
    places_in,
)
from asperity.studies.sweeps.study import SweepStudy

if TYPE_CHECKING:
    import xarray as xr

_PARTIAL = re.compile(r"\.[0-9a-f]{32}\.partial$")
"""Names of the temporary files of Zarr."""


def require_packages(*packages: str) -> None:
    """Raise `AsperityError` unless packages of the extra `sweep` are installed."""
    from importlib.util import find_spec

    missing = [name for name in packages if find_spec(name) is None]
    if missing:
        raise AsperityError(
            f"sweeps need {' and '.join(missing)}, not installed here: "
            "pip install 'asperity[sweep]'"
        )


@dataclass
class BlockResults:
    """Results of the combinations of one block."""

    values: NDArray[np.float64]
    """`SweepStudy.numbers` (size, numbers); NaN where there is none."""
    states: NDArray[np.int8]
    """`WAITING`, `DONE` or `FAILED` (size,)."""
    errors: NDArray[np.object_]
    """Error texts (size,), "" where there is none."""

    @classmethod
    def empty(cls, size: int, numbers: int) -> BlockResults:
        """Return results of combinations that all wait."""
        return cls(
            np.full((size, numbers), np.nan), np.full(size, WAITING, np.int8),
            np.full(size, "", dtype=object),
        )  # fmt: skip

    def insert(self, places: NDArray[np.int64], outcome: BatchOutcome) -> None:
        """Store the outcome of the combinations at `places` of the block."""
        self.values[places] = outcome.values
        self.states[places] = outcome.states
        self.errors[places] = outcome.errors

    def complete(self, kept: int) -> bool:
        """Whether all combinations that are done have so many finite numbers; others may wait.

        A block of which some wait is one of a store that was extended.
        """
        return bool(np.isfinite(self.values[self.states == DONE, :kept]).all())


class SweepStore:
    """The results of a study on disk, open for writing.

    Parameters
    ----------
    path : Path
        A store made by `create_store`.
    study : SweepStudy
        The study that it belongs to.
    """

    def __init__(self, path: Path, study: SweepStudy) -> None:
        import zarr

        self.path, self.study = path, study
        self._group = zarr.open_group(str(path), mode="r+", zarr_format=3)
        self._numbers = (*study.keep, *(f"{MORE}/{name}" for name in study.more))
        names = (*self._numbers, "error", "state")
        self._arrays: dict[str, Any] = {name: self._group[name] for name in names}
        self._chunk = tuple(self._arrays["state"].chunks)
        self.blocks = list(blocks(study.design.shape, self._chunk))
        self.sessions: list[dict[str, Any]] = json.loads(str(self._group.attrs["sessions"]))
        """Facts of each run of the sweep, oldest first; `write_sessions` stores them."""

    def read(self, block: SweepBlock) -> BlockResults:
        """Return the results of a block. What Zarr raises for a damaged chunk passes through."""
        states = np.asarray(self._arrays["state"][block.slices], np.int8).ravel()
        if not states.any():
            return BlockResults.empty(block.size, len(self._numbers))
        columns = [self._arrays[name][block.slices].ravel() for name in self._numbers]
        errors = np.asarray(self._arrays["error"][block.slices]).astype(object).ravel()
        return BlockResults(np.stack(columns, axis=1), states, errors)

    def write(self, block: SweepBlock, results: BlockResults) -> None:
        """Write the results of a block: numbers, errors, and then its states."""
        with output_errors(self.path):
            for name, column in zip(self._numbers, results.values.T, strict=True):
                self._arrays[name][block.slices] = column.reshape(block.shape)
            # An array of empty texts takes its file away, if an earlier run left one.
            self._arrays["error"][block.slices] = results.errors.reshape(block.shape)
            self._arrays["state"][block.slices] = results.states.reshape(block.shape)

    def verified_states(self) -> NDArray[np.int8]:
        """Return the state of every combination (size,), after reading all chunks.

        Temporary files of killed writers are removed. Blocks that cannot be read, or that lack
        numbers, are removed too and count as waiting.
        """
        for file in self.path.rglob("*.partial"):
            if _PARTIAL.search(file.name):
                file.unlink()
        states = np.full(self.study.size, WAITING, np.int8)
        for block in self.blocks:
            try:
                results = self.read(block)
            except Exception:  # codecs raise all kinds for a damaged chunk
                self._remove(block)
                continue
            if results.complete(len(self.study.keep)):
                states[block.places] = results.states
            elif results.states.any():
                self._remove(block)
        return states

    def first_error(self, states: NDArray[np.int8]) -> str:
        """Return the error of the first combination that failed; "" if none did."""
        failed = np.flatnonzero(states == FAILED)
        if not failed.size:
            return ""
        block = next(b for b in self.blocks if failed[0] < b.places.stop)
        return str(self.read(block).errors[failed[0] - block.first])

    def _remove(self, block: SweepBlock) -> None:
        """Delete the files of a block, its states first."""
        place = "/".join(
            str(s.start // size) for s, size in zip(block.slices, self._chunk, strict=True)
        )
        for name in reversed(list(self._arrays)):
            with suppress(FileNotFoundError):
                (self.path / name / "c" / place).unlink()

    def write_sessions(self) -> None:
        """Store `sessions`."""
        with output_errors(self.path):
            self._group.attrs["sessions"] = json.dumps(self.sessions, ensure_ascii=False)
            consolidate(self._group)


@contextmanager
def open_store(
    path: Path,
    study: SweepStudy,
    *,
    block_size: int,
    overwrite: bool = False,
    any_version: bool = False,
    extend: bool = False,
) -> Iterator[SweepStore]:
    """Give the store of a study to one writer: a new store, or an unfinished one.

    Parameters
    ----------
    path : Path
    study : SweepStudy
    block_size : int
        Largest number of combinations in a block of a new store.
    overwrite : bool
        Replace an existing store by an empty one.
    any_version : bool
        Accept a store begun by another version of the program or of its packages.
    extend : bool
        Take over what the store of a study with other values has of this one.

    Raises
    ------
    OutputError
        `path` is something else than a store, cannot be written, or has another writer.
    AsperityError
        The store belongs to another study or version.
    """
    require_packages("zarr")
    path = Path(os.path.realpath(path))
    taken = f"another sweep writes to {path}; wait for it, or give another store with --out"
    with ExitStack() as stack:
        with output_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            # Locked before it is made: of sweeps that begin at once, one goes on.
            stack.enter_context(locked(path, taken))
            if path.exists() and not is_store(path):
                if not path.is_dir() or any(path.iterdir()):
                    raise OutputError(f"{path} is no store of a sweep; give another one with --out")
                path.rmdir()
            if overwrite or not path.exists():
                create_store(path, study, block_size)
            if extend and _attributes(path)["fingerprint"] != study.fingerprint:
                _extend(path, study, block_size, any_version)
            _check_origin(path, study, any_version)
            store = SweepStore(path, study)
        # An OSError of the caller's block is not one of the store.
        yield store


def _extend(path: Path, study: SweepStudy, block_size: int, any_version: bool) -> None:
    """Replace a store by one of a study with other values, with all results that both have."""
    _check_program(path, any_version)
    older = _with_more(path, open_sweep(path))
    places = places_in(older, study)
    # As arrays with the new axes' order, and a waiting combination at the end of each for -1.
    order = [axis.name for axis in study.design.axes]
    older = older.transpose(*order)

    def taken(name: str, empty: Any) -> NDArray[Any]:
        if name not in older:  # what an earlier version did not store
            return np.full(study.design.shape, empty)
        values = older[name].values
        padded = np.pad(values.astype(object), [(0, 1)] * values.ndim, constant_values=empty)
        return np.asarray(padded[np.ix_(*places)])

    states = taken("state", WAITING).astype(np.int8)
    numbers = [taken(name, np.nan).astype(np.float64) for name in study.numbers]
    # What gave no number that is kept now is to say why.
    lacking = ~np.isfinite(numbers[: len(study.keep)]).all(axis=0)
    states[(states == DONE) & lacking] = WAITING
    errors = taken("error", "")
    sessions = older.attrs["sessions"]

    def fill(fresh: Path) -> None:
        store = SweepStore(fresh, study)
        for block in store.blocks:
            part = BlockResults(
                np.stack([values[block.slices].ravel() for values in numbers], axis=1),
                states[block.slices].ravel(), errors[block.slices].ravel(),
            )  # fmt: skip
            if part.states.any():
                store.write(block, part)
        store.sessions = json.loads(sessions)
        store.write_sessions()

    create_store(path, study, block_size, fill)


def _with_more(path: Path, data: xr.Dataset) -> xr.Dataset:
    """Return the results of a store with the numbers that were stored besides."""
    import xarray as xr
    import zarr

    if MORE not in zarr.open_group(str(path), mode="r"):
        return data
    with xr.open_zarr(path, group=MORE, chunks=None, consolidated=False) as more:
        return data.assign({str(name): array for name, array in more.load().data_vars.items()})


def is_store(path: Path) -> bool:
    """Return whether a folder is the store of a sweep."""
    return _attributes(path).get("asperity_sweep") == SCHEMA


def _attributes(path: Path) -> dict[str, Any]:
    try:
        found = json.loads((path / "zarr.json").read_text("utf-8"))["attributes"]
    except (OSError, ValueError, KeyError, TypeError):
        return {}
    return found if isinstance(found, dict) else {}


def _check_origin(path: Path, study: SweepStudy, any_version: bool) -> None:
    """Raise `AsperityError` unless a store belongs to this study and program."""
    found = _attributes(path)
    if found["fingerprint"] != study.fingerprint:
        raise AsperityError(
            f"{path} holds another study, {found['title']!r}, or files that it names have changed "
            "since; give another store with --out, --extend if it only has other values or "
            "numbers, or "
            "--overwrite to begin anew"
        )
    _check_program(path, any_version)


def _check_program(path: Path, any_version: bool) -> None:
    found = _attributes(path)
    if found["program"] != program() and not any_version:
        raise AsperityError(
            f"{path} was begun by {found['program']}; this is {program()}: give --any-version "
            "to mix them, or --overwrite to begin anew"
        )


def open_sweep(path: str | Path) -> xr.Dataset:
    """Return the results of a sweep, complete or not, as a dataset in memory.

    Parameters
    ----------
    path : path
        A store that `asperity sweep` has written, or is writing.

    Returns
    -------
    xarray.Dataset
        A dimension for each axis of the study, with its values and units; a variable for each
        kept number, NaN where there is no result; `state` (0 waiting, 1 done, 2 failed) and
        `error`. The study, versions and sessions are in `attrs`.

    Raises
    ------
    AsperityError
        No such store, or one that cannot be read.
    """
    require_packages("zarr")
    path = Path(path)
    if not path.exists():
        raise AsperityError(f"no such store: {path}; give one that asperity sweep wrote")
    if not is_store(path):
        raise AsperityError(f"{path} is no store of a sweep; give one that asperity sweep wrote")
    import xarray as xr

    try:
        with xr.open_zarr(path, chunks=None) as data:
            return data.load()
    except Exception as error:  # codecs raise all kinds for a damaged chunk
        raise AsperityError(f"{path} cannot be read: {error_line(error, 200)}") from None
