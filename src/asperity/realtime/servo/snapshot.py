"""The latest tick for any reader: viewers, progress lines, other programs.

A shared file of one record, which the loop overwrites 250 times a second without waiting for any
reader. A reader always gets the latest snapshot, and may be killed at any time. A sequence lock,
the number in front of the record, shows whether a copy is consistent; the record
itself (`SNAPSHOT`) is an array of doubles, which programs in other languages can read too.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.realtime.servo.contact_worker import SHOWN, ShownContacts
from asperity.realtime.servo.ipc import TICK, TickRecord
from asperity.realtime.shared_file import SequenceLock, SharedFile

SHOWN_RATE = 250.0
"""Snapshots per second that are plenty for a viewer [Hz]."""
_COUNTS = [
    "buttons", "ticks", "misses", "fallbacks", "interventions", "silences", "clamps", "tick_p99",
    "contact_p99",
]  # fmt: skip
_LIKE_TICK = [name for name in TICK.names or () if name != "penetration_depth"]
SNAPSHOT = np.dtype(
    [
        *[(name, TICK[name]) for name in _LIKE_TICK],
        ("handle_twist", "f8", 6), ("tool_twist", "f8", 6),
        *[(name, "f8") for name in _COUNTS],
        ("shown", "f8"), *[(name, SHOWN[name]) for name in SHOWN.names or ()],
    ]
)  # fmt: skip
"""The snapshot file after its sequence number (int64): doubles in this order, for any language.

`shown` is the number of contacts; the other fields are described in `Snapshot`.
"""
FIELDS = {name: SNAPSHOT[name].shape or (1,) for name in SNAPSHOT.names or ()}
"""Names and shapes of the fields in order."""
_SNAPSHOT_OFFSETS = {name: field[1] for name, field in (SNAPSHOT.fields or {}).items()}
_SNAPSHOT_FILE = np.dtype([("sequence", "i8"), ("snapshot", SNAPSHOT)])
_SECONDS = ("time", "tick_p99", "contact_p99")
_ATTEMPTS = 1000


class Snapshot(NamedTuple):
    """The latest tick, with the contacts behind it and counts since the loop began."""

    time: float
    """Since the loop began [s]."""
    handle_pose: NDArray[np.float64]
    """Position [m] and unit quaternion wxyz (7,); so is `tool_pose`."""
    tool_pose: NDArray[np.float64]
    contact_wrench: NDArray[np.float64]
    """Of the contact on the tool about its centre of mass (6,) [N], [N m]."""
    device_wrench: NDArray[np.float64]
    """As sent to the device, as a wrench of the scene about the tool's centre of mass (6,)."""
    contact_count: int
    flags: int
    handle_twist: NDArray[np.float64]
    """Linear [m/s] and angular [rad/s] velocity (6,); so is `tool_twist`."""
    tool_twist: NDArray[np.float64]
    buttons: int
    """Pressed buttons of the device, one bit each."""
    ticks: int
    misses: int
    fallbacks: int
    interventions: int
    """Ticks in which the passivity controller changed the wrench."""
    silences: int
    """Number of times the device fell silent."""
    clamps: int
    """Ticks in which force or torque met a limit."""
    tick_p99: float
    """99th percentile of a tick's work over the last second [s]; 0 in the first."""
    contact_p99: float
    """The same for the time that a contact took."""
    point: NDArray[np.float64]
    """Contact points on the tool's surface (n, 3) [m]; n is at most `MAX_SHOWN`."""
    normal: NDArray[np.float64]
    """(n, 3)"""
    force: NDArray[np.float64]
    """(n, 3) [N]"""
    depth: NDArray[np.float64]
    """(n,) [m]"""

    @staticmethod
    def of(record: NDArray[np.void]) -> Snapshot:
        """Return what a record of dtype `SNAPSHOT` holds."""
        values: dict[str, Any] = {name: record[name] for name in Snapshot._fields}
        for name, value in values.items():
            if name in (SHOWN.names or ()):
                values[name] = value[: int(record["shown"])]
            elif not value.ndim:
                values[name] = float(value) if name in _SECONDS else int(value)
        return Snapshot(**values)


class SnapshotWriter:
    """The loop's end of a snapshot file, which it creates."""

    def __init__(self, path: Path) -> None:
        self._file = SharedFile(path, _SNAPSHOT_FILE.itemsize)
        record = self._file.array(_SNAPSHOT_FILE)
        self._lock = SequenceLock(record["sequence"])
        snapshot = record["snapshot"]
        self._handle_twist, self._tool_twist = snapshot["handle_twist"], snapshot["tool_twist"]
        # Neighbouring fields as one array each: one assignment instead of seven, ten and four.
        numbers = self._file.array(np.float64, (SNAPSHOT.itemsize // 8,), 8)
        twists, counts, contacts = (
            _SNAPSHOT_OFFSETS[name] // 8 for name in ("handle_twist", "buttons", "point")
        )
        self._like_tick, self._counts = numbers[:twists], numbers[counts:contacts]
        self._contacts = numbers[contacts:]

    def write(
        self,
        tick: TickRecord,
        handle_twist: NDArray[np.float64],
        tool_twist: NDArray[np.float64],
        counts: tuple[float, ...],
        contacts: ShownContacts,
    ) -> None:
        """Overwrite the snapshot. Never waits.

        Parameters
        ----------
        tick : TickRecord
        handle_twist, tool_twist : (6,) array
            [m/s], [rad/s].
        counts : tuple
            The fields of `Snapshot` from `buttons` to `contact_p99`.
        contacts : ShownContacts
        """
        with self._lock:
            self._like_tick[:] = tick.numbers[: len(self._like_tick)]
            self._handle_twist[:] = handle_twist
            self._tool_twist[:] = tool_twist
            self._counts[:] = (*counts, contacts.count)
            self._contacts[:] = contacts.numbers


class SnapshotReader:
    """A viewer's end of a snapshot file.

    Parameters
    ----------
    path : Path
        `Servo.snapshot_path` of a loop that has begun.
    sleep : callable
        Waits between two attempts.

    Raises
    ------
    AsperityError
        There is no such file, or it is not a snapshot of this version.
    """

    def __init__(self, path: Path, *, sleep: Callable[[float], None] = time.sleep) -> None:
        try:
            self._file = SharedFile(path)
        except (OSError, ValueError) as error:
            raise AsperityError(f"no snapshot of a servo loop at {path}: {error}") from None
        if self._file.size != _SNAPSHOT_FILE.itemsize:
            raise AsperityError(
                f"{path} has {self._file.size} bytes, a snapshot has {_SNAPSHOT_FILE.itemsize}: "
                "it is of another version"
            )
        record = self._file.array(_SNAPSHOT_FILE)
        self._lock, self._snapshot = SequenceLock(record["sequence"]), record["snapshot"]
        self._sleep = sleep

    def read(self) -> Snapshot | None:
        """Return the latest snapshot; None before the first, or if the writer died in a write."""
        for _ in range(_ATTEMPTS):
            if self._lock.number == 0:
                return None
            found = self._lock.read(self._snapshot.copy)
            if found is not None:
                return Snapshot.of(found[1])
            self._sleep(2e-5)
        return None
