"""A file that two processes have in memory at the same time.

A memory-mapped file, and not `multiprocessing.shared_memory`: on Python 3.11 a process that merely
looked at such a segment deletes it when it exits. It should lie in memory, not on a disk: the
kernel stops whoever writes to a page while it is being written back.

Numbers of eight bytes, aligned, are written and read whole. Order between them is that of the
processor: x86-64 keeps stores in order, which is what was tested; on others the interpreter's work
between two stores is what there is.
"""

from __future__ import annotations

import mmap
import os
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

PREFIX = "asperity-servo-"
"""Of the names of shared folders."""
_IN_MEMORY = Path("/dev/shm")


def shared_folder() -> Path:
    """Make a folder for shared files, in memory where the system has such a place."""
    best = _IN_MEMORY if os.access(_IN_MEMORY, os.W_OK) else None
    return Path(tempfile.mkdtemp(prefix=PREFIX, dir=best))


class SharedFile:
    """A file in memory.

    Parameters
    ----------
    path : Path
    size : int, optional
        Make it, with so many bytes of zero. Default: open the one there is.
    """

    def __init__(self, path: Path, size: int | None = None) -> None:
        self.path = Path(path)
        with open(path, "r+b" if size is None else "x+b") as file:
            if size is not None:
                # Written, not only declared: a page that is not there yet would cost a tick.
                file.write(bytes(size))
                file.flush()
            self._map = mmap.mmap(file.fileno(), 0)

    def array(self, dtype: type, count: int, offset: int) -> NDArray:
        """Return an array that lies in the file."""
        return np.frombuffer(self._map, dtype, count, offset)

    @property
    def size(self) -> int:
        """In bytes."""
        return len(self._map)
