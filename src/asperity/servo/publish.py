"""Where the loop tells what happened: the ring to the recorder, and the snapshot."""

from __future__ import annotations

from asperity.servo.ring import Ring
from asperity.servo.rows import Row
from asperity.servo.snapshot import SnapshotWriter


class Publisher:
    """Ring and snapshot, either of which may be left out."""

    def __init__(self, ring: Ring | None = None, snapshot: SnapshotWriter | None = None) -> None:
        self.ring = ring
        self.snapshot = snapshot

    def push(self, row: Row) -> None:
        """Send a tick to the recorder."""
        if self.ring is not None:
            self.ring.push(row.values)
