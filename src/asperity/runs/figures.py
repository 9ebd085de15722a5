"""Figures of a run: force and torque as texture, spectra, and traces over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from asperity.drawing.figure_style import COLOURS, REPORT_WIDTH, SHADE, style
from asperity.runs.third_octaves import nominal, third_octaves
from asperity.runs.tool_motion import Traces, thinned
from asperity.runs.vibration_metrics import DEFAULT_BAND
from asperity.simulation.simulation import Rollout

Array = NDArray[np.floating[Any]]
_AXES = ("x", "y", "z")
_DPI = 160
_POINTS = 4000
"""So many points of a line can be distinguished on paper; of longer records, extremes are drawn."""
_SHORT, _STRETCH = 0.35, 0.3
"""Runs up to this long are drawn whole, of longer ones a stretch in which waves are seen [s]."""
_ABOVE: dict[str, Any] = {
    "loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.2, "handlelength": 1.4,
}  # fmt: skip
"""A legend beside the title, where it covers no line."""
_SILENT = 1e-12
"""A tangential force whose lines are all below this [N] is rounding."""


def force_figure(run: Rollout, title: str) -> Figure:
    """Return the force on the tool as texture: the tangential force, and the normal less its mean.

    The normal axis is the world axis along which the mean force is largest. The mean, which
    carries the weight of the hand, would flatten what a texture adds to it. Runs of more than
    0.35 s are shown by a stretch, with the whole run below.
    """
    force = run.contact_wrench[:, :3]
    means = force[run.contact_count > 0].mean(axis=0) if run.contact_count.any() else np.zeros(3)
    normal = int(np.argmax(np.abs(means)))
    across = [i for i in range(3) if i != normal]
    begin, end = _stretch(run.time)
    whole = end - begin < len(run.time)
    shown = force[begin:end]
    with style():
        figure = Figure(figsize=(REPORT_WIDTH, 4.6 + 1.5 * whole), dpi=_DPI, layout="constrained")
        ratios = (1.5, 1.0, 0.7)[: 2 + whole]
        axes = np.atleast_1d(figure.subplots(len(ratios), 1, height_ratios=ratios))
        time = (run.time[begin:end] - run.time[begin]) * 1e3
        tangential = [(f"along {_AXES[i]}", shown[:, i], i) for i in across]
        rest = shown[:, normal] - means[normal]
        sizes = [_unit(values, "N") for values in (shown[:, across], rest)]
        _lines(axes[0], time, tangential, *sizes[0], "tangential force")
        _lines(axes[1], time, [("", rest, normal)], *sizes[1], "normal force\nless its mean")
        axes[0].legend(ncols=2, **_ABOVE)
        axes[0].tick_params(labelbottom=False)
        axes[1].set_xlabel(f"time [ms]{_pace(run, begin, end)}")
        axes[1].set_title(
            f"Normal force, along {_AXES[normal]}, less its mean of {means[normal]:.3g} N:\n"
            f"{_swing(rest)} from peak to peak"
        )  # fmt: skip
        swing = np.ptp(shown[:, across], axis=0).max() if len(shown) else 0.0
        axes[0].set_title(f"{title}\nTangential force: {_swing(np.array([0.0, swing]))} from peak "
                          "to peak")  # fmt: skip
        if whole:
            _overview(axes[2], run, force, normal, (begin, end))
        figure.align_ylabels(axes)
    return figure


def torque_figure(run: Rollout, title: str) -> Figure:
    """Return the torque about the tool's centre of mass less its mean, over a stretch."""
    begin, end = _stretch(run.time)
    torque = run.contact_wrench[begin:end, 3:]
    means = torque.mean(axis=0)
    with style():
        figure = Figure(figsize=(REPORT_WIDTH, 3.3), dpi=_DPI, layout="constrained")
        axis = figure.subplots()
        traces = [
            (f"about {name}, less {round(1e3 * means[i], 3):.3g} mN m", torque[:, i] - means[i], i)
            for i, name in enumerate(_AXES)
        ]
        time = (run.time[begin:end] - run.time[begin]) * 1e3
        _lines(axis, time, traces, 1e3, "mN m", "torque")
        axis.set_xlabel(f"time [ms]{_pace(run, begin, end)}")
        axis.set_title(f"{title}\nTorque about the tool's centre of mass, less its mean")
        figure.legend(*axis.get_legend_handles_labels(), loc="outside lower left", ncols=2)
    return figure


