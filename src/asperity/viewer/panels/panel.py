"""The protocol of a panel: it builds its part of the page and is updated 30 times a second."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

from asperity.realtime.servo.ipc import Ticks
from asperity.realtime.servo.snapshot import Snapshot
from asperity.viewer.servo_client import ServoClient

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
        The latest tick with contacts and counts; None before the first.
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
