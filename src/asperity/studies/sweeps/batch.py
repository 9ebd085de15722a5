"""A batch of combinations as a worker runs it: numbers, or the error of each combination."""

from __future__ import annotations

import functools
import hashlib
import math
import pickle
import platform
import sys
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity import __version__
from asperity.errors import AsperityError
from asperity.studies.sweeps.study import runner
from asperity.studies.sweeps.time_limit import time_limit

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
    runs = runner(batch.kind, batch.fixed, Path(batch.folder), batch.seed)
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
