"""Rows that were kept: the last seconds in memory, or a recording, read as it is looked at."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from asperity.realtime.servo.tick_row import FIELDS, WIDTH, slices
from asperity.runs.recording import require_recording


class Kept(Protocol):
    """Rows with times that only grow."""

    count: int
    length: float
    """From the first to the last [s]."""

    def index(self, at: float) -> int:
        """Return which row stands at a time since the first [s]."""

    def rows(self, first: int, last: int) -> NDArray[np.float64]:
        """Return the rows (n, 30) from one to before another."""


class KeptRows:
    """Rows (n, 30) in memory."""

    def __init__(self, rows: NDArray[np.float64]) -> None:
        self._rows = rows
        self.count = len(rows)
        self.length = float(rows[-1, 0] - rows[0, 0]) if len(rows) else 0.0

    def index(self, at: float) -> int:
        """Return which row stands at a time since the first [s]."""
        return _index(self._rows[:, 0], at)

    def rows(self, first: int, last: int) -> NDArray[np.float64]:
        """Return the rows (n, 30) from one to before another."""
        return self._rows[first:last]


class KeptRecording:
    """A recording's rows: only its times are in memory. Close it when done.

    Parameters
    ----------
    path : Path
        Of a `recording.h5`; refused if it is none.
    """

    def __init__(self, path: Path) -> None:
        import h5py

        self.count = require_recording(path)
        self._file = h5py.File(path, "r")
        self._lock = threading.Lock()
        self.attributes: dict[str, Any] = dict(self._file.attrs)
        self._time = np.asarray(self._file["time"][: self.count], dtype=np.float64)
        self.length = float(self._time[-1] - self._time[0]) if self.count else 0.0

    def index(self, at: float) -> int:
        """Return which row stands at a time since the first [s]."""
        return _index(self._time, at)

    def rows(self, first: int, last: int) -> NDArray[np.float64]:
        """Return the rows (n, 30) from one to before another; NaN where the file does not say."""
        out = np.full((max(last - first, 0), WIDTH), np.nan)
        with self._lock:
            if self._file:
                for name, place in slices().items():
                    if name in self._file:
                        part = self._file[name][first:last]
                        out[:, place] = part.reshape(-1, FIELDS[name])
        return out

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._file.close()


def _index(time: NDArray[np.float64], at: float) -> int:
    """Return the last place whose time is not after `at` seconds from the first."""
    i = int(np.searchsorted(time, time[0] + at + 1e-9, side="right")) - 1
    return min(max(i, 0), len(time) - 1)
