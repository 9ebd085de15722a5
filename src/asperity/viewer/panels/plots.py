"""Plots of the last seconds: force, torque, acceleration, depth, and the acceleration's spectrum.

They are drawn a few times a second, one after the other, and only while a browser is connected: a
browser without a graphics processor takes 20 ms and more for each, and what it cannot draw queues
up. Of each line the minimum and maximum of every few milliseconds are sent, so that no peak is lost
and a plot has 300 points.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.realtime.servo.ipc import Ticks
from asperity.runs.tool_motion import Traces, thinned, traces
from asperity.runs.vibration_metrics import DEFAULT_BAND
from asperity.viewer.panels.panel import Frame, Panel, ViserServer
from asperity.viewer.servo_client import ServoClient
from asperity.viewer.timeline import Timeline

OFTEN = {"4 a second": 7, "1 a second": 30, "once in 4 s": 120}
"""How often plots are redrawn, and the number of page updates in between."""
SPANS = ("1 s", "2 s", "5 s", "10 s")
_POINTS = 300
_HEIGHT = 150
"""Height of a plot [px]."""
_LINES = 256
"""Largest number of lines in a spectrum."""
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")
"""Okabe & Ito (2008), as in the figures."""
_WRENCHES = {"on the tool": "contact_wrench", "in the hand": "device_wrench"}
_AXES = ("x", "y", "z")
_TIME = "time from the moment shown [s]"


class PlotsPanel(Panel):
    """Force, torque, acceleration, penetration depth and spectrum of a timeline."""

    title = "Plots"

    def __init__(self, timeline: Timeline) -> None:
        self._timeline = timeline
        self._shown: tuple[Any, ...] = ()
        self._plots: dict[str, Any] = {}
        self._due: list[str] = []
        self._length = 5.0
        self._traces: Traces

    def build(self, server: ViserServer, servo: ServoClient) -> None:
        """Add the plots."""
        self._server = server
        gui = server.gui
        self._span = gui.add_dropdown("Time shown", SPANS, initial_value="5 s")
        self._wrench = gui.add_dropdown(
            "Force", tuple(_WRENCHES), initial_value="on the tool",
            hint="What the contact does to the tool, or what is sent to the device.",
        )  # fmt: skip
        self._often = gui.add_dropdown(
            "Drawn", tuple(OFTEN), initial_value="4 a second",
            hint="Less often where the browser is slow.",
        )  # fmt: skip
        for name, label, lines, least in (
            ("force", "force [N]", _AXES, 0.1),
            ("torque", "torque [mN m]", _AXES, 1.0),
            ("acceleration", "acceleration [m/s²]", _AXES, 1.0),
            ("depth", "penetration depth [mm]", ("deepest contact",), 0.01),
        ):
            first, low = (3, 0.0) if name == "depth" else (0, -least)
            series = [
                {"label": n, "stroke": c} for n, c in zip(lines, COLOURS[first:], strict=False)
            ]
            self._plots[name] = _plot(gui, label, _TIME, (-5.0, 0.0), (low, least), series)
        low, high = DEFAULT_BAND
        band = {
            "label": f"{low:g}-{high:g} Hz", "fill": "rgba(230,159,0,0.22)",
            "stroke": "rgba(230,159,0,0.9)", "width": 0,
        }  # fmt: skip
        self._plots["spectrum"] = _plot(
            gui, "spectrum of the acceleration, last 2 s", "frequency [Hz]", (0.0, 500.0),
            (0.0, 0.1), [band, {"label": "m/s²", "stroke": COLOURS[0]}],
        )  # fmt: skip

    def update(self, frame: Frame) -> None:
        """Redraw at most one plot, if it would show something new."""
        if not self._server.get_clients():
            return
        turn = frame.number % OFTEN[self._often.value]
        if turn == 0:
            self._begin()
        elif self._due:
            self._draw(self._due.pop(0))

    def _begin(self) -> None:
        """Take the ticks to draw in the next updates."""
        span = float(self._span.value.split()[0])
        shown = (self._timeline.version, span, self._wrench.value)
        if shown == self._shown:
            return
        ticks = self._timeline.window(span)
        if len(ticks) < 2:
            return
        self._shown, self._length = shown, span
        self._traces = traces_of_ticks(ticks, _WRENCHES[self._wrench.value])
        self._due = list(self._plots)

    def _draw(self, name: str) -> None:
        if name == "spectrum":
            self._draw_spectrum(traces_of_ticks(self._timeline.window(2.0)))
            return
        shown, span, plot = self._traces, self._length, self._plots[name]
        values = {
            "force": shown.force, "torque": shown.torque * 1e3,
            "acceleration": shown.acceleration, "depth": shown.depth[:, None] * 1e3,
        }[name]  # fmt: skip
        at, drawn = thinned(shown.time - shown.time[-1], values, _POINTS)
        plot.data = (at, *np.ascontiguousarray(drawn.T))
        if plot.scales["x"]["range"][0] != -span:
            plot.scales = {**plot.scales, "x": {"time": False, "range": (-span, 0.0)}}

    def _draw_spectrum(self, shown: Traces) -> None:
        frequency, amplitude = shown.spectrum()
        if not len(frequency):
            return
        frequency, amplitude = _gathered(frequency, amplitude)
        low, high = DEFAULT_BAND
        top = max(float(amplitude.max()), 1e-3)
        band = np.where((frequency >= low) & (frequency <= high), 1.05 * top, 0.0)
        plot = self._plots["spectrum"]
        plot.data = (frequency, band, amplitude)
        half = round(0.5 * self._timeline.rate)
        if plot.scales["x"]["range"][1] != half:
            plot.scales = {**plot.scales, "x": {"time": False, "range": (0.0, half)}}


def traces_of_ticks(ticks: Ticks, wrench: str = "contact_wrench") -> Traces:
    """Return the traces of ticks (n,) of the servo loop."""
    return traces(
        ticks["time"], ticks["tool_pose"][:, :3], ticks[wrench], ticks["penetration_depth"]
    )


def _plot(
    gui: Any, title: str, along: str, x: tuple[float, float], least: tuple[float, float],
    lines: list[dict[str, Any]],
) -> Any:  # fmt: skip
    """Add a plot that shows `x`, and at least the heights `least`."""
    low, high = ({"pad": 0.1, "soft": limit, "mode": 1} for limit in least)
    return gui.add_uplot(
        (np.zeros(2), *(np.full(2, np.nan) for _ in lines)),
        (
            {"label": along[along.index("[") + 1 : -1]},
            *({"width": 1, "points": {"show": False}, **line} for line in lines),
        ),
        title=title,
        scales={"x": {"time": False, "range": x}, "y": {"range": {"min": low, "max": high}}},
        axes=_axes(along), height=_HEIGHT, legend={"live": False}, padding=(2, 14, 0, 0),
    )  # fmt: skip


def _axes(label: str) -> tuple[dict[str, Any], dict[str, Any]]:
    ticks, font = {"show": True, "size": 3}, "10px sans-serif"
    return (
        {"label": label, "labelSize": 16, "labelGap": 0, "labelFont": font, "font": font,
         "size": 22, "gap": 1, "ticks": ticks},
        {"size": 40, "gap": 2, "font": font, "ticks": ticks},
    )  # fmt: skip


def _gathered(
    frequency: NDArray[np.float64], amplitude: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a spectrum with at most `_LINES` lines, each the largest of those it replaces."""
    each = -(-len(frequency) // _LINES)
    whole = len(frequency) // each * each
    if each == 1 or not whole:
        return frequency, amplitude
    return (
        frequency[:whole].reshape(-1, each).mean(axis=1),
        amplitude[:whole].reshape(-1, each).max(axis=1),
    )
