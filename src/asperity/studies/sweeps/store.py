"""The Zarr store of a sweep: one array for each number, `state` and `error`, all cut alike.

What may happen to it: the process that writes is killed at any moment. So

- the store comes to be as a whole, empty, under another name, and is then renamed;
- only that process writes, one block at a time, each a file for each array; Zarr writes a file
  beside its place and renames it, so that a file is old or new, never half;
- the numbers of a block are written before its states. A block counts when it has states.

What is left is a block whose numbers, or some of them, are there, and which does not count: it is
done again and written over. Chunks carry checksums; when a sweep goes on they are all read, and a
block that cannot be read is done again.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import tempfile
import warnings
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError, OutputError
from asperity.studies.sweeps.blocks import Block, block_shape, blocks
from asperity.studies.sweeps.study import SweepStudy
from asperity.studies.sweeps.work import DONE, FAILED, WAITING, program

if TYPE_CHECKING:
    import xarray as xr

SCHEMA = 1
_PARTIAL = re.compile(r"\.[0-9a-f]{32}\.partial$")
_STATES = "0 waiting, 1 done, 2 failed"


def needs(*packages: str) -> None:
    """Refuse to go on without packages of the extra `sweep`."""
    from importlib.util import find_spec

    lacking = [name for name in packages if find_spec(name) is None]
    if lacking:
        raise AsperityError(
            f"sweeps need {' and '.join(lacking)}, not installed here: "
            "pip install 'asperity[sweep]'"
        )


class SweepStore:
    """The results of a study on disk, open for writing.

    Parameters
    ----------
    path : Path
        A store that `create` made.
    study : SweepStudy
        The one that it is of.
    """

    def __init__(self, path: Path, study: SweepStudy) -> None:
        import zarr

        self.path, self.study = path, study
        self._group = zarr.open_group(str(path), mode="r+", zarr_format=3)
        names = (*study.keep, "error", "state")
        self._arrays: dict[str, Any] = {name: self._group[name] for name in names}
        chunk = tuple(self._arrays["state"].chunks)
        self.blocks = list(blocks(study.design.shape, chunk))

    def states(self) -> NDArray[np.int8]:
        """Return the state of every combination (size,)."""
        return np.asarray(self._arrays["state"][...], np.int8).ravel()

    def numbers(self, block: Block) -> NDArray[np.float64]:
        """Return what is kept of a block's combinations (size, numbers)."""
        columns = [self._arrays[name][block.slices].ravel() for name in self.study.keep]
        return np.stack(columns, axis=1)

    def errors(self, block: Block) -> dict[int, str]:
        """Return the texts of a block's combinations that failed, by their place in it."""
        texts = np.asarray(self._arrays["error"][block.slices]).ravel()
        return {i: str(text) for i, text in enumerate(texts) if text}

    def write(
        self,
        block: Block,
        values: NDArray[np.float64],
        states: NDArray[np.int8],
        errors: Mapping[int, str],
        *,
        again: bool = False,
    ) -> None:
        """Write a block: numbers, errors, and then its states.

        Parameters
        ----------
        block : Block
        values : (size, numbers) array
        states : (size,) array
        errors : mapping
            Place in the block -> text.
        again : bool
            Whether it has been written before, so that old errors have to go.
        """
        with _told_as_ours(self.path):
            for i, name in enumerate(self.study.keep):
                self._arrays[name][block.slices] = values[:, i].reshape(block.shape)
            if errors or again:
                texts = np.full(block.size, "", dtype=object)
                for i, text in errors.items():
                    texts[i] = text
                self._arrays["error"][block.slices] = texts.reshape(block.shape)
            self._arrays["state"][block.slices] = states.reshape(block.shape)

    def sound_states(self) -> NDArray[np.int8]:
        """Return the states, as `states`, after a look at all that is there.

        What other writers left half done is removed, and blocks whose numbers cannot be read, or
        are not there, count as waiting.
        """
        for file in self.path.rglob("*.partial"):
            if _PARTIAL.search(file.name):
                file.unlink()
        states = np.full(self.study.size, WAITING, np.int8)
        for block in self.blocks:
            part = slice(block.first, block.first + block.size)
            try:
                states[part] = self._arrays["state"][block.slices].ravel()
            except Exception:  # whatever a codec says of a damaged chunk
                self._forget(block)
        try:
            everything = [self._arrays[name][...].ravel() for name in self.study.keep]
            self._arrays["error"][...]
        except Exception:
            everything = None
        for block in self.blocks:
            part = slice(block.first, block.first + block.size)
            if not states[part].any():
                continue
            try:
                if everything is None:
                    numbers = self.numbers(block)
                    self.errors(block)
                else:
                    numbers = np.stack([column[part] for column in everything], axis=1)
            except Exception:
                numbers = np.full((block.size, 1), np.nan)
            if not np.isfinite(numbers[states[part] == DONE]).all() or not states[part].all():
                self._forget(block)
                states[part] = WAITING
        return states

    def _forget(self, block: Block) -> None:
        """Take a block's files away, its states first."""
        chunk = self._arrays["state"].chunks
        place = "/".join(str(s.start // c) for s, c in zip(block.slices, chunk, strict=True))
        for name in reversed(list(self._arrays)):
            with suppress(FileNotFoundError):
                (self.path / name / "c" / place).unlink()

    def add_session(self, facts: Mapping[str, Any]) -> int:
        """Note a run of the sweep in the store's provenance; return its number from 0."""
        sessions = self.sessions()
        self._note([*sessions, dict(facts)])
        return len(sessions)

    def update_session(self, number: int, facts: Mapping[str, Any]) -> None:
        """Note more of a run of the sweep."""
        sessions = self.sessions()
        sessions[number] |= facts
        self._note(sessions)

    def sessions(self) -> list[dict[str, Any]]:
        """Return what was noted of each run of the sweep."""
        found = json.loads(str(self._group.attrs["sessions"]))
        assert isinstance(found, list)
        return found

    def _note(self, sessions: list[dict[str, Any]]) -> None:
        import zarr

        self._group.attrs["sessions"] = json.dumps(sessions, ensure_ascii=False)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # consolidated metadata are no part of format 3 yet
            zarr.consolidate_metadata(self._group.store)


@contextmanager
def opened_store(
    path: Path, study: SweepStudy, *, most: int, overwrite: bool = False, any_version: bool = False
) -> Iterator[SweepStore]:
    """Give the store of a study to one writer: a new one, or one that is to be gone on with.

    Parameters
    ----------
    path : Path
    study : SweepStudy
    most : int
        Combinations in a block of a new store.
    overwrite : bool
        Whether to begin anew.
    any_version : bool
        Whether to go on with what another version of the program, or of its packages, began.
    """
    needs("zarr")
    path = Path(os.path.realpath(path))
    if path.exists() and not is_store(path):
        if not path.is_dir() or any(path.iterdir()):
            raise OutputError(f"{path} is no store of a sweep; give another one with --out")
        path.rmdir()
    with _told_as_ours(path), ExitStack() as stack:
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists():
            create(path, study, most)
        elif overwrite:
            with _locked(path):
                create(path, study, most)
        stack.enter_context(_locked(path))
        _refuse_another(path, study, any_version)
        kept = SweepStore(path, study)
        held = stack.pop_all()
    # What goes wrong from here on is not the store's, unless its own methods say so.
    with held:
        yield kept


@contextmanager
def _told_as_ours(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OutputError(f"cannot write to {path}: {error.strerror or error}") from None


def is_store(path: Path) -> bool:
    """Return whether a folder is the store of a sweep."""
    return _attributes(path).get("asperity_sweep") == SCHEMA


def _attributes(path: Path) -> dict[str, Any]:
    try:
        found = json.loads((path / "zarr.json").read_text("utf-8"))["attributes"]
    except (OSError, ValueError, KeyError, TypeError):
        return {}
    return found if isinstance(found, dict) else {}


def _refuse_another(path: Path, study: SweepStudy, any_version: bool) -> None:
    found = _attributes(path)
    if found["fingerprint"] != study.fingerprint:
        raise AsperityError(
            f"{path} holds another study, {found['title']!r}, or files that it names have changed "
            "since; give another store with --out, or --overwrite to begin anew"
        )
    if found["program"] != program() and not any_version:
        raise AsperityError(
            f"{path} was begun by {found['program']}; this is {program()}: give --any-version "
            "to mix them, or --overwrite to begin anew"
        )


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Refuse a second writer while the block lasts. The lock goes with the process."""
    try:
        import fcntl
    except ImportError:  # not on Windows: there two writers are not told apart
        yield
        return
    descriptor = os.open(path, os.O_RDONLY)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise OutputError(
                f"another sweep writes to {path}; wait for it, or give another store with --out"
            ) from None
        except OSError:
            pass  # some network file systems have no locks
        yield
    finally:
        os.close(descriptor)


def create(path: Path, study: SweepStudy, most: int) -> None:
    """Make an empty store of a study, in the place of what is there."""
    fresh = Path(tempfile.mkdtemp(prefix=".asperity-", dir=path.parent))
    try:
        fresh.chmod(0o755)
        _lay_out(fresh, study, most)
        if path.exists():
            old = fresh.with_name(fresh.name + "-old")
            path.rename(old)
            fresh.rename(path)
            shutil.rmtree(old)
        else:
            fresh.rename(path)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def _lay_out(path: Path, study: SweepStudy, most: int) -> None:
    """Write the metadata of all arrays, and the coordinates."""
    import zarr
    from zarr.codecs import ZstdCodec

    design = study.design
    dims = [axis.name for axis in design.axes]
    beside = [key for axis in design.axes for key in axis.columns if key != axis.name]
    attributes: dict[str, Any] = {
        "asperity_sweep": SCHEMA,
        "title": study.title,
        "kind": study.kind,
        "keep": list(study.keep),
        "design": design.kind,
        "study": study.text,
        "files": json.dumps(dict(study.files)),
        "fingerprint": study.fingerprint,
        "program": program(),
        "sessions": "[]",
    }
    if beside:
        attributes["coordinates"] = " ".join(beside)
    group = zarr.create_group(str(path), zarr_format=3, attributes=attributes)
    checked = [ZstdCodec(level=1, checksum=True)]

    def array(name: str, kind: Any, empty: Any, told: dict[str, Any]) -> None:
        group.create_array(
            name, shape=design.shape, chunks=block_shape(design.shape, most), dtype=kind,
            fill_value=empty, compressors=checked, dimension_names=dims, attributes=told,
        )  # fmt: skip

    for name in study.keep:
        array(name, "f8", np.nan, _told(study, name))
    array("state", "i1", WAITING, {"long_name": _STATES, "units": "1"})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # texts are a young part of format 3
        array("error", str, "", {"long_name": "why a combination failed"})
        for axis in design.axes:
            columns = dict(axis.columns)
            if axis.name not in columns:
                columns[axis.name] = list(range(axis.size))
            for key, values in columns.items():
                _coordinate(group, key, axis.name, values, _told(study, key))
        zarr.consolidate_metadata(group.store)


def _told(study: SweepStudy, name: str) -> dict[str, Any]:
    """Return the attributes of a variable: unit and label, as far as there are any."""
    unit = study.unit(name)
    return {"long_name": study.label(name)} | ({"units": unit} if unit else {})


def _coordinate(group: Any, key: str, dim: str, values: list[Any], told: dict[str, Any]) -> None:
    column = np.array(as_labels(values)) if not _are_numbers(values) else np.array(values)
    texts = column.dtype.kind in "UO"
    array = group.create_array(
        key, shape=column.shape, chunks=column.shape, dtype=str if texts else column.dtype,
        dimension_names=[dim], attributes=told,
    )  # fmt: skip
    array[:] = column.astype(object) if texts else column


def _are_numbers(values: list[Any]) -> bool:
    return all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)


def as_labels(values: list[Any]) -> list[str]:
    """Return values that are no numbers as texts: the words of TOML, lists without brackets."""

    def label(value: Any) -> str:
        if isinstance(value, list | tuple):
            return ", ".join(map(label, value))
        if isinstance(value, bool):
            return "true" if value else "false"
        return value if isinstance(value, str) else f"{value:g}"

    return [label(value) for value in values]


def open_sweep(path: str | Path) -> xr.Dataset:
    """Return the results of a sweep, complete or not, as a dataset read into memory.

    Parameters
    ----------
    path : path
        The store that `asperity sweep` wrote, or writes.

    Returns
    -------
    xarray.Dataset
        A dimension for each axis of the study, with its values and units; a variable for each
        number that is kept, NaN where there is none; `state` (0 waiting, 1 done, 2 failed) and
        `error`. The study, versions and sessions stand in `attrs`.

    Raises
    ------
    AsperityError
        No such store, or one that cannot be read.
    """
    needs("zarr")
    path = Path(path)
    if not path.exists():
        raise AsperityError(f"no such store: {path}; give one that asperity sweep wrote")
    if not is_store(path):
        raise AsperityError(f"{path} is no store of a sweep; give one that asperity sweep wrote")
    import xarray as xr

    try:
        with xr.open_zarr(path, chunks=None) as data:
            return data.load()
    except Exception as error:  # whatever a codec says of a damaged chunk
        line = " ".join(str(error).split())[:200]
        raise AsperityError(f"{path} cannot be read: {line}") from None


__all__ = ["DONE", "FAILED", "WAITING", "SweepStore", "create", "open_sweep", "opened_store"]
