"""The contact worker: computes contacts in a thread beside the loop.

MuJoCo's collision query and the search cannot be interrupted, and take from 0.1 ms to many times a
tick. So they run in a thread that releases the interpreter's lock, and until a new contact is done
the loop extrapolates the last one to first order (`LinearContact`). Averaging over the tool's
motion is meant for one tick, and would slow a late contact down further: after a gap the contact is
evaluated at the tool's pose only. For the same reason a contact evaluates no more sub-poses than
fit into `within` of a tick, and searches that have run for `searched` of a tick return what they
have found.

Two locks hand over: one starts the worker, the other reports that it is done. A round trip costs 16
to 47 us in the median compared with computing in the loop itself (two cores at 2.5 GHz;
`threading.Event` 35 to 46, a spinning wait 43 to 67), and 40 to 80 us at p99 while no other process
wants the cores. Only the `direct` mode waits for it; in the other modes the worker computes while
the loop sleeps. Computing in the loop while contacts are quick would save the round trip, and was
rejected: the first slow contact would delay the loop by its full length, and contact with a mesh
begins with a slow one.
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

MAX_SHOWN = 16
"""Largest number of contacts kept for display."""
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
    """Contacts for display: points, normals, forces (n, 3) and depths (n,)."""

    def __init__(self) -> None:
        self.count = 0
        self.point, self.normal, self.force = (np.zeros((MAX_SHOWN, 3)) for _ in range(3))
        self.depth = np.zeros(MAX_SHOWN)


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


class ContactSource(Protocol):
    """What the loop needs of whatever computes contacts."""

    latest: ContactResult
    busy: bool

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

    def take(self) -> bool:
        """Make a contact that is done the `latest`; return whether there was a new one."""

    def wait(self, seconds: float) -> bool:
        """Wait at most `seconds` for the contact; then do as `take`."""

    def rest(self, seconds: float) -> None:
        """Wait at most `seconds` for the contact, but do not take it yet."""


class ContactWorker:
    """A thread that computes contacts.

    Parameters
    ----------
    stage : ToolContact
        For the worker's use only, except between `pause` and the next `submit`.
    clock : Clock
    within : float
        Share of a tick, counted from submission, for the contact's sub-poses.
    searched : float
        Share of a tick, counted from submission, after which its searches end.
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
        """Start computing the contact at a pose, as `ContactSource.submit`."""
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
        contacts, shown = self.stage.contacts, out.shown
        count = out.linear.count
        out.depth = float(contacts.depth[:count].max()) if count else 0.0
        shown.count = n = min(count, MAX_SHOWN)
        if n:
            shown.point[:n] = contacts.point[:n]
            shown.normal[:n] = contacts.normal[:n]
            shown.force[:n] = contacts.force[:n]
            shown.depth[:n] = contacts.depth[:n]
        self.stage.count_statuses(self.statuses)
        out.seconds = self._clock.now() - begun
