"""The file under a recording: HDF5 never learns that a write failed, for it cannot go on after one.

After a failed write, HDF5 can neither close its file nor end the process without a signal. So the
bytes go through this file object: it keeps the first error and takes everything after it for
written. The writer asks for that error after each step.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

from asperity._core.file_lock import lock_file
from asperity.errors import OutputError


class RecordingFile(io.FileIO):
    """A new file for h5py's driver for file objects, locked as HDF5 locks its own.

    Parameters
    ----------
    path : Path
        Must not exist.

    Raises
    ------
    OutputError
        It exists or cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self.path, self._failure = path, ""
        try:
            super().__init__(path, "x+")
        except OSError as error:
            raise OutputError(f"cannot write to {path}: {error.strerror or error}") from None
        lock_file(self.fileno())

    def check(self) -> None:
        """Raise `OutputError` if anything could not be written."""
        if self._failure:
            raise OutputError(f"cannot write to {self.path}: {self._failure}")

    def write(self, data: Any) -> int:
        """Write all bytes, or remember why not."""
        view = memoryview(data).cast("B")
        done = 0
        try:
            while done < len(view) and not self._failure:
                done += super().write(view[done:]) or 0
        except OSError as error:
            self._failure = error.strerror or str(error)
        return len(view)

    def readinto(self, buffer: Any) -> int:
        """Read; what was not written is nought."""
        view = memoryview(buffer).cast("B")
        got = super().readinto(view) or 0
        if self._failure:
            view[got:] = bytes(len(view) - got)
            return len(view)
        return got

    def truncate(self, size: int | None = None) -> int:
        """Set the size, or remember why not."""
        try:
            if not self._failure:
                return super().truncate(size)
        except OSError as error:
            self._failure = error.strerror or str(error)
        return self.tell() if size is None else size
