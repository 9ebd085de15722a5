"""Where the loop tells what happened: the ring to the recorder, and the snapshot."""

from __future__ import annotations

from asperity.realtime.servo.ring import TickRing
from asperity.realtime.servo.snapshot import SnapshotWriter
from asperity.realtime.servo.tick_row import TickRow

SHOWN_RATE = 250.0
"""Moments that are shown, a second."""


class Publisher:
    """Ring and snapshot, either of which may be left out.

    Parameters
    ----------
    ring : Ring, optional
    snapshot : SnapshotWriter, optional
    every : int
        The snapshot is of every so many ticks; `SHOWN_RATE` a second are enough for eyes.
    """

    def __init__(
        self,
        ring: TickRing | None = None,
        snapshot: SnapshotWriter | None = None,
        *,
        every: int = 1,
    ) -> None:
        self.ring = ring
        self.snapshot = snapshot
        self.every = every

    def push(self, row: TickRow) -> None:
        """Send a tick to the recorder."""
        if self.ring is not None:
            self.ring.push(row.values)
