"""The rows of all ticks on their way from the loop to the recorder: a ring in a shared file.

One process writes and one reads, without a lock: the writer alone moves `head`, the reader alone
moves `tail`, both only ever grow, and a row is written before `head` passes it. A writer that finds
the ring full counts the row as lost and goes on.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from asperity.realtime.servo.tick_row import WIDTH
from asperity.realtime.shared_file import SharedFile

SECONDS = 8.0
"""Of room."""
_HEAD, _TAIL, _LOST, _CLOSED = 0, 8, 9, 10
"""Places in the header; head and tail lie on different lines of the cache."""
_HEADER = 16


class TickRing:
    """Rows on their way.

    Parameters
    ----------
    path : Path
    capacity : int, optional
        Make the file, with room for so many rows. Default: open the one there is.
    """

    def __init__(self, path: Path, capacity: int | None = None) -> None:
        size = None if capacity is None else 8 * (_HEADER + capacity * WIDTH)
        self._file = SharedFile(path, size)
        self.capacity = (self._file.size // 8 - _HEADER) // WIDTH
        self._header = self._file.array(np.int64, _HEADER, 0)
        rows = self._file.array(np.float64, self.capacity * WIDTH, 8 * _HEADER)
        self._rows = rows.reshape(self.capacity, WIDTH)
        self._head = int(self._header[_HEAD])

    def push(self, row: NDArray[np.float64]) -> bool:
        """Write a row (30,); return whether there was room for it. Never waits."""
        header, head = self._header, self._head
        if head - int(header[_TAIL]) >= self.capacity:
            header[_LOST] += 1
            return False
        self._rows[head % self.capacity] = row
        self._head = head + 1
        header[_HEAD] = self._head
        return True

    def take(self) -> NDArray[np.float64]:
        """Return all rows there are (n, 30), in order, and make room for others."""
        head, tail = int(self._header[_HEAD]), int(self._header[_TAIL])
        at = np.arange(tail, head) % self.capacity
        rows = self._rows[at]
        self._header[_TAIL] = head
        return rows

    def close(self) -> None:
        """Say that no more rows will come."""
        self._header[_CLOSED] = 1

    @property
    def is_closed(self) -> bool:
        """Whether no more rows will come."""
        return bool(self._header[_CLOSED])

    @property
    def lost(self) -> int:
        """How many rows found no room."""
        return int(self._header[_LOST])

    @property
    def written(self) -> int:
        """How many rows have been written."""
        return int(self._header[_HEAD])
