"""The protocol of a panel, which is updated with a frame 30 times a second, and these frames."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any, Protocol

from asperity.realtime.servo.ipc import Ticks
from asperity.realtime.servo.snapshot import Snapshot
from asperity.viewer.servo_client import ServoClient

_COUNTS = ("ticks", "misses", "fallbacks", "interventions", "clamps")
ViserServer = Any
"""`viser.ViserServer`; the package is optional."""


@dataclass(frozen=True, eq=False)
class Frame:
    """The content of one update of the page.

    Parameters
    ----------
    number : int
        Number of the update, from 0.
    now : float
        The page's clock [s].
    snapshot : Snapshot or None
        The tick that is shown, with its contacts; None before the first.
    ticks : (n,) array
        Ticks since the last update, of dtype `ipc.TICK`; at most those that the client keeps.
    next_tick : int
        Number of the next tick to come, for `ServoClient.ticks_since`.
    alive : bool
        Whether the loop ticks.
    generation : int
        Number of the servo process; a new one may have another scene.
    rate : float
        Ticks per second, measured over the last second [Hz].
    misses, fallbacks, interventions, clamps : int
        Counts of the last second.
    live : Snapshot or None
        The loop's latest tick, whatever instant the page shows.
    """

    number: int
    now: float
    snapshot: Snapshot | None
    ticks: Ticks
    next_tick: int
    alive: bool
    generation: int
    rate: float = 0.0
    misses: int = 0
    fallbacks: int = 0
    interventions: int = 0
    clamps: int = 0
    live: Snapshot | None = None


class ViewModel:
    """Makes the frames of a servo client, one per update of the page."""

    def __init__(self, servo: ServoClient) -> None:
        self._servo = servo
        self._next_tick = servo.history.count
        self._number = 0
        self._generation = -1
        self._past: deque[tuple[float, tuple[int, ...]]] = deque()

    def frame(self, now: float) -> Frame:
        """Return the next frame; `now` is the page's clock [s]."""
        servo = self._servo
        shown, snapshot, generation = servo.latest(), servo.live(), servo.generation
        ticks, self._next_tick = servo.ticks_since(self._next_tick)
        if generation != self._generation:
            self._past.clear()
            self._generation = generation
        per_second: dict[str, int] = {}
        rate = 0.0
        if snapshot is not None:
            counts = tuple(getattr(snapshot, name) for name in _COUNTS)
            self._past.append((now, counts))
            # Keep as the first entry one that is a second old, or the oldest there is.
            while len(self._past) > 2 and now - self._past[1][0] >= 1.0:
                self._past.popleft()
            then, before = self._past[0]
            # After a delay of the page the first entry is older than a second.
            seconds = max(now - then, 1.0)
            grown = {n: a - b for n, a, b in zip(_COUNTS, counts, before, strict=True)}
            per_second = {name: round(count / seconds) for name, count in grown.items()}
            rate = grown["ticks"] / (now - then) if now > then else 0.0
        per_second.pop("ticks", None)
        frame = Frame(
            self._number, now, shown, ticks, self._next_tick, servo.is_alive, generation, rate,
            **per_second, live=snapshot,
        )  # fmt: skip
        self._number += 1
        return frame


class Panel(Protocol):
    """A part of the page; as a base class, one that does not move and holds nothing.

    `update` is called from one thread, after `build`; callbacks of controls come from viser's
    threads. An exception in `update` is logged once, and the panel is not updated any more.
    """

    title: str
    """Title of its tab; panels with the same title share one. Empty: no tab (the 3-D scene)."""

    def build(self, server: ViserServer, servo: ServoClient) -> None:
        """Add the controls; called within the panel's tab."""

    def update(self, frame: Frame) -> None:
        """Show a frame. It has to be quick, as all panels are updated 30 times a second."""
        return

    def close(self) -> None:
        """Release what the panel holds; may be called twice."""
        return
