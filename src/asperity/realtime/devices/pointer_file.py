"""The target of the hand, set by a page's pointer: a small shared file, read by the mouse device.

The page writes a target pose whenever the pointer has moved, or a table of poses to play in a loop,
and the normal force to press with. The device reads the file in each tick. If the page ends, the
last target stays.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.realtime.shared_file import SequenceLock, SharedFile

MAX_POSES = 20_000
"""Largest number of poses in a table."""
_POINTER = np.dtype(
    [
        ("sequence", "i8"), ("pose", "f8", 7), ("press", "f8"), ("count", "i8"), ("loop", "i8"),
        ("step", "f8"), ("begun", "f8"), ("side", "i8"), ("unused", "f8", 2),
        ("tables", "f8", (2, MAX_POSES, 7)),
    ]
)  # fmt: skip
"""The file. Of the two tables, the writer fills the one that is not in use."""
_TARGET = ["pose", "press", "count", "loop", "step", "begun", "side"]


class PointerTarget(NamedTuple):
    """What the hand is to do."""

    pose: NDArray[np.float64]
    """Target (7,)."""
    press: float | None
    """Normal force to press with [N]; None: not regulated."""
    table: NDArray[np.float64] | None
    """Poses (n, 7) to play, instead of going to `pose`."""
    loop: int
    """Row of the table that follows after the last."""
    step: float
    """Time from one row to the next [s]."""
    begun: float
    """When the first row was due, on the monotonic clock [s]."""


class PointerFile:
    """Both ends of the file: the page calls `point` and `move`, the device `news`.

    Parameters
    ----------
    path : Path
    pose : (7,) array, optional
        Create the file with this target. Default: open an existing file.

    Raises
    ------
    AsperityError
        There is no such file.
    """

    def __init__(self, path: Path, pose: NDArray[np.float64] | None = None) -> None:
        try:
            self._file = SharedFile(path, None if pose is None else _POINTER.itemsize)
        except OSError as error:
            raise AsperityError(f"no pointer file at {path}: {error}") from None
        self._record = self._file.array(_POINTER)
        self._lock = SequenceLock(self._record["sequence"])
        self._seen = -1
        if pose is not None:
            self.point(pose)

    def point(self, pose: NDArray[np.float64], press: float | None = None) -> None:
        """Send the hand to a pose (7,), pressing with a normal force [N] or without regulation."""
        self._write(pose, press, count=0)

    def move(
        self,
        poses: NDArray[np.float64],
        *,
        loop: int,
        step: float,
        begun: float,
        press: float | None = None,
    ) -> None:
        """Play poses (n, 7), `step` [s] apart, and then again from row `loop`.

        Parameters
        ----------
        poses : (n, 7) array
            1 to `MAX_POSES` of them.
        loop : int
        step : float
        begun : float
            When the first pose is due, on the monotonic clock [s].
        press : float, optional
            Normal force to press with [N]. Default: not regulated.
        """
        if not 1 <= len(poses) <= MAX_POSES:
            raise AsperityError(f"a motion of {len(poses)} poses; valid: 1 to {MAX_POSES}")
        side = 1 - int(self._record["side"])
        self._record["tables"][side, : len(poses)] = poses
        self._write(poses[0], press, count=len(poses), loop=loop, step=step, begun=begun, side=side)

    def news(self) -> PointerTarget | None:
        """Return the target if it is new since the last call, or None. Never waits."""
        if self._lock.number == self._seen:
            return None
        found = self._lock.read(self._record[_TARGET].copy)
        if found is None:
            return None
        self._seen, target = found
        count = int(target["count"])
        table = self._record["tables"][int(target["side"]), :count] if count else None
        press, step, begun = (float(target[name]) for name in ("press", "step", "begun"))
        return PointerTarget(
            target["pose"], None if math.isnan(press) else press, table, int(target["loop"]), step,
            begun,
        )  # fmt: skip

    def _write(
        self, pose: NDArray[np.float64], press: float | None, count: int, **table: float
    ) -> None:
        with self._lock:
            self._record["pose"] = pose
            self._record["press"] = np.nan if press is None else press
            self._record["count"] = count
            for name, value in table.items():
                self._record[name] = value
