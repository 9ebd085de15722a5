"""Memory-mapped files through which processes exchange records without locks.

`multiprocessing.shared_memory` is no substitute: on Python 3.11 a process that has only attached to
a segment deletes it when it exits. The files belong in memory, not on a disk, because the kernel
blocks a process that writes to a page while that page is being written back.

Aligned numbers of eight bytes are written and read whole. Their order is that of the processor:
x86-64 keeps the order of stores, and that is what has been tested. On other processors only the
interpreter's own work between two stores keeps them in order.
"""

from __future__ import annotations

import mmap
import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import DTypeLike, NDArray

PREFIX = "asperity-servo-"
"""Start of the names of shared folders."""
_IN_MEMORY = Path("/dev/shm")
_Copy = TypeVar("_Copy")


def shared_folder() -> Path:
    """Make a folder for shared files, in memory where the system has a place for that."""
    best = _IN_MEMORY if os.access(_IN_MEMORY, os.W_OK) else None
    return Path(tempfile.mkdtemp(prefix=PREFIX, dir=best))


def remove_shared_folder(folder: Path) -> None:
    """Remove a folder that `shared_folder` made in a process that has ended; no other folder."""
    if folder.name.startswith(PREFIX):
        shutil.rmtree(folder, ignore_errors=True)


class SharedFile:
    """A memory-mapped file.

    Parameters
    ----------
    path : Path
    size : int, optional
        Create the file with `size` zero bytes. Default: open an existing file.
    """

    def __init__(self, path: Path, size: int | None = None) -> None:
        self.path = Path(path)
        with open(path, "r+b" if size is None else "x+b") as file:
            if size is not None:
                # Written, not only reserved: allocating a page on first use would cost a tick.
                file.write(bytes(size))
                file.flush()
            self._map = mmap.mmap(file.fileno(), 0)

    def array(self, dtype: DTypeLike, shape: tuple[int, ...] = (), offset: int = 0) -> NDArray[Any]:
        """Return an array, or by default one record, that lies in the file at a byte offset."""
        return np.ndarray(shape, dtype, self._map, offset)

    @property
    def size(self) -> int:
        """Size of the file in bytes."""
        return len(self._map)


class SequenceLock:
    """A sequence lock: one writer, any number of readers, no waiting.

    The number is odd while the writer is at work: `with lock: ...` encloses a write. A reader that
    finds the same even number before and after it copied the record holds an undivided copy.

    Parameters
    ----------
    number : int64 array of no dimension
        Beside the record, in the same file.
    """

    def __init__(self, number: NDArray[np.int64]) -> None:
        self._number = number

    @property
    def number(self) -> int:
        """The sequence number: 0 before the first write; odd during one."""
        return int(self._number)

    def __enter__(self) -> None:
        self._number[...] = self.number | 1

    def __exit__(self, kind: object, *_: object) -> None:
        if kind is None:  # a record left half written stays marked
            self._number[...] = self.number + 1

    def read(self, copy: Callable[[], _Copy]) -> tuple[int, _Copy] | None:
        """Return the sequence number and `copy()`, or None if a write fell into the copying."""
        number = self.number
        if number % 2:
            return None
        copied = copy()
        return (number, copied) if self.number == number else None
