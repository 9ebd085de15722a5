"""What a part of the page is: it makes its share of the page, and is told 30 times a second."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from asperity.realtime.servo.snapshot import Snapshot

if TYPE_CHECKING:
    import viser

    from asperity.viewer.servo_client import ServoClient


@dataclass(frozen=True, eq=False)
class Frame:
    """What there is to show at one update.

    Parameters
    ----------
    number : int
        Of the update, from 0.
    now : float
        Of the page's clock [s].
    moment : Moment or None
        The latest tick, with contacts and counts; None before the first.
    rows : (n, 30) array
        Of the ticks since the last update; columns as in `servo.rows.FIELDS`. At most what the
        link keeps.
    next_row : int
        The number of the row that will be next, for `ServoClient.rows_since`.
    alive : bool
        Whether the loop ticks.
    generation : int
        Number of the servo process; another one begins with another scene, perhaps.
    rate : float
        Ticks a second, measured over the last second [Hz].
    misses, fallbacks, interventions, clamps : int
        In the last second.
    """

    number: int
    now: float
    moment: Snapshot | None
    rows: NDArray[np.float64]
    next_row: int
    alive: bool
    generation: int
    rate: float = 0.0
    misses: int = 0
    fallbacks: int = 0
    interventions: int = 0
    clamps: int = 0


class Panel(Protocol):
    """A part of the page.

    `update` is called from one thread, after `build`; callbacks of controls come from viser's.
    What a panel raises in `update` is logged once, and the panel is left out from then on.
    """

    title: str
    """Of its tab; panels of one title share a tab. Empty: it has none, as the 3-D scene."""

    def build(self, server: viser.ViserServer, link: ServoClient) -> None:
        """Make its controls; called within its tab."""

    def update(self, frame: Frame) -> None:
        """Show a frame. Quick: 30 times a second, all panels together."""

    def close(self) -> None:
        """Let go of what it holds; may be called twice."""
