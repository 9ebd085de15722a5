"""What time the page shows: now, or a moment of what was kept: the last seconds, or a recording.

All instruments ask the timeline for the rows that lead up to the moment shown, and never a link, so
that they work the same while a loop runs, while the page is held, and for a recording. What is
moved through a recording is moved through the last seconds as well: there is one slider.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from asperity.realtime.servo.snapshot import Snapshot
from asperity.realtime.servo.tick_row import columns
from asperity.viewer.panels.panel import Frame
from asperity.viewer.row_buffer import Kept, KeptRows

if TYPE_CHECKING:
    from asperity.viewer.servo_client import ServoClient

LOOKED_BACK = 20.0
"""So many of the last seconds are kept when the page is held."""
_MOMENTS = 900


class Timeline:
    """The moment that the page shows, and the rows before it.

    Parameters
    ----------
    link : Link, optional
        Whose last seconds are shown, unless something else is. Without one, there is no now.
    rate : float, optional
        Ticks a second, without a link.
    """

    def __init__(self, link: ServoClient | None = None, *, rate: float = 1000.0) -> None:
        self._link, self._rate = link, rate
        self._lock = threading.RLock()
        self._moments: deque[tuple[int, Snapshot]] = deque(maxlen=_MOMENTS)
        self._kept: Kept | None = None
        self._moment_at: Callable[[int], Snapshot | None] = lambda _: None
        self._at = 0.0
        self._last = 0.0
        self.playing = False
        self.speed = 1.0
        self.what = ""
        """What is shown instead of now, in a few words."""

    # -- which time ----------------------------------------------------------------------------

    @property
    def is_live(self) -> bool:
        """Whether what is shown is now."""
        return self._kept is None

    @property
    def length(self) -> float:
        """Of what is kept [s]; 0 when live."""
        kept = self._kept
        return kept.length if kept is not None else 0.0

    @property
    def at(self) -> float:
        """Where in what is kept [s]."""
        return self._at

    @property
    def rate(self) -> float:
        """Ticks a second, as was asked for."""
        return float(self._link.choice.rate) if self._link is not None else self._rate

    @property
    def version(self) -> tuple[bool, float]:
        """Another one when there is something else to show."""
        if self._kept is None and self._link is not None:
            return True, float(self._link.history.count)
        return False, self._at

    def hold(self) -> None:
        """Keep the last seconds, and stand at the last of them, whatever the loop does."""
        rows, count = self._recent(LOOKED_BACK)
        if not len(rows):
            return
        first, seen = count - len(rows), tuple(self._moments)

        def moment_at(i: int) -> Snapshot | None:
            # Rows have no contacts; those of the nearest frame that was seen are shown.
            near = min(seen, key=lambda one: abs(one[0] - first - i - 1), default=None)
            return near[1] if near is not None else None

        self.show(KeptRows(rows), moment_at, "the last seconds", at=np.inf)

    def show(
        self, kept: Kept, moment_at: Callable[[int], Snapshot | None], what: str, *, at: float = 0.0
    ) -> None:
        """Show what was kept instead of now.

        Parameters
        ----------
        kept : Kept
        moment_at : callable
            Returns a moment that is like the one of a row, for what rows do not have.
        what : str
            In a few words.
        at : float
            Where to begin [s].
        """
        with self._lock:
            self._kept, self._moment_at, self.what = kept, moment_at, what
            self._at, self.playing = float(np.clip(at, 0.0, kept.length)), False

    def go_live(self) -> None:
        """Show what is now."""
        with self._lock:
            if self._link is not None:
                self._kept, self.playing, self.what = None, False, ""

    def move_to(self, at: float) -> None:
        """Stand at a time of what is kept [s]."""
        with self._lock:
            self._at = float(np.clip(at, 0.0, self.length))

    def play(self) -> None:
        """Go on from where it stands; from the end, begin anew."""
        with self._lock:
            if self._kept is not None:
                if self._at >= self.length:
                    self._at = 0.0
                self.playing = True

    def advance(self, frame: Frame) -> None:
        """Go on with the page's time, if it plays; remember what rows do not have."""
        passed, self._last = max(frame.now - self._last, 0.0), frame.now
        with self._lock:
            if self._kept is None:
                if frame.moment is not None:
                    self._moments.append((frame.next_row, frame.moment))
            elif self.playing:
                self._at = min(self._at + self.speed * passed, self.length)
                self.playing = self._at < self.length

    # -- what there is to show -----------------------------------------------------------------

    def window(self, seconds: float) -> NDArray[np.float64]:
        """Return the rows (n, 30) of the last seconds before the moment shown, and of it."""
        with self._lock:
            kept = self._kept
            if kept is None:
                return self._recent(seconds)[0]
            last = kept.index(self._at) + 1
            return kept.rows(kept.index(self._at - seconds), last)

    def everything(self) -> NDArray[np.float64]:
        """Return all rows (n, 30) there are to look back at; of now, `LOOKED_BACK` seconds."""
        kept = self._kept
        return self._recent(LOOKED_BACK)[0] if kept is None else kept.rows(0, kept.count)

    def moment(self) -> Snapshot | None:
        """Return the moment that is shown instead of now; None when live."""
        with self._lock:
            kept = self._kept
            if kept is None or not kept.count:
                return None
            i = kept.index(self._at)
            like = self._moment_at(i)
            return None if like is None else moment_of(kept.rows(i, i + 1)[0], like)

    def _recent(self, seconds: float) -> tuple[NDArray[np.float64], int]:
        if self._link is None:
            return np.empty((0, 30)), 0
        most = int(seconds * self.rate) + 1
        rows, count = self._link.rows_since(max(self._link.history.count - most, 0))
        # With ticks that were left out, so many rows are more than so many seconds.
        first = np.searchsorted(rows[:, 0], rows[-1, 0] - seconds) if len(rows) else 0
        return rows[first:], count


class ShownLink:
    """A link whose latest moment is that of a timeline; in all else the link."""

    def __init__(self, link: ServoClient, timeline: Timeline) -> None:
        self._link, self._timeline = link, timeline

    def latest(self) -> Snapshot | None:
        """Return the moment to be shown."""
        shown = self._timeline.moment()
        return self._link.latest() if shown is None else shown

    def __getattr__(self, name: str) -> Any:
        return getattr(self._link, name)


def moment_of(row: NDArray[np.float64], like: Snapshot) -> Snapshot:
    """Return a moment with what a row (30,) says, and the rest as in another one."""
    said = {name: values[0] for name, values in columns(row[None, :]).items()}
    del said["penetration_depth"]
    still = np.zeros(6)
    return like._replace(
        **{
            **said,
            "time": float(said["time"]), "contact_count": int(said["contact_count"]),
            "flags": int(said["flags"]), "handle_twist": still, "tool_twist": still,
        }
    )  # fmt: skip
