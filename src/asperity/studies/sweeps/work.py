"""What a worker does with a batch of combinations: numbers, or what went wrong."""

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

WAITING, DONE, FAILED = 0, 1, 2
"""States of a combination."""
_PACKAGES = ("numpy", "scipy", "numba", "mujoco")
_LONGEST = 500
"""Characters of an error's text that are kept."""


class Batch(NamedTuple):
    """Combinations that are worked on together; what varies stands in columns."""

    kind: str
    fixed: Mapping[str, Any]
    folder: str
    seed: int
    keep: tuple[str, ...]
    columns: Mapping[str, list[Any]]
    """Key -> values, as many as there are combinations."""
    program: str
    """What `program()` returns where the sweep was started."""


class BatchOutcome(NamedTuple):
    """What came of a batch of n combinations."""

    values: NDArray[np.float64]
    """(n, numbers that are kept); NaN where the combination failed."""
    states: NDArray[np.int8]
    """(n,) `DONE` or `FAILED`."""
    errors: dict[int, str]
    """Place in the batch -> text, of those that failed."""
    machine: str
    """Processor on which it was computed."""


class WrongProgram(AsperityError):  # noqa: N818
    """A worker runs another version of the program than the sweep."""


@functools.cache
def program() -> str:
    """Return a text that is the same where the program and what computes for it are the same."""
    folder = Path(__file__).parents[2]
    hashed = hashlib.sha256()
    for file in sorted(folder.rglob("*.py")):
        hashed.update(file.relative_to(folder).as_posix().encode() + file.read_bytes())
    parts = [f"asperity {__version__} ({hashed.hexdigest()[:12]})", f"python {_python()}"]
    return ", ".join(parts + [f"{name} {version_of(name)}" for name in _PACKAGES])


def _python() -> str:
    return ".".join(map(str, sys.version_info[:3]))


def version_of(package: str) -> str:
    """Return the version of a package, or "none"."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "none"


@functools.cache
def machine() -> str:
    """Return what of this machine results may depend on: architecture and kind of processor."""
    import llvmlite.binding as llvm

    return f"{platform.machine()} {llvm.get_host_cpu_name()} ({sys.platform})"


def ready(batch: Batch | None) -> str:
    """Load what a batch needs, by running it; return `program()`."""
    if batch is not None:
        work(batch)
    return program()


def packed(batch: Batch) -> bytes:
    """Return a batch as bytes: Dask looks at each element of tuples and lists, which takes longer.

    Unpacked by `work_packed`.
    """
    return pickle.dumps(batch, protocol=pickle.HIGHEST_PROTOCOL)


def work_packed(batch: bytes) -> BatchOutcome:
    """Run the combinations of a batch that `packed` made."""
    return work(pickle.loads(batch))


def work(batch: Batch) -> BatchOutcome:
    """Run the combinations of a batch; what one of them raises is its result."""
    if batch.program != program():
        raise WrongProgram(
            f"a worker runs {program()}; the sweep was started by {batch.program}: "
            "install the same everywhere"
        )
    count = len(next(iter(batch.columns.values())))
    runs = runner(batch.kind, batch.fixed, Path(batch.folder), batch.seed)
    values = np.full((count, len(batch.keep)), np.nan)
    states = np.full(count, DONE, np.int8)
    errors: dict[int, str] = {}
    for i in range(count):
        varied = {key: column[i] for key, column in batch.columns.items()}
        try:
            numbers = runs.numbers(varied, batch.keep)
            for name, number in zip(batch.keep, numbers, strict=True):
                if not math.isfinite(number):
                    raise AsperityError(f"{name} came out as {number}")
            values[i] = numbers
        except Exception as error:
            states[i], errors[i] = FAILED, told(error)
    return BatchOutcome(values, states, errors, machine())


def told(error: BaseException) -> str:
    """Return an error as one line."""
    text = " ".join(str(error).split())[:_LONGEST]
    if isinstance(error, AsperityError) and text:
        return text
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
