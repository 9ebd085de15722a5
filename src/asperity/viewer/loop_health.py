"""Whether the loop keeps its rate and the hand feels the contact; what is wrong, and what helps."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from asperity.realtime.servo.ipc import Ticks
from asperity.simulation.tool_contact import LIMITED, PASSIVITY, SILENT
from asperity.viewer.panels.panel import Frame

STARVED = 0.9
"""Share of the nominal rate below which a loop starves."""
_TOUCHED, _WINDOW = 0.2, 1.0
"""Share of a second's ticks with contact below which nothing is judged; that second [s]."""
_LEAST = 0.05
"""Contact force that counts as touching [N]."""
_AT_FIRST = 2.0
"""A loop is not judged in its first seconds [s]."""


class Trouble(NamedTuple):
    """What is wrong and what helps; `sinks`: a pressing hand would sink into the surface."""

    what: str
    helps: str
    sinks: bool


class LoopHealth:
    """Judges the last second of a loop."""

    def __init__(self) -> None:
        self._ticks: deque[tuple[float, Ticks]] = deque()
        self._generation, self._begun = -1, 0.0

    def trouble(self, frame: Frame, wanted: float) -> Trouble | None:
        """Return what is wrong; None if nothing is. Call it with each frame.

        Parameters
        ----------
        frame : Frame
        wanted : float
            Nominal ticks per second [Hz].
        """
        if frame.generation != self._generation:
            self._ticks.clear()
            self._generation, self._begun = frame.generation, frame.now
        self._ticks.append((frame.now, frame.ticks))
        while len(self._ticks) > 1 and frame.now - self._ticks[0][0] > _WINDOW:
            self._ticks.popleft()
        if not frame.alive or frame.live is None or frame.now - self._begun < _AT_FIRST:
            return None
        taken = taken_shares(np.concatenate([ticks for _, ticks in self._ticks]))
        name = max(taken, key=lambda one: taken[one])
        if taken[name] > 0.5:
            return Trouble(*_TAKEN[name], sinks=True)
        if frame.rate < STARVED * wanted:
            return Trouble(
                f"The loop starves: {frame.rate:.0f} of {wanted:.0f} ticks a second.",
                "Another core, a GPU for the browser, a simpler scene, or a lower rate "
                "(Contact, or --rate) helps.",
                sinks=False,
            )
        return None


_TAKEN = {
    "passivity": (
        "The passivity controller takes most of the force.",
        "Less stiffness, a virtual coupling, or a higher rate helps.",
    ),
    "limits": (
        "A limit of the device takes most of the force.",
        "Press less, or choose less stiffness.",
    ),
    "silence": (
        "The hand feels nothing: contacts come too late, or the device is silent.",
        "A simpler scene, another core, or a lower rate helps.",
    ),
}  # fmt: skip


def taken_shares(ticks: Ticks) -> dict[str, float]:
    """Return by cause the share of the touching ticks (n,) that lost most of their force to it."""
    flags = ticks["flags"].astype(np.int64)
    contact = np.linalg.norm(ticks["contact_wrench"][:, :3], axis=1)
    felt = np.linalg.norm(ticks["device_wrench"][:, :3], axis=1)
    silent = flags & SILENT != 0
    touches = (contact > _LEAST) | silent & (ticks["contact_count"] > 0)
    count = int(touches.sum())
    if not count or count < _TOUCHED * len(ticks):
        return {"silence": 0.0}
    # On the whole, as single ticks of a tool that bounces differ much.
    lost = touches & bool(felt[touches].mean() < 0.5 * contact[touches].mean())
    limited = lost & (flags & (LIMITED | PASSIVITY) == LIMITED)
    return {
        "silence": float((touches & silent).sum() / count),
        "passivity": float((lost & ~silent & (flags & PASSIVITY != 0)).sum() / count),
        "limits": float((limited & ~silent).sum() / count),
    }
