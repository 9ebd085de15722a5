"""Predicted roughness: the studies' metrics, computed over the last second."""

from __future__ import annotations

import numpy as np

from asperity.drawing.pages import render
from asperity.runs.tool_motion import Roughness, last_run, roughness
from asperity.runs.vibration_metrics import DEFAULT_BAND
from asperity.viewer.panels.panel import Frame, Panel, ViserServer
from asperity.viewer.servo_client import ServoClient
from asperity.viewer.timeline import Timeline

WINDOW = 1.0
"""Duration over which the metrics are computed [s]; project default."""
_EVERY = 15
_MISSED = 0.02
"""Share of skipped ticks above which their gaps may shake the tool more than a texture does."""
_FEWEST = 100
_LOW, _HIGH = DEFAULT_BAND
_WHAT = f"""The studies' metrics of the tool's motion in the last second. The **band metric** is
the RMS of its acceleration between {_LOW:g} and {_HIGH:g} Hz; it was chosen after the paper's
metric had missed the effect of speed. **max u''** is the largest acceleration along the
motion (Otaduy & Lin 2004).

*What they are not:* a judgement of people, or a scale of roughness. Two values can be compared as
far as speed, force and grip are the same. A study drags a hand on a straight path; here the tool
follows the user through its coupling."""


class RoughnessPanel(Panel):
    """The two metrics, with an explanation of what they are and are not."""

    title = "Plots"

    def __init__(self, timeline: Timeline) -> None:
        self._timeline = timeline
        self._shown: tuple[bool, float] | None = None

    def build(self, server: ViserServer, servo: ServoClient) -> None:
        """Add the metrics and their explanation."""
        self._server = server
        with server.gui.add_folder("Perceived roughness, predicted"):
            self._card = server.gui.add_html(_card(None, 0.0))
            with server.gui.add_folder("What this is", expand_by_default=False):
                server.gui.add_markdown(_WHAT)

    def update(self, frame: Frame) -> None:
        """Compute the metrics, twice a second."""
        if frame.number % _EVERY or not self._server.get_clients():
            return
        version = self._timeline.version
        if version == self._shown:
            return
        self._shown = version
        ticks = self._timeline.window(WINDOW)
        ticks = ticks[last_run(ticks["time"]) :]
        if len(ticks) < _FEWEST:
            self._card.content = _card(None, 0.0)
            return
        touching = float(np.mean(ticks["contact_count"] > 0))
        due = float(ticks["time"][-1] - ticks["time"][0]) * self._timeline.rate
        missed = max(1.0 - (len(ticks) - 1) / max(due, 1.0), 0.0)
        numbers = roughness(ticks["time"], ticks["tool_pose"][:, :3])
        self._card.content = _card(numbers if touching > 0.5 else None, missed)


def _card(numbers: Roughness | None, missed: float) -> str:
    """Return the metrics as HTML."""
    return render(
        "live_roughness.html", numbers=numbers, missed=missed, most_missed=_MISSED, window=WINDOW,
        band=DEFAULT_BAND,
    )  # fmt: skip
