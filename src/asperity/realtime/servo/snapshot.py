"""The present moment for whoever wants to look: viewers, progress lines, other programs.

A shared file of one record. The loop overwrites it 250 times a second and waits for nobody; a
reader gets the latest, however often it looks, and can be killed at any time. Whether it has read
one moment and not two halves, it sees from a number that the writer makes odd before and even after
(a sequence lock): equal and even before and after reading is whole.

The record is an array of doubles after the number; `FIELDS` says what they are, so that other
languages can read it too.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.realtime.servo.contact_worker import SHOWN, Shown
from asperity.realtime.shared_file import SharedFile

FIELDS = {
    "time": (1,), "handle_pose": (7,), "tool_pose": (7,), "contact_wrench": (6,),
    "device_wrench": (6,), "contact_count": (1,), "flags": (1,),
    "handle_twist": (6,), "tool_twist": (6,), "buttons": (1,),
    "ticks": (1,), "misses": (1,), "fallbacks": (1,), "interventions": (1,), "silences": (1,),
    "clamps": (1,), "tick_p99": (1,), "contact_p99": (1,),
    "shown": (1,), "point": (SHOWN, 3), "normal": (SHOWN, 3), "force": (SHOWN, 3),
    "depth": (SHOWN,),
}  # fmt: skip
"""Names and shapes, in order. SI units, world axes; the first seven are those of a recording."""
_COUNT = sum(int(np.prod(shape)) for shape in FIELDS.values())
_SECONDS = ("time", "tick_p99", "contact_p99")
_TRIES = 1000


class Snapshot(NamedTuple):
    """One tick: what `FIELDS` says; contacts only as many as there are."""

    time: float
    handle_pose: NDArray[np.float64]
    tool_pose: NDArray[np.float64]
    contact_wrench: NDArray[np.float64]
    device_wrench: NDArray[np.float64]
    contact_count: int
    flags: int
    handle_twist: NDArray[np.float64]
    tool_twist: NDArray[np.float64]
    buttons: int
    ticks: int
    misses: int
    fallbacks: int
    interventions: int
    silences: int
    clamps: int
    """Ticks in which force or torque met a limit."""
    tick_p99: float
    """Of how long a tick's work took in the last second [s]; 0 before there was one."""
    contact_p99: float
    """The same of a contact."""
    point: NDArray[np.float64]
    """On the tool's surface (n, 3) [m]; so are `normal` and `force` [N]."""
    normal: NDArray[np.float64]
    force: NDArray[np.float64]
    depth: NDArray[np.float64]
    """(n,) [m]"""


def _views(values: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    out, at = {}, 0
    for name, shape in FIELDS.items():
        size = int(np.prod(shape))
        out[name] = values[at : at + size].reshape(shape)
        at += size
    return out


class SnapshotWriter:
    """The loop's end: makes the file."""

    def __init__(self, path: Path) -> None:
        self._file = SharedFile(path, 8 * (1 + _COUNT))
        self._sequence = self._file.array(np.int64, 1, 0)
        self._number = 0
        values = self._file.array(np.float64, _COUNT, 8)
        views = _views(values)
        self._row = values[: _offset("handle_twist")]
        self._handle_twist, self._tool_twist = views["handle_twist"], views["tool_twist"]
        self._counts = values[_offset("buttons") : _offset("point")]
        self._point, self._normal = views["point"], views["normal"]
        self._force, self._depth = views["force"], views["depth"]
        self._last_shown: Shown | None = None

    def write(
        self,
        row: NDArray[np.float64],
        handle_twist: NDArray[np.float64],
        tool_twist: NDArray[np.float64],
        counts: tuple[float, ...],
        shown: Shown,
    ) -> None:
        """Overwrite the moment: the row of a recording, twists, numbers from `buttons` on.

        Of the row, what `FIELDS` has of it; the depths are told contact by contact.
        """
        self._number += 1
        self._sequence[0] = self._number
        self._row[:] = row[: len(self._row)]
        self._handle_twist[:] = handle_twist
        self._tool_twist[:] = tool_twist
        n = shown.count
        self._counts[:] = (*counts, n)
        if n:
            self._point[:n] = shown.point[:n]
            self._normal[:n] = shown.normal[:n]
            self._force[:n] = shown.force[:n]
            self._depth[:n] = shown.depth[:n]
        self._number += 1
        self._sequence[0] = self._number


class SnapshotReader:
    """A looker-on's end.

    Parameters
    ----------
    path : Path
        The file, which has to be there.
    sleep : callable
        What to do between two attempts.
    """

    def __init__(self, path: Path, *, sleep: Callable[[float], None] = time.sleep) -> None:
        try:
            self._file = SharedFile(path)
        except (OSError, ValueError) as error:
            raise AsperityError(f"no snapshot of a servo loop at {path}: {error}") from None
        if self._file.size != 8 * (1 + _COUNT):
            raise AsperityError(
                f"{path} has {self._file.size} bytes, a snapshot has {8 * (1 + _COUNT)}: "
                "it is of another version"
            )
        self._sequence = self._file.array(np.int64, 1, 0)
        self._values = self._file.array(np.float64, _COUNT, 8)
        self._sleep = sleep

    def read(self) -> Snapshot | None:
        """Return the latest moment; None before the first, or if the writer died amid writing."""
        for _ in range(_TRIES):
            before = int(self._sequence[0])
            if before == 0:
                return None
            if before % 2 == 0:
                values = self._values.copy()
                if int(self._sequence[0]) == before:
                    return _moment(_views(values))
            self._sleep(2e-5)
        return None


def _offset(name: str) -> int:
    at = 0
    for other, shape in FIELDS.items():
        if other == name:
            break
        at += int(np.prod(shape))
    return at


def _moment(views: dict[str, NDArray[np.float64]]) -> Snapshot:
    n = int(views["shown"][0])
    return Snapshot(
        **{  # type: ignore[arg-type]
            name: view[:n]
            if name in ("point", "normal", "force", "depth")
            else float(view[0])
            if name in _SECONDS
            else int(view[0])
            if view.shape == (1,)
            else view
            for name, view in views.items()
            if name != "shown"
        }
    )
