"""Sequences of ticks that the page shows: the last minute of a loop, a held part, a recording."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from asperity.realtime.servo.ipc import TICK, Ticks
from asperity.runs.recording import require_recording

CAPACITY = 60_000
"""Ticks that a `TickBuffer` keeps: a minute at 1 kHz, 14 MB."""


class TickBuffer:
    """A ring buffer of `TICK` records that one thread fills and other threads read.

    Ticks are numbered from 0, the first that was ever added.

    Parameters
    ----------
    capacity : int
        Ticks that are kept; older ones are dropped.
    """

    def __init__(self, capacity: int = CAPACITY) -> None:
        self._ticks = np.zeros(capacity, TICK)
        self._count = 0
        self._lock = threading.Lock()

    @property
    def count(self) -> int:
        """Number of ticks ever added."""
        return self._count

    def add(self, ticks: Ticks) -> None:
        """Add ticks (n,) in order, in place of the oldest."""
        capacity = len(self._ticks)
        with self._lock:
            kept = ticks[-capacity:]
            first = self._count + len(ticks) - len(kept)
            self._ticks[np.arange(first, first + len(kept)) % capacity] = kept
            self._count += len(ticks)

    def since(self, number: int) -> tuple[Ticks, int]:
        """Return the kept ticks (n,) from a number on, and the number of the next tick to come."""
        with self._lock:
            first = max(number, self._count - len(self._ticks), 0)
            return self._ticks[np.arange(first, self._count) % len(self._ticks)], self._count


class TickSequence:
    """A fixed sequence of ticks.

    Parameters
    ----------
    time : (n,) array
        Increasing [s].
    """

    def __init__(self, time: NDArray[np.float64]) -> None:
        self._time = time
        self.count = len(time)
        self.length = float(time[-1] - time[0]) if len(time) else 0.0
        """Time from the first to the last tick [s]."""

    def index(self, at: float) -> int:
        """Return the index of the last tick not later than `at` seconds after the first."""
        i = int(np.searchsorted(self._time, self._time[0] + at + 1e-9, side="right")) - 1
        return min(max(i, 0), self.count - 1)

    def ticks(self, first: int, last: int) -> Ticks:
        """Return the ticks (n,) with indices from `first` to before `last`."""
        raise NotImplementedError


class TicksInMemory(TickSequence):
    """A sequence of ticks (n,) held in memory."""

    def __init__(self, ticks: Ticks) -> None:
        super().__init__(ticks["time"])
        self._ticks = ticks

    def ticks(self, first: int, last: int) -> Ticks:
        """Return the ticks (n,) with indices from `first` to before `last`."""
        return self._ticks[first:last]


class RecordedTicks(TickSequence):
    """The ticks of a recording; only their times are held in memory. Close it when done.

    Parameters
    ----------
    path : Path
        A `recording.h5`.

    Raises
    ------
    AsperityError
        The file is not a recording.
    """

    def __init__(self, path: Path) -> None:
        import h5py

        count = require_recording(path)
        self._file = h5py.File(path, "r")
        self._lock = threading.Lock()
        super().__init__(np.asarray(self._file["time"][:count], dtype=np.float64))

    def ticks(self, first: int, last: int) -> Ticks:
        """Return the ticks (n,) from `first` to before `last`; NaN where the file has no value."""
        out = np.empty(max(last - first, 0), TICK)
        out.view(np.float64)[:] = np.nan
        with self._lock:
            if self._file:
                for name in TICK.names or ():
                    if name in self._file:
                        out[name] = self._file[name][first:last]
        return out

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._file.close()