def _lines(
    axis: Axes, time: Array, traces: Sequence[tuple[str, Array, int]], scale: float, unit: str,
    label: str,
) -> None:  # fmt: skip
    """Draw traces, each a label, values and the number of its colour."""
    for name, values, colour in traces:
        axis.plot(time, values * scale, color=COLOURS[colour], lw=1.2, label=name)
    axis.set_ylabel(f"{label}\n[{unit}]")
    _span_time(axis, time)
    axis.margins(y=0.1)
    if max((float(np.ptp(values)) for _, values, _ in traces), default=0.0) * scale < _SILENT:
        axis.set_ylim(-1.0, 1.0)


def _overview(
    axis: Axes, run: Rollout, force: Array, normal: int, part: tuple[int, int]
) -> None:  # fmt: skip
    """Draw the sizes of both forces over the whole run, and mark the stretch."""
    across = np.linalg.norm(np.delete(force, normal, axis=1), axis=1)
    for name, values, colour in (("tangential", across, 3), ("normal", force[:, normal], normal)):
        at, drawn = thinned(run.time, np.asarray(values, np.float64)[:, None], _POINTS)
        axis.plot(at, drawn[:, 0], color=COLOURS[colour], lw=0.8, label=name)
    axis.axvspan(run.time[part[0]], run.time[part[1] - 1], color=SHADE, zorder=0, lw=0)
    axis.set(xlabel="time [s]", ylabel="force\n[N]", title="The whole run; shaded: the part above")
    axis.legend(ncols=2, **_ABOVE)
    _span_time(axis, run.time)


def _unit(values: Array, unit: str) -> tuple[float, str]:
    """Return the factor and the name of the unit in which values are read easily."""
    return (1.0, unit) if float(np.ptp(values)) >= 0.1 else (1e3, f"m{unit}")


def _swing(values: Array) -> str:
    """Return by how much values in newtons vary, with the unit."""
    scale, unit = _unit(values, "N")
    return f"{float(np.ptp(values)) * scale:.3g} {unit}"


def _pace(run: Rollout, begin: int, end: int) -> str:
    """Return how long the tool takes for a millimetre, where its speed is uniform."""
    step = float(run.time[1] - run.time[0]) if len(run.time) > 1 else 1.0
    moved = np.linalg.norm(np.diff(run.handle_pose[begin:end, :3], axis=0), axis=1)
    usual = float(np.median(moved)) if len(moved) else 0.0
    if not usual > 0.0 or np.mean(np.abs(moved - usual) < 0.05 * usual) < 0.8:
        return ""
    return f"; the handle moves 1 mm in {step / usual:.3g} ms"


