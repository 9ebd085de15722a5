"""The rows of the last seconds, in the page's own memory."""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

from asperity.realtime.servo.tick_row import WIDTH

MOST = 60_000
"""Rows that are kept: a minute at 1 kHz, 14 MB."""


class History:
    """A bounded ring of rows that one thread fills and others read.

    Rows are numbered from 0, from the first there ever was.
    """

    def __init__(self, most: int = MOST) -> None:
        self._rows = np.zeros((most, WIDTH))
        self._count = 0
        self._lock = threading.Lock()

    @property
    def count(self) -> int:
        """How many rows there have been."""
        return self._count

    def add(self, rows: NDArray[np.float64]) -> None:
        """Take rows (n, 30); the oldest go."""
        most = len(self._rows)
        with self._lock:
            kept = rows[-most:]
            first = self._count + len(rows) - len(kept)
            at = np.arange(first, first + len(kept)) % most
            self._rows[at] = kept
            self._count += len(rows)

    def since(self, number: int) -> tuple[NDArray[np.float64], int]:
        """Return the rows from a number on, as far as they are kept, and the next number."""
        with self._lock:
            first = max(number, self._count - len(self._rows), 0)
            at = np.arange(first, self._count) % len(self._rows)
            return self._rows[at], self._count
