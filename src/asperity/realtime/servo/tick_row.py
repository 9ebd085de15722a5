"""What the loop tells of a tick: one row of numbers, and where in it each thing stands."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FIELDS = {
    "time": 1, "handle_pose": 7, "tool_pose": 7, "contact_wrench": 6, "device_wrench": 6,
    "contact_count": 1, "flags": 1, "penetration_depth": 1,
}  # fmt: skip
"""As in `recording.h5`, and how many numbers each is."""
WIDTH = sum(FIELDS.values())


class TickRow:
    """One tick, filled in place: `values` (30,), and a view for each of `FIELDS`."""

    def __init__(self) -> None:
        self.values = np.zeros(WIDTH)
        places = slices()
        self.time = self.values[places["time"]]
        self.handle_pose = self.values[places["handle_pose"]]
        self.tool_pose = self.values[places["tool_pose"]]
        self.contact_wrench = self.values[places["contact_wrench"]]
        self.device_wrench = self.values[places["device_wrench"]]
        self.contact_count = self.values[places["contact_count"]]
        self.flags = self.values[places["flags"]]
        self.penetration_depth = self.values[places["penetration_depth"]]


def slices() -> dict[str, slice]:
    """Return where in a row each field stands."""
    out, at = {}, 0
    for name, width in FIELDS.items():
        out[name] = slice(at, at + width)
        at += width
    return out


def columns(rows: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Return the fields of rows (n, 30), as `RecordingWriter.add_rows` takes them."""
    return {
        name: rows[:, place.start] if place.stop - place.start == 1 else rows[:, place]
        for name, place in slices().items()
    }
