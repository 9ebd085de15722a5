"""Figures of a stretch of a recording: its traces over time, and the spectrum of the shaking."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from asperity.drawing.figure_style import COLOURS, spectrum_limits, style
from asperity.runs.tool_motion import Traces, thinned
from asperity.runs.vibration_metrics import DEFAULT_BAND

_DPI = 160
_POINTS = 4000
"""So many points of a line can be distinguished on paper; of longer records, extremes are drawn."""


def traces_figure(traces: Traces, title: str) -> Figure:
    """Return force, torque, acceleration and penetration depth over time, one below the other."""
    axes_names = ("x", "y", "z")
    with style():
        figure = Figure(figsize=(7.2, 7.4), dpi=_DPI)
        axes = figure.subplots(4, 1, sharex=True)
        for axis, values, label in (
            (axes[0], traces.force, "force [N]"),
            (axes[1], traces.torque * 1e3, "torque [mN m]"),
            (axes[2], traces.acceleration, "acceleration [m/s²]"),
        ):
            _lines(axis, traces.time, values, axes_names, label)
        known = np.isfinite(traces.depth)
        if known.any():
            depth = np.where(known, traces.depth, 0.0)[:, None] * 1e3
            _lines(axes[3], traces.time, depth, ("of the deepest contact",), "depth [mm]", first=3)
            axes[3].set_ylim(bottom=0.0)
        else:
            axes[3].text(0.5, 0.5, "not in this recording", ha="center", va="center",
                         transform=axes[3].transAxes, color="#777777")  # fmt: skip
            axes[3].set_ylabel("depth [mm]")
        axes[0].set_title(f"{title}\nforce and torque on the tool, world axes; torque about its "
                          "centre of mass")  # fmt: skip
        axes[-1].set_xlabel("time [s]")
        figure.legend(
            *axes[0].get_legend_handles_labels(), loc="upper right", ncols=3,
            bbox_to_anchor=(0.985, 0.997), handlelength=1.4, columnspacing=1.2,
        )  # fmt: skip
        figure.align_ylabels(axes)
        figure.tight_layout(h_pad=0.6)
    return figure


def _lines(
    axis: Axes, time: NDArray[np.float64], values: NDArray[np.float64], names: tuple[str, ...],
    label: str, first: int = 0,
) -> None:  # fmt: skip
    at, drawn = thinned(time, values, _POINTS)
    for i, name in enumerate(names):
        axis.plot(at, drawn[:, i], color=COLOURS[first + i], lw=0.8, label=name)
    axis.set_ylabel(label)
    axis.set_xlim(time[0], time[-1] if time[-1] > time[0] else time[0] + 1.0)


def shaking_figure(traces: Traces, title: str, band: tuple[float, float] = DEFAULT_BAND) -> Figure:
    """Return the spectrum of the tool's acceleration, with the band of the band metric marked."""
    frequency, amplitude = traces.spectrum()
    with style():
        figure = Figure(figsize=(7.2, 3.2), dpi=_DPI)
        axis = figure.subplots()
        axis.axvspan(*band, color="#f2ead2", zorder=0, lw=0)
        axis.plot(frequency, amplitude, color=COLOURS[0], lw=0.9)
        axis.set(
            yscale="log", ylim=spectrum_limits(amplitude[1:]),
            xlim=(0.0, max(float(frequency[-1]) if len(frequency) else 0.0, 1.0)),
            xlabel="frequency [Hz]", ylabel="acceleration [m/s²]",
            title=f"{title}\nacceleration of the tool, three axes together; shaded: "
                  f"{band[0]:g} to {band[1]:g} Hz",
        )  # fmt: skip
        figure.tight_layout()
    return figure
