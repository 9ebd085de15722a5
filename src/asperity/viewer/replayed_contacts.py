"""Contacts at the poses of a recording, which stores none: recomputed when they are looked at.

A thread computes them, so the page never waits; until they are there, the tick is shown without
contacts. The recording's own contact may have been a first-order extrapolation; this one is not.
"""

from __future__ import annotations

import logging
import threading
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from asperity.realtime.servo.contact_worker import MAX_SHOWN, SHOWN
from asperity.realtime.servo.snapshot import SNAPSHOT, Snapshot

if TYPE_CHECKING:
    from asperity.scene.scene import Scene
    from asperity.simulation.tool_contact import ToolContact
    from asperity.viewer.tick_buffer import RecordedTicks

_NEAR = 50
"""While a recording plays, contacts of a tick this near are shown rather than none [ticks]."""


def empty_snapshot() -> Snapshot:
    """Return a snapshot of zeros, without contacts."""
    return Snapshot.of(np.zeros((), SNAPSHOT))


class RecomputedContacts:
    """Snapshots with the contacts of recorded ticks, as soon as they have been computed.

    Parameters
    ----------
    scene : Scene
    ticks : RecordedTicks
        Closed together with the contacts.
    """

    def __init__(self, scene: Scene, ticks: RecordedTicks) -> None:
        self._scene, self._ticks = scene, ticks
        self._empty = empty_snapshot()
        self._requested = -1
        self._computed: tuple[int, Snapshot] = (-1, self._empty)
        self._request = threading.Event()
        self._closing = False
        self._thread = threading.Thread(target=self._work, name="asperity-contacts", daemon=True)
        self._thread.start()

    def snapshot_at(self, i: int) -> Snapshot:
        """Return a snapshot with the contacts at tick `i`, or without if they are not known yet."""
        at, snapshot = self._computed
        if i != self._requested:
            self._requested = i
            self._request.set()
        return snapshot if abs(at - i) < _NEAR else self._empty

    def close(self) -> None:
        """End the thread, and close the recording."""
        self._closing = True
        self._request.set()
        self._ticks.close()

    def _work(self) -> None:
        from asperity.simulation.tool_contact import ToolContact

        try:
            stage = ToolContact(self._scene)
            while True:
                self._request.wait()
                self._request.clear()
                if self._closing:
                    return
                i = self._requested
                pose = self._ticks.ticks(i, i + 1)["tool_pose"][0]
                self._computed = i, self._evaluated(stage, pose)
        except Exception:  # a recording can be viewed without contacts
            logging.getLogger(__name__).exception("no contacts of the recording are shown")

    def _evaluated(self, stage: ToolContact, pose: NDArray[np.float64]) -> Snapshot:
        stage.reset()
        n = min(stage.evaluate(pose.copy(), jumped=True).count, MAX_SHOWN)
        contacts = stage.contacts
        shown = {name: getattr(contacts, name)[:n].copy() for name in SHOWN.names or ()}
        return self._empty._replace(**shown)