def _stretch(time: Array) -> tuple[int, int]:
    """Return the ticks to show: all of a short run, else 0.3 s from the end of a first quarter."""
    step = float(time[1] - time[0]) if len(time) > 1 else 1.0
    if len(time) * step <= _SHORT:
        return 0, len(time)
    count = min(max(int(_STRETCH / step), 16), len(time))
    begin = min(len(time) // 4, len(time) - count)
    return begin, begin + count


def _span_time(axis: Axes, time: Array) -> None:
    axis.set_xlim(time[0], time[-1] if time[-1] > time[0] else time[0] + 1.0)


def tangential_spectrum(run: Rollout) -> tuple[Array, Array]:
    """Return frequencies [Hz] and the amplitude of the tangential force [N].

    Tangential is across the mean force. Both its components count, as the root of the sum of
    their squares; a Hann window, scaled so that a sine shows its amplitude.
    """
    step = float(run.time[1] - run.time[0]) if len(run.time) > 1 else 1.0
    return force_spectrum(run.contact_wrench[:, :3][run.contact_count > 0], step)


def force_spectrum(force: Array, dt: float) -> tuple[Array, Array]:
    """Return frequencies [Hz] and the amplitude of the tangential part of forces (n, 3) [N].

    As `tangential_spectrum`; `dt` is the tick [s].
    """
    if len(force) < 8:
        return np.zeros(1), np.zeros(1)
    tangential = across_mean(force)
    window = np.hanning(len(force) + 1)[:-1]
    parts = np.fft.rfft((tangential - tangential.mean(axis=0)) * window[:, None], axis=0)
    amplitude = 2.0 * np.sqrt((np.abs(parts) ** 2).sum(axis=1)) / window.sum()
    return np.asarray(np.fft.rfftfreq(len(force), dt)), np.asarray(amplitude)


def across_mean(force: Array) -> Array:
    """Return the part of forces (n, 3) across their mean."""
    mean = force.mean(axis=0)
    n = mean / max(float(np.linalg.norm(mean)), 1e-300)
    return np.asarray(force - np.outer(force @ n, n))


def spectrum_figure(run: Rollout, title: str) -> Figure:
    """Return the spectrum of the tangential force in third octaves."""
    frequency, amplitude = tangential_spectrum(run)
    # A Hann window that keeps the height of a line widens it: the power is 1.5 times too large.
    amplitude = 1e3 / np.sqrt(1.5) * amplitude
    return _third_octave_figure(
        frequency, amplitude, title, "tangential force", "mN", None, silent=1e3 * _SILENT
    )


def _third_octave_figure(
    frequency: Array, amplitude: Array, title: str, what: str, unit: str,
    band: tuple[float, float] | None, silent: float = 0.0,
) -> Figure:  # fmt: skip
    """Return bars of the RMS in third octaves; the title names the largest."""
    with style():
        figure = Figure(figsize=(REPORT_WIDTH, 3.3), dpi=_DPI, layout="constrained")
        axis = figure.subplots()
        axis.set(xlabel="third octave around [Hz]", ylabel=f"{what},\nRMS [{unit}]")
        axis.set_title(f"{title}\n{what} in third octaves")
        if len(frequency) < 3 or not float(amplitude[1:].max()) > silent:
            axis.set(ylim=(0.0, 1.0), yticks=[0.0], xticks=[])
            axis.text(
                0.5, 0.5, f"the {what} does not vary", ha="center", va="center",
                transform=axis.transAxes, color="#666666",
            )  # fmt: skip
            return figure
        lines = (np.asarray(part[1:], np.float64) for part in (frequency, amplitude))
        middles, rms = third_octaves(*lines)
        place = np.log10(middles)
        axis.bar(place, rms, width=0.09, color=COLOURS[0])
        if band:
            axis.axvspan(*np.log10(band).tolist(), color=SHADE, zorder=0, lw=0)
        every = max(1, -(-len(middles) // 13))
        axis.set_xticks(place[::every], [nominal(f) for f in middles[::every]])
        axis.grid(axis="x", visible=False)
        axis.set_xlim(place[0] - 0.08, place[-1] + 0.08)
        most = int(np.argmax(rms))
        shaded = f"; shaded: {band[0]:g} to {band[1]:g} Hz" if band else ""
        axis.set_title(f"{title}\n{what.capitalize()}: most in the third octave around "
                       f"{nominal(middles[most])} Hz,\n{rms[most]:.3g} {unit}{shaded}")  # fmt: skip
    return figure


def traces_figure(traces: Traces, title: str) -> Figure:
    """Return force, torque, acceleration and penetration depth over time, one below the other."""
    with style():
        figure = Figure(figsize=(REPORT_WIDTH, 7.4), dpi=_DPI)
        axes = figure.subplots(4, 1, sharex=True)
        for axis, values, label in (
            (axes[0], traces.force, "force [N]"),
            (axes[1], traces.torque * 1e3, "torque [mN m]"),
            (axes[2], traces.acceleration, "acceleration [m/s²]"),
        ):
            _traces(axis, traces.time, values, _AXES, label)
        known = np.isfinite(traces.depth)
        if known.any():
            depth = np.where(known, traces.depth, 0.0)[:, None] * 1e3
            _traces(axes[3], traces.time, depth, ("of the deepest contact",), "depth [mm]", first=3)
            axes[3].set_ylim(bottom=0.0)
        else:
            axes[3].text(0.5, 0.5, "not in this recording", ha="center", va="center",
                         transform=axes[3].transAxes, color="#777777")  # fmt: skip
            axes[3].set_ylabel("depth [mm]")
        axes[0].set_title(f"{title}\nforce and torque on the tool, world axes;\ntorque about its "
                          "centre of mass")  # fmt: skip
        axes[-1].set_xlabel("time [s]")
        axes[0].legend(ncols=3, **_ABOVE)
        figure.align_ylabels(axes)
        figure.tight_layout(h_pad=0.6)
    return figure


def _traces(
    axis: Axes, time: NDArray[np.float64], values: NDArray[np.float64], names: tuple[str, ...],
    label: str, first: int = 0,
) -> None:  # fmt: skip
    at, drawn = thinned(time, values, _POINTS)
    for i, name in enumerate(names):
        axis.plot(at, drawn[:, i], color=COLOURS[first + i], lw=0.8, label=name)
    axis.set_ylabel(label)
    _span_time(axis, time)


def shaking_figure(traces: Traces, title: str, band: tuple[float, float] = DEFAULT_BAND) -> Figure:
    """Return the tool's acceleration in third octaves, with the band of the metric marked."""
    frequency, amplitude = traces.spectrum()
    return _third_octave_figure(
        frequency, amplitude, title, "acceleration of the tool", "m/s²", band
    )
