"""The contact worker: computes contacts in a thread beside the loop.

MuJoCo's collision query and the search cannot be interrupted, and take from 0.1 ms to many times a
tick. So they run in a thread that releases the interpreter's lock, and until a new contact is done
the loop extrapolates the last one to first order (`LinearContact`). Averaging over the tool's
motion is meant for one tick, and would slow a late contact down further: after a gap the contact is
evaluated at the tool's pose only. For the same reason a contact evaluates no more sub-poses than
fit into `within` of a tick, and searches that have run for `searched` of a tick return what they
have found.

Two locks hand over: one starts the worker, the other reports that it is done. Only the `direct`
mode waits for it; in the other modes the worker computes while the loop sleeps. What this costs,
and why quick contacts are not computed in the loop: docs/design/servo.md.
"""

from __future__ import annotations

import sys
import threading

import numpy as np
from numpy.typing import NDArray

from asperity.contact.contacts import Contacts
from asperity.dynamics.linear_contact import LinearContact
from asperity.realtime.servo.deadlines import SystemClock
from asperity.simulation.tool_contact import ToolContact

MAX_SHOWN = 16
"""Largest number of contacts kept for display."""
SHOWN = np.dtype(
    [
        ("point", "f8", (MAX_SHOWN, 3)), ("normal", "f8", (MAX_SHOWN, 3)),
        ("force", "f8", (MAX_SHOWN, 3)), ("depth", "f8", MAX_SHOWN),
    ]
)  # fmt: skip
"""What is displayed of contacts: points, normals, forces (n, 3) and depths (n,)."""
WITHIN, WITHIN_SHARED = 0.75, 0.5
"""Share of a tick for a contact's sub-poses; the rest is for handing it over. Project defaults.

The second value applies where the loop works on the same core.
"""
SEARCHED = 0.75
"""Share of a tick after which a contact's searches end; project default.

The rest is for finishing and handing over. On a shared core, this is the time between two ticks.
"""
SWITCH_INTERVAL = 5e-5
"""Longest time that a thread holds the interpreter's lock while another waits for it [s]."""


class ShownContacts:
    """Contacts for display: the fields of `SHOWN`, of which the first `count` rows are valid."""

    point: NDArray[np.float64]
    normal: NDArray[np.float64]
    force: NDArray[np.float64]
    depth: NDArray[np.float64]

    def __init__(self) -> None:
        record = np.zeros(1, SHOWN)
        self.count = 0
        self.numbers: NDArray[np.float64] = record.view(np.float64)
        for name in SHOWN.names or ():
            setattr(self, name, record[name][0])

    def take(self, contacts: Contacts, count: int) -> None:
        """Copy the first `count` of the solver's contacts, as many as there is room for."""
        self.count = n = min(count, MAX_SHOWN)
        if n:
            for name in SHOWN.names or ():
                getattr(self, name)[:n] = getattr(contacts, name)[:n]


class ContactResult:
    """A computed contact: `linear`, to first order, and what is displayed of it."""

    def __init__(self) -> None:
        self.linear = LinearContact(np.zeros(7), np.zeros(6), np.zeros((6, 6)), 0, 0)
        self.shown = ShownContacts()
        self.depth = 0.0
        """Depth of the deepest contact [m]; 0 without contact."""
        self.seconds = 0.0
        """Time that computing it took [s]."""
        self.submitted = 0.0
        """When it was submitted, on the loop's clock [s]."""


class ContactWorker:
    """A thread that computes contacts.

    Parameters
    ----------
    stage : ToolContact
        For the worker's use only, except between `pause` and the next `submit`.
    clock : SystemClock
    within : float
        Share of a tick, counted from submission, for the contact's sub-poses.
    searched : float
        Share of a tick, counted from submission, after which its searches end.
    """

    def __init__(
        self,
        stage: ToolContact,
        clock: SystemClock,
        within: float = WITHIN,
        searched: float = SEARCHED,
    ) -> None:
        self.stage = stage
        self.within, self.searched = within, searched
        self.latest = ContactResult()
        self.busy = False
        self.statuses = np.zeros(3, np.int64)
        """Number of contacts by status: certified, budget spent, overflow (3,)."""
        self._clock = clock
        self._next = ContactResult()
        self._pose = np.zeros(7)
        self._jumped = False
        self._go, self._done = threading.Lock(), threading.Lock()
        self._go.acquire()
        self._done.acquire()
        self._stopping = False
        self._error: BaseException | None = None
        sys.setswitchinterval(SWITCH_INTERVAL)
        self._thread = threading.Thread(target=self._run, name="contact", daemon=True)
        self._thread.start()

    @property
    def thread(self) -> int:
        """The operating system's number of the thread."""
        return self._thread.native_id or 0

    def submit(self, pose: NDArray[np.float64], now: float, *, jumped: bool = False) -> None:
        """Start computing the contact at a pose (7,). Only when not `busy`.

        Parameters
        ----------
        pose : (7,) array
        now : float
            [s], on the loop's clock.
        jumped : bool
            Whether this is not the tick after the one submitted last.
        """
        self._pose[:] = pose
        self._next.submitted = now
        self._jumped = jumped
        self.busy = True
        self._go.release()

    def take(self) -> bool:
        """Make a contact that is done the `latest`; return whether there was a new one.

        Raises whatever the computation raised.
        """
        return self.busy and self._done.acquire(blocking=False) and self._collect()

    def wait(self, seconds: float) -> bool:
        """Wait at most `seconds` for the contact [s]; then do as `take`."""
        return self.busy and self._done.acquire(timeout=max(seconds, 0.0)) and self._collect()

    def rest(self, seconds: float) -> None:
        """Wait at most `seconds` for the contact [s], but do not take it yet."""
        if self.busy and self._done.acquire(timeout=max(seconds, 0.0)):
            self._done.release()

    def stop(self) -> None:
        """End the thread when it has finished its present contact."""
        self._stopping = True
        if not self.busy:
            self._go.release()

    def _collect(self) -> bool:
        self.busy = False
        if self._error is not None:
            raise self._error
        # The old result is overwritten next; the loop holds only the latest.
        self.latest, self._next = self._next, self.latest
        return True

    def _run(self) -> None:
        while True:
            self._go.acquire()
            if self._stopping:
                return
            try:
                self._compute(self._next)
            except BaseException as error:  # handed to the loop, whatever it is
                self._error = error
            self._done.release()
            if self._stopping:
                return

    def _compute(self, out: ContactResult) -> None:
        begun = self._clock.now()
        gone, dt = begun - out.submitted, self.stage.dt
        out.linear = self.stage.evaluate(
            self._pose, jumped=self._jumped,
            seconds=max(self.within * dt - gone, 0.0),
            search_seconds=max(self.searched * dt - gone, 0.0),
        )  # fmt: skip
        contacts, count = self.stage.contacts, out.linear.count
        out.depth = float(contacts.depth[:count].max()) if count else 0.0
        out.shown.take(contacts, count)
        self.stage.count_statuses(self.statuses)
        out.seconds = self._clock.now() - begun
