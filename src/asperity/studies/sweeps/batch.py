"""A batch of combinations as a worker runs it: its outcome, its time limit, its provenance."""

from __future__ import annotations

import ctypes
import functools
import hashlib
import math
import os
import pickle
import platform
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity import __version__
from asperity.errors import AsperityError
from asperity.studies.sweeps.study import kind_of

WAITING, DONE, FAILED = 0, 1, 2
"""States of a combination."""
_PACKAGES = ("numpy", "scipy", "numba", "mujoco")


class Batch(NamedTuple):
    """Combinations that one worker runs one after the other."""

    kind: str
    fixed: Mapping[str, Any]
    folder: str
    seed: int
    keep: tuple[str, ...]
    more: tuple[str, ...]
    """Numbers that a combination gives besides; NaN where it does not."""
    columns: Mapping[str, list[Any]]
    """Varied parameters: key -> values, one for each of the n combinations."""
    program: str
    """`program()` of the process that started the sweep."""
    limit: float | None = None
    """Longest time of one combination [s]."""


class BatchOutcome(NamedTuple):
    """Results of a batch of n combinations."""

    values: NDArray[np.float64]
    """Numbers (n, keep and more); NaN where the combination failed."""
    states: NDArray[np.int8]
    """`DONE` or `FAILED` (n,)."""
    errors: list[str]
    """Error of each combination (n), "" where it succeeded."""
    machine: str
    """Processor on which the batch ran."""


class WrongProgram(AsperityError):  # noqa: N818
    """A worker runs another version of the program than the sweep."""


@functools.cache
def program() -> str:
    """Return the versions of asperity, with a hash of its source, of Python and of its packages."""
    folder = Path(__file__).parents[2]
    hashed = hashlib.sha256()
    for file in sorted(folder.rglob("*.py")):
        hashed.update(file.relative_to(folder).as_posix().encode() + file.read_bytes())
    parts = [
        f"asperity {__version__} ({hashed.hexdigest()[:12]})",
        f"python {platform.python_version()}",
    ]
    return ", ".join(parts + [f"{name} {version_of(name)}" for name in _PACKAGES])


def version_of(package: str) -> str:
    """Return the version of an installed package, or "none"."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "none"


@functools.cache
def machine() -> str:
    """Return the architecture and processor type, on which the last digits of results depend."""
    import llvmlite.binding as llvm

    return f"{platform.machine()} {llvm.get_host_cpu_name()} ({sys.platform})"


def warm_up(batch: Batch | None) -> str:
    """Run a batch, if given, so that its kernels are loaded; return `program()`."""
    if batch is not None:
        run_batch(batch)
    return program()


def pack(batch: Batch) -> bytes:
    """Return a batch as bytes for `run_packed_batch`.

    Dask inspects every element of nested tuples and lists, which takes longer than pickling them.
    """
    return pickle.dumps(batch, protocol=pickle.HIGHEST_PROTOCOL)


def run_packed_batch(batch: bytes) -> BatchOutcome:
    """Run a batch packed by `pack`."""
    return run_batch(pickle.loads(batch))


def run_batch(batch: Batch) -> BatchOutcome:
    """Run the combinations of a batch; an exception of one becomes its error text."""
    if batch.program != program():
        raise WrongProgram(
            f"a worker runs {program()}; the sweep was started by {batch.program}: "
            "install the same everywhere"
        )
    count = len(next(iter(batch.columns.values())))
    runs = kind_of(batch.kind)(batch.fixed, Path(batch.folder), batch.seed)
    values = np.full((count, len(batch.keep) + len(batch.more)), np.nan)
    states = np.full(count, DONE, np.int8)
    errors = [""] * count
    for i in range(count):
        varied = {key: column[i] for key, column in batch.columns.items()}
        try:
            with time_limit(batch.limit):
                numbers = runs.numbers(varied, batch.keep, batch.more)
            for name, number in zip(batch.keep, numbers, strict=False):
                if not math.isfinite(number):
                    raise AsperityError(f"{name} came out as {number}")
            values[i] = numbers
        except Exception as error:
            states[i], errors[i] = FAILED, error_line(error)
    return BatchOutcome(values, states, errors, machine())


def error_line(error: BaseException, length: int = 500) -> str:
    """Return an exception as one line; its type precedes it unless it is an `AsperityError`."""
    text = " ".join(str(error).split())[:length]
    if isinstance(error, AsperityError) and text:
        return text
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def session_facts() -> dict[str, Any]:
    """Return the facts of a run that begins now, without names of people or machines."""
    return {
        "started": now(),
        "version": __version__,
        "revision": revision(),
        "program": program(),
        "packages": {name: version_of(name) for name in ("zarr", "dask", "distributed", "xarray")},
        "started_on": machine(),
        "cores": os.cpu_count() or 1,
    }


def now() -> str:
    """Return date and time, UTC, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def revision() -> str | None:
    """Return the git revision of the package, "-dirty" if changed; None outside a checkout."""
    folder = Path(__file__).parents[2]
    try:
        _git(folder, "ls-files", "--error-unmatch", "__init__.py")
        return _git(folder, "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")
    except (OSError, subprocess.SubprocessError):
        return None


def _git(folder: Path, *words: str) -> str:
    done = subprocess.run(
        ["git", "-C", str(folder), *words], capture_output=True, text=True, timeout=10, check=True
    )
    return done.stdout.strip()


class _TimeIsOver(BaseException):
    """Raised in the thread whose time is over; no `except Exception` of its code stops it."""


@contextmanager
def time_limit(seconds: float | None) -> Iterator[None]:
    """Raise `AsperityError` in the block when it has taken longer than so many seconds.

    It is raised between two instructions of Python: compiled code that never returns is not
    interrupted. Workers of Dask run their tasks outside the main thread, where signals, which would
    do, are not to be had.

    Parameters
    ----------
    seconds : float, optional
        None: no limit.
    """
    if seconds is None:
        yield
        return
    thread, lock, over = ctypes.c_ulong(threading.get_ident()), threading.Lock(), False

    def end() -> None:
        with lock:
            if not over:
                ctypes.pythonapi.PyThreadState_SetAsyncExc(thread, ctypes.py_object(_TimeIsOver))

    timer = threading.Timer(seconds, end)
    timer.daemon = True
    timer.start()
    try:
        try:
            yield
        finally:
            timer.cancel()
            with lock:
                over = True
    except _TimeIsOver:
        raise AsperityError(f"took longer than the limit of {seconds:g} s") from None
