"""Where a page wants the hand: a small shared file between whoever points and the mouse device.

The one who points writes a target pose whenever it has moved, or a table of poses to be gone
through again and again, and how hard the hand shall press. The device looks at a number in each
tick and takes what is new. The one who points may end at any time: the last word stays.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.realtime.shared_file import SharedFile

ROOM = 20_000
"""Poses of a table, at most."""
_HEADER = 16
"""Numbers of 8 bytes before the tables."""
_NUMBER = 0
_POSE = slice(1, 8)
_PRESS, _ROWS, _LOOP, _STEP, _BEGUN, _SIDE = 8, 9, 10, 11, 12, 13


class Wanted(NamedTuple):
    """What the hand shall do."""

    number: int
    """Of this word; even, and growing."""
    pose: NDArray[np.float64]
    """Target (7,)."""
    press: float
    """Normal force to press with [N]; NaN: none is regulated."""
    table: NDArray[np.float64] | None
    """Poses (n, 7) to go through, in the place of `pose`."""
    loop: int
    """The row after the last is this one."""
    step: float
    """From row to row [s]."""
    begun: float
    """When the first row was due, on the monotonic clock [s]."""


class Pointed:
    """Both ends: `point` and `move` above, `news` below.

    Parameters
    ----------
    path : Path
    pose : (7,) array, optional
        Make the file, with this target. Default: open the one there is.
    """

    def __init__(self, path: Path, pose: NDArray[np.float64] | None = None) -> None:
        size = None if pose is None else 8 * (_HEADER + 2 * 7 * ROOM)
        try:
            self._file = SharedFile(path, size)
        except OSError as error:
            raise AsperityError(f"nobody points at {path}: {error}") from None
        self._number = self._file.array(np.int64, 1, 0)
        self._values = self._file.array(np.float64, _HEADER, 0)
        tables = self._file.array(np.float64, 2 * 7 * ROOM, 8 * _HEADER)
        self._tables = tables.reshape(2, ROOM, 7)
        self._seen = -1
        if pose is not None:
            self.point(pose)

    def point(self, pose: NDArray[np.float64], press: float | None = None) -> None:
        """Want the hand at a pose (7,), pressing with a normal force [N] or as it comes."""
        self._write(pose, press, rows=0)

    def move(
        self,
        poses: NDArray[np.float64],
        *,
        loop: int,
        step: float,
        begun: float,
        press: float | None = None,
    ) -> None:
        """Want the hand to go through poses (n, 7), `step` [s] apart, and again from row `loop`."""
        if not 1 <= len(poses) <= ROOM:
            raise AsperityError(f"a motion of {len(poses)} poses; valid: 1 to {ROOM}")
        # The side that is not being read.
        side = 1 - int(self._values[_SIDE])
        self._tables[side, : len(poses)] = poses
        self._write(poses[0], press, rows=len(poses), told=(loop, step, begun, side))

    def news(self) -> Wanted | None:
        """Return what is wanted if that is new, or None. Never waits."""
        number = int(self._number[0])
        if number == self._seen or number % 2:
            return None
        values = self._values.copy()
        if int(self._number[0]) != number:
            return None
        self._seen = number
        rows = int(values[_ROWS])
        table = self._tables[int(values[_SIDE]), :rows] if rows else None
        return Wanted(
            number, values[_POSE], float(values[_PRESS]), table, int(values[_LOOP]),
            float(values[_STEP]), float(values[_BEGUN]),
        )  # fmt: skip

    def _write(
        self,
        pose: NDArray[np.float64],
        press: float | None,
        *,
        rows: int,
        told: tuple[float, float, float, float] | None = None,
    ) -> None:
        values = self._values
        self._number[0] += 1
        values[_POSE] = pose
        values[_PRESS] = np.nan if press is None else press
        values[_ROWS] = rows
        if told is not None:
            values[_LOOP], values[_STEP], values[_BEGUN], values[_SIDE] = told
        self._number[0] += 1
