"""Perceived roughness as the studies' metrics predict it, running over the last second."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asperity.realtime.servo.tick_row import columns
from asperity.runs.tool_motion import Roughness, last_run, roughness
from asperity.runs.vibration_metrics import DEFAULT_BAND
from asperity.viewer.panels.panel import Frame
from asperity.viewer.timeline import Timeline

if TYPE_CHECKING:
    import viser

    from asperity.viewer.servo_client import ServoClient

WINDOW = 1.0
"""Of the motion that a number is of [s]; ours."""
_EVERY = 15
_MISSED = 0.02
"""With more of the ticks left out than this, their gaps shake the tool more than a texture may."""
_FEWEST = 100
_LOW, _HIGH = DEFAULT_BAND
_WHAT = f"""What the studies' metrics make of the tool's motion in the last second. The **band
metric** is the RMS of its acceleration between {_LOW:g} and {_HIGH:g} Hz; it was chosen after the
paper's metric had missed the effect of speed. **max u''** is the largest acceleration along the
motion (Otaduy & Lin 2004).

*What it is not:* a judgement of people, or a scale of roughness. It is comparable between two
moments as far as speed, force and the way the tool is held are. A study drags a hand along a line;
here the tool moves as it is led, on its coupling."""


class RoughnessPanel:
    """Two running numbers, with what they are and what they are not."""

    title = "Plots"

    def __init__(self, timeline: Timeline) -> None:
        self._timeline = timeline
        self._shown: tuple[bool, float] | None = None

    def build(self, server: viser.ViserServer, link: ServoClient) -> None:
        """Make the numbers and their explanation."""
        self._server = server
        with server.gui.add_folder("Perceived roughness, predicted"):
            self._card = server.gui.add_html(_card(None, 0.0))
            with server.gui.add_folder("What this is", expand_by_default=False):
                server.gui.add_markdown(_WHAT)

    def update(self, frame: Frame) -> None:
        """Work the numbers out anew, twice a second."""
        if frame.number % _EVERY or not self._server.get_clients():
            return
        version = self._timeline.version
        if version == self._shown:
            return
        self._shown = version
        rows = self._timeline.window(WINDOW)
        rows = rows[last_run(rows[:, 0]) :]
        if len(rows) < _FEWEST:
            self._card.content = _card(None, 0.0)
            return
        said = columns(rows)
        touching = float(np.mean(said["contact_count"] > 0))
        due = (rows[-1, 0] - rows[0, 0]) * self._timeline.rate
        missed = max(1.0 - (len(rows) - 1) / max(due, 1.0), 0.0)
        numbers = roughness(said["time"], said["tool_pose"][:, :3])
        self._card.content = _card(numbers if touching > 0.5 else None, missed)

    def close(self) -> None:
        """Nothing is held."""


def _card(numbers: Roughness | None, missed: float) -> str:
    """Return the numbers as HTML."""
    if numbers is None:
        band, along, under = "&ndash;", "&ndash;", "not in contact for half of the last second"
    else:
        band, along = f"{numbers.band_rms:.2f}", f"{numbers.max_along:.2f}"
        under = f"last {WINDOW:g} s, mean speed {numbers.speed * 1e3:.0f} mm/s"
    warning = (
        f'<div style="color:#b54708;font-size:0.75em">{missed:.0%} of the ticks were missed: their '
        "gaps shake the tool as well</div>"
        if missed > _MISSED
        else ""
    )
    return (
        '<div data-asperity="roughness" style="padding:0.3em 0.6em;line-height:1.25">'
        '<div style="display:flex;gap:1.6em">'
        + _number(band, f"band metric, {_LOW:g}&ndash;{_HIGH:g} Hz")
        + _number(along, "max u''")
        + f'</div><div style="opacity:0.7;font-size:0.75em">{under}</div>{warning}</div>'
    )


def _number(value: str, label: str) -> str:
    return (
        f'<div><div style="font-size:1.5em;font-weight:600">{value}'
        '<span style="font-size:0.55em;font-weight:400"> m/s&sup2;</span></div>'
        f'<div style="opacity:0.7;font-size:0.75em">{label}</div></div>'
    )
