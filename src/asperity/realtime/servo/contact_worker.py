"""The contact, computed beside the loop: asked for at a pose, collected when it is done.

MuJoCo's collision query and what leads to a search cannot be interrupted, and with the search take
from 0.1 ms to many times a tick. So they run in a thread of their own, which gives the
interpreter's lock away while they do, and the loop goes on with the last contact to first order
(`LinearContact`) until the new one is there. Averaging over a tick's motion makes no sense after a
longer one, and would make a slow contact slower yet: such a contact is looked at where the tool
is, and nowhere else. For the same reason a contact looks at no more sub-poses than fit into
`within` of a tick, and searches that are not done after `searched` of it end with what they have
found.

Two locks hand over: one lets the worker go, the other tells that it is done. Handing over and back
costs 16 to 47 us in the median beside computing in the loop itself (two cores at 2.5 GHz;
`threading.Event` 35 to 46, a spinning wait 43 to 67), and 40 to 80 us at p99 while no other process
wants the cores. Only the `direct` mode waits for it; in the others the worker computes while the
loop sleeps. Computing in the loop whenever the last contacts were quick would save that, and was
decided against: the first slow contact then makes the loop late by its whole length, and contact
with a mesh begins with a slow one.
"""

from __future__ import annotations

import sys
import threading
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics.linear_contact import LinearContact
from asperity.realtime.servo.deadlines import Clock
from asperity.simulation.tool_contact import ToolContact

SHOWN = 16
"""So many contacts are kept to be shown, at most."""
WITHIN, WITHIN_SHARED = 0.75, 0.5
"""Part of a tick that a contact's sub-poses may take; ours: what is left hands it over.

The second where the loop's own work is done on the same core.
"""
SEARCHED = 0.75
"""Part of a tick after which a contact's searches end; ours.

What is left is for what they still do then, and for handing over. Where the core is shared it is
the contact's between two ticks.
"""
SWITCH_INTERVAL = 5e-5
"""How long a thread may hold the interpreter's lock while another wants it [s]."""


class Shown:
    """Contacts for those who look on: points, normals, forces (n, 3) and depths (n,)."""

    def __init__(self) -> None:
        self.count = 0
        self.point, self.normal, self.force = (np.zeros((SHOWN, 3)) for _ in range(3))
        self.depth = np.zeros(SHOWN)


class Contact:
    """A contact that was computed: `linear`, to first order, and what there is to show of it."""

    def __init__(self) -> None:
        self.linear = LinearContact(np.zeros(7), np.zeros(6), np.zeros((6, 6)), 0, 0)
        self.shown = Shown()
        self.depth = 0.0
        """Of the deepest contact [m]; 0 without any."""
        self.seconds = 0.0
        """How long it took [s]."""
        self.asked = 0.0
        """When it was asked for [s], on the clock."""


class ContactSource(Protocol):
    """What the loop asks of whoever computes contacts."""

    latest: Contact
    busy: bool

    def submit(self, pose: NDArray[np.float64], now: float, *, jumped: bool = False) -> None:
        """Ask for the contact at a pose (7,). Only when not `busy`.

        `jumped`: it is not the next tick after the last one that was asked for.
        """

    def take(self) -> bool:
        """Make a contact that is done the `latest`; return whether there was a new one."""

    def wait(self, seconds: float) -> bool:
        """Do as `take`, and wait for it at most so long."""

    def rest(self, seconds: float) -> None:
        """Do nothing until the contact is done, for at most so long; it is not taken yet."""


class ContactWorker:
    """A thread that computes contacts.

    Parameters
    ----------
    stage : ToolContact
        Nobody else may use it from now on, but between `pause` and the next `submit`.
    clock : Clock
    within : float
        Part of a tick, counted from when a contact was asked for, that its sub-poses may take.
    searched : float
        And after which its searches end.
    """

    def __init__(
        self,
        stage: ToolContact,
        clock: Clock,
        within: float = WITHIN,
        searched: float = SEARCHED,
    ) -> None:
        self.stage = stage
        self.within, self.searched = within, searched
        self.latest = Contact()
        self.busy = False
        self.statuses = np.zeros(3, np.int64)
        """Contacts by status: certified, budget spent, overflow."""
        self._clock = clock
        self._next = Contact()
        self._pose = np.zeros(7)
        self._jumped = False
        self._go, self._done = threading.Lock(), threading.Lock()
        self._go.acquire()
        self._done.acquire()
        self._stopping = False
        self._error: BaseException | None = None
        sys.setswitchinterval(SWITCH_INTERVAL)
        self._thread = threading.Thread(target=self._work, name="contact", daemon=True)
        self._thread.start()

    @property
    def thread(self) -> int:
        """The system's number of the thread."""
        return self._thread.native_id or 0

    def submit(self, pose: NDArray[np.float64], now: float, *, jumped: bool = False) -> None:
        """Ask for the contact at a pose (7,). Only when not `busy`.

        `jumped`: it is not the next tick after the last one that was asked for.
        """
        self._pose[:] = pose
        self._next.asked = now
        self._jumped = jumped
        self.busy = True
        self._go.release()

    def take(self) -> bool:
        """Make a contact that is done the `latest`; return whether there was a new one.

        Raises what the computation raised.
        """
        return self.busy and self._done.acquire(blocking=False) and self._collect()

    def wait(self, seconds: float) -> bool:
        """Do as `take`, and wait for it at most so long [s]."""
        return self.busy and self._done.acquire(timeout=max(seconds, 0.0)) and self._collect()

    def rest(self, seconds: float) -> None:
        """Do nothing until the contact is done, for at most so long [s]; it is not taken yet."""
        if self.busy and self._done.acquire(timeout=max(seconds, 0.0)):
            self._done.release()

    def stop(self) -> None:
        """End the thread once it is done with what it does."""
        self._stopping = True
        if not self.busy:
            self._go.release()

    def _collect(self) -> bool:
        self.busy = False
        if self._error is not None:
            raise self._error
        # The old one is filled next: the loop holds only the latest.
        self.latest, self._next = self._next, self.latest
        return True

    def _work(self) -> None:
        while True:
            self._go.acquire()
            if self._stopping:
                return
            try:
                self._evaluate(self._next)
            except BaseException as error:  # the loop has to learn of it, whatever it is
                self._error = error
            self._done.release()
            if self._stopping:
                return

    def _evaluate(self, out: Contact) -> None:
        begun = self._clock.now()
        gone, dt = begun - out.asked, self.stage.dt
        out.linear = self.stage.evaluate(
            self._pose, jumped=self._jumped,
            seconds=max(self.within * dt - gone, 0.0),
            search_seconds=max(self.searched * dt - gone, 0.0),
        )  # fmt: skip
        contacts, shown = self.stage.contacts, out.shown
        count = out.linear.count
        out.depth = float(contacts.depth[:count].max()) if count else 0.0
        shown.count = n = min(count, SHOWN)
        if n:
            shown.point[:n] = contacts.point[:n]
            shown.normal[:n] = contacts.normal[:n]
            shown.force[:n] = contacts.force[:n]
            shown.depth[:n] = contacts.depth[:n]
        self.stage.count_statuses(self.statuses)
        out.seconds = self._clock.now() - begun
