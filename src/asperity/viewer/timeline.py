"""The time that the page shows: now, or an instant of the last seconds or of a recording.

All instruments take their ticks from the timeline, never from the servo client. So they work the
same while a loop runs, while the page is held, and for a recording, and one slider moves through
all of these.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from asperity.realtime.servo.ipc import TICK, Ticks
from asperity.realtime.servo.snapshot import Snapshot
from asperity.viewer.panels.panel import Frame
from asperity.viewer.tick_buffer import TickSequence, TicksInMemory

if TYPE_CHECKING:
    from asperity.viewer.servo_client import ServoClient

HELD_SECONDS = 20.0
"""How much of the past is kept when the page is held [s]."""
_MAX_SNAPSHOTS = 900
_SAME = 0.04
"""Contacts of a snapshot are shown with ticks at most this far from it [s]."""


class Timeline:
    """The instant that the page shows, and the ticks before it.

    Parameters
    ----------
    servo : ServoClient, optional
        Its last seconds are shown unless a held part or a recording is. Without a client the
        timeline has no present.
    rate : float, optional
        Ticks per second without a client [Hz].
    """

    def __init__(self, servo: ServoClient | None = None, *, rate: float = 1000.0) -> None:
        self._servo, self._rate = servo, rate
        self._lock = threading.RLock()
        self._snapshots: deque[tuple[int, Snapshot]] = deque(maxlen=_MAX_SNAPSHOTS)
        self._held: TickSequence | None = None
        self._snapshot_at: Callable[[int], Snapshot | None] = lambda _: None
        self._at = 0.0
        self._last = 0.0
        self.playing = False
        self.speed = 1.0
        self.what = ""
        """What is shown instead of the present, in a few words."""

    # -- which time ----------------------------------------------------------------------------

    @property
    def is_live(self) -> bool:
        """Whether the present is shown."""
        return self._held is None

    @property
    def length(self) -> float:
        """Length of the held part or recording [s]; 0 when live."""
        held = self._held
        return held.length if held is not None else 0.0

    @property
    def at(self) -> float:
        """Position within the held part or recording [s]."""
        return self._at

    @property
    def rate(self) -> float:
        """Nominal ticks per second [Hz]."""
        return float(self._servo.config.rate) if self._servo is not None else self._rate

    @property
    def version(self) -> tuple[bool, float]:
        """A value that changes whenever there is something new to show."""
        if self._held is None and self._servo is not None:
            return True, float(self._servo.history.count)
        return False, self._at

    def hold(self) -> None:
        """Keep the last seconds and stop at their end; the loop goes on."""
        ticks, count = self._recent(HELD_SECONDS)
        if not len(ticks):
            return
        first, seen = count - len(ticks), tuple(self._snapshots)
        none = np.zeros((0, 3))

        def snapshot_at(i: int) -> Snapshot | None:
            # Ticks have no contacts: show those of the nearest snapshot that was taken.
            near = min(seen, key=lambda one: abs(one[0] - first - i - 1), default=None)
            if near is None:
                return None
            if abs(near[0] - first - i - 1) > _SAME * self.rate:
                return near[1]._replace(point=none, normal=none, force=none)
            return near[1]

        self.show(TicksInMemory(ticks), snapshot_at, "the last seconds", at=np.inf)

    def show(
        self,
        ticks: TickSequence,
        snapshot_at: Callable[[int], Snapshot | None],
        what: str,
        *,
        at: float = 0.0,
    ) -> None:
        """Show a sequence of ticks instead of the present.

        Parameters
        ----------
        ticks : TickSequence
        snapshot_at : callable
            Returns a snapshot for a tick's index; used for what a tick does not hold, such as
            contacts.
        what : str
            Description in a few words.
        at : float
            Position to begin at [s].
        """
        with self._lock:
            self._held, self._snapshot_at, self.what = ticks, snapshot_at, what
            self._at, self.playing = float(np.clip(at, 0.0, ticks.length)), False

    def go_live(self) -> None:
        """Show the present, if there is a servo client."""
        with self._lock:
            if self._servo is not None:
                self._held, self.playing, self.what = None, False, ""

    def move_to(self, at: float) -> None:
        """Move to a position within the held part or recording [s]."""
        with self._lock:
            self._at = float(np.clip(at, 0.0, self.length))

    def play(self) -> None:
        """Play from the present position, or from the beginning if it is the end."""
        with self._lock:
            if self._held is not None:
                if self._at >= self.length:
                    self._at = 0.0
                self.playing = True

    def advance(self, frame: Frame) -> None:
        """Advance by the time since the last frame if playing; when live, keep its snapshot."""
        passed, self._last = max(frame.now - self._last, 0.0), frame.now
        with self._lock:
            if self._held is None:
                if frame.snapshot is not None:
                    self._snapshots.append((frame.next_tick, frame.snapshot))
            elif self.playing:
                self._at = min(self._at + self.speed * passed, self.length)
                self.playing = self._at < self.length

    # -- what is shown -------------------------------------------------------------------------

    def window(self, seconds: float) -> Ticks:
        """Return the ticks (n,) of the last seconds up to and including the instant shown."""
        with self._lock:
            held = self._held
            if held is None:
                return self._recent(seconds)[0]
            last = held.index(self._at) + 1
            return held.ticks(held.index(self._at - seconds), last)

    def everything(self) -> Ticks:
        """Return all ticks (n,) that are shown; when live, those of `HELD_SECONDS`."""
        held = self._held
        return self._recent(HELD_SECONDS)[0] if held is None else held.ticks(0, held.count)

    def snapshot(self) -> Snapshot | None:
        """Return the snapshot at the instant shown; None when live."""
        with self._lock:
            held = self._held
            if held is None or not held.count:
                return None
            i = held.index(self._at)
            like = self._snapshot_at(i)
            return None if like is None else snapshot_of(held.ticks(i, i + 1)[0], like)

    def _recent(self, seconds: float) -> tuple[Ticks, int]:
        if self._servo is None:
            return np.empty(0, TICK), 0
        most = int(seconds * self.rate) + 1
        ticks, count = self._servo.ticks_since(max(self._servo.history.count - most, 0))
        # Where ticks were skipped, `most` of them span more than `seconds`.
        time: NDArray[np.float64] = ticks["time"]
        first = np.searchsorted(time, time[-1] - seconds) if len(ticks) else 0
        return ticks[first:], count


class TimelineClient:
    """A servo client whose latest snapshot is the timeline's; otherwise the client itself."""

    def __init__(self, servo: ServoClient, timeline: Timeline) -> None:
        self._servo, self.timeline = servo, timeline

    def latest(self) -> Snapshot | None:
        """Return the snapshot to be shown."""
        shown = self.timeline.snapshot()
        return self._servo.live() if shown is None else shown

    def __getattr__(self, name: str) -> Any:
        return getattr(self._servo, name)


def snapshot_of(tick: np.void, like: Snapshot) -> Snapshot:
    """Return a snapshot with the values of a tick; the rest is as in `like`, at rest."""
    values = {name: tick[name] for name in TICK.names or () if name in Snapshot._fields}
    still = np.zeros(6)
    return like._replace(
        **{
            **values,
            "time": float(tick["time"]), "contact_count": int(tick["contact_count"]),
            "flags": int(tick["flags"]), "handle_twist": still, "tool_twist": still,
        }
    )  # fmt: skip
