"""How the processes of a servo session communicate: memory-mapped files, and no locks.

    TickRing     every tick, from the loop to the recorder or the page
    snapshot     the latest tick with contacts and counts, for any reader (`snapshot.py`)
    Mailbox      parameters, start and stop, from the parent to the loop

The loop writes and reads all of them without ever waiting, and no force travels through any of
them. A process at the other end may be slow, or be killed at any moment.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.realtime.shared_file import SequenceLock, SharedFile

RING, SNAPSHOT, MAILBOX = "ring", "snapshot", "mailbox"
"""Names of the files in the shared folder of a session."""
Ticks = NDArray[np.void]
"""An array of `TICK` records."""

TICK = np.dtype(
    [
        ("time", "f8"), ("handle_pose", "f8", 7), ("tool_pose", "f8", 7),
        ("contact_wrench", "f8", 6), ("device_wrench", "f8", 6), ("contact_count", "f8"),
        ("flags", "f8"), ("penetration_depth", "f8"),
    ]
)  # fmt: skip
"""One tick: the variables of `recording.h5`, in SI units and world axes."""


class TickRecord:
    """One tick, filled in place: a `TICK` record, its numbers (30,), and a view of each field."""

    time: NDArray[np.float64]
    handle_pose: NDArray[np.float64]
    tool_pose: NDArray[np.float64]
    contact_wrench: NDArray[np.float64]
    device_wrench: NDArray[np.float64]
    contact_count: NDArray[np.float64]
    flags: NDArray[np.float64]
    penetration_depth: NDArray[np.float64]

    def __init__(self) -> None:
        records = np.zeros(1, TICK)
        self.record: Ticks = records.reshape(())
        self.numbers: NDArray[np.float64] = records.view(np.float64)
        for name in TICK.names or ():
            setattr(self, name, self.record[name])


RING_SECONDS = 8.0
"""Capacity of a session's ring [s]."""
_RING_HEADER = np.dtype(
    {
        "names": ["head", "tail", "lost", "closed"],
        "formats": ["i8"] * 4,
        "offsets": [0, 64, 72, 80],  # head and tail on different cache lines
        "itemsize": 128,
    }
)


class TickRing:
    """A ring buffer of ticks with one writer and one reader, in different processes.

    Only the writer moves `head` and only the reader moves `tail`; both only grow, and a tick is
    written before `head` passes it. If the ring is full, the writer drops the tick and counts it.

    Parameters
    ----------
    path : Path
    capacity : int, optional
        Create the file with room for this many ticks. Default: open an existing file.
    """

    def __init__(self, path: Path, capacity: int | None = None) -> None:
        start = _RING_HEADER.itemsize
        size = None if capacity is None else start + capacity * TICK.itemsize
        self._file = SharedFile(path, size)
        self.capacity = (self._file.size - start) // TICK.itemsize
        header = self._file.array(_RING_HEADER)
        self._head, self._tail = header["head"], header["tail"]
        self._lost, self._closed = header["lost"], header["closed"]
        self._ticks = self._file.array(TICK, (self.capacity,), start)
        self._next = int(self._head)

    def push(self, tick: Ticks) -> bool:
        """Write one `TICK` record; return whether there was room for it. Never waits."""
        head = self._next
        if head - int(self._tail) >= self.capacity:
            self._lost[...] += 1
            return False
        self._ticks[head % self.capacity] = tick
        self._next = head + 1
        self._head[...] = self._next
        return True

    def take(self) -> Ticks:
        """Return the waiting ticks (n,) of dtype `TICK` in order, and free their places."""
        head, tail = int(self._head), int(self._tail)
        ticks = self._ticks[np.arange(tail, head) % self.capacity]
        self._tail[...] = head
        return ticks

    def close(self) -> None:
        """Mark the end: no further ticks will come."""
        self._closed[...] = 1

    @property
    def is_closed(self) -> bool:
        """Whether the writer has marked the end."""
        return bool(self._closed)

    @property
    def lost(self) -> int:
        """Number of ticks that were dropped because the ring was full."""
        return int(self._lost)


MAX_TEXT = 16_000
"""Largest message of a mailbox [bytes]."""
_MAILBOX = np.dtype(
    {
        "names": ["sequence", "length", "stop", "go", "text"],
        "formats": ["i8", "i8", "i8", "i8", ("u1", MAX_TEXT)],
        "offsets": [0, 64, 72, 80, 128],
    }
)


class Mailbox:
    """Messages to a running loop, which checks for them after each tick.

    The parent calls `send`, `go` and `stop`; the loop calls `news` and reads `may_go` and
    `must_stop`, each of which costs it less than a microsecond. The loop does not answer here.

    Parameters
    ----------
    path : Path
    create : bool
        Create the file. Default: open an existing file.
    """

    def __init__(self, path: Path, *, create: bool = False) -> None:
        self._file = SharedFile(path, _MAILBOX.itemsize if create else None)
        self._record = self._file.array(_MAILBOX)
        self._lock = SequenceLock(self._record["sequence"])
        self._seen = 0

    def send(self, parameters: Mapping[str, Any]) -> None:
        """Send parameters; they replace any that the loop has not yet taken.

        Raises
        ------
        AsperityError
            Their JSON is longer than `MAX_TEXT` bytes.
        """
        text = json.dumps(parameters).encode()
        if len(text) > MAX_TEXT:
            raise AsperityError(f"parameters of {len(text)} bytes; there is room for {MAX_TEXT}")
        with self._lock:
            self._record["length"] = len(text)
            self._record["text"][: len(text)] = np.frombuffer(text, np.uint8)

    def news(self) -> dict[str, Any] | None:
        """Return the parameters sent since the last call, or None. Never waits."""
        if self._lock.number == self._seen:
            return None
        found = self._lock.read(
            lambda: self._record["text"][: int(self._record["length"])].tobytes()
        )
        if found is None:
            return None
        self._seen, text = found
        parameters: dict[str, Any] = json.loads(text)
        return parameters

    def stop(self) -> None:
        """Stop the loop after its present tick."""
        self._record["stop"] = 1

    def go(self) -> None:
        """Release a loop that was started with `ServoSpec.held`."""
        self._record["go"] = 1

    @property
    def may_go(self) -> bool:
        """Whether `go` has been called."""
        return bool(self._record["go"])

    @property
    def must_stop(self) -> bool:
        """Whether `stop` has been called."""
        return bool(self._record["stop"])


_CALLS_PER_CHECK = 5
"""Calls of `is_gone` per actual check, on systems where a check is expensive."""


class ParentProcess:
    """The process that started this one."""

    def __init__(self) -> None:
        self._number = os.getppid()
        self._calls = 0

    def is_gone(self) -> bool:
        """Return whether it has ended."""
        if sys.platform != "win32":
            return os.getppid() != self._number  # an orphan is given to another parent
        self._calls += 1
        parent = multiprocessing.parent_process()
        return self._calls % _CALLS_PER_CHECK == 0 and parent is not None and not parent.is_alive()
