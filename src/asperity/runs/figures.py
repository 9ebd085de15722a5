"""Figures of a run: force, torque, spectra, traces over time, and the picture of the contact."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from asperity.drawing.figure_style import COLOURS, spectrum_limits, style
from asperity.drawing.renderer.contact import ContactMoment, Picture
from asperity.runs.tool_motion import Traces, thinned
from asperity.runs.vibration_metrics import DEFAULT_BAND
from asperity.simulation.simulation import Rollout

Array = NDArray[np.floating[Any]]
_AXES = ("x", "y", "z")
_ARROW_SHARE = 0.30
"""Length of the longest arrow, as a part of the picture's width."""
_DPI = 160
_POINTS = 4000
"""So many points of a line can be distinguished on paper; of longer records, extremes are drawn."""
_EDGE = 6.0
"""Words in a picture keep so far from its edge [dots]."""
_SILENT = 1e-12
"""A tangential force whose lines are all below this [N] is rounding."""


def force_figure(run: Rollout, title: str) -> Figure:
    """Return the components of the force on the tool over time."""
    return _components(run.time, run.contact_wrench[:, :3], "force on the tool", "N", title)


def torque_figure(run: Rollout, title: str) -> Figure:
    """Return the components of the torque about the tool's centre of mass over time."""
    torque = run.contact_wrench[:, 3:] * 1e3
    return _components(run.time, torque, "torque about the centre of mass", "mN m", title)


def _components(time: Array, values: Array, what: str, unit: str, title: str) -> Figure:
    """Draw the whole run above, and a stretch of it in which single waves are seen below."""
    with style():
        figure = Figure(figsize=(7.2, 4.6), dpi=_DPI)
        whole, part = figure.subplots(2, 1)
        _lines(whole, time, values, 0.7)
        whole.set_title(f"{title}\n{what}, world axes")
        begin, end = _stretch(time)
        whole.axvspan(time[begin], time[end - 1], color="#f2ead2", zorder=0, lw=0)
        _lines(part, (time[begin:end] - time[begin]) * 1e3, values[begin:end], 1.2)
        whole.set_xlabel("time [s]")
        part.set_xlabel(f"time from {time[begin]:.3g} s [ms] (the shaded stretch)")
        for axis in (whole, part):
            axis.set_ylabel(f"{what.split(' ')[0]} [{unit}]")
        _axes_legend(figure, whole)
        figure.tight_layout(h_pad=1.2)
    return figure


def _axes_legend(figure: Figure, axis: Axes) -> None:
    figure.legend(
        *axis.get_legend_handles_labels(), loc="upper right", ncols=3,
        bbox_to_anchor=(0.985, 0.996), handlelength=1.4, columnspacing=1.2,
    )  # fmt: skip


def _stretch(time: Array) -> tuple[int, int]:
    """Return the ticks of a stretch of 0.15 s in the middle of the first half."""
    step = float(time[1] - time[0]) if len(time) > 1 else 1.0
    count = min(max(int(0.15 / step), 16), len(time))
    begin = min(len(time) // 4, len(time) - count)
    return begin, begin + count


def _lines(axis: Axes, time: Array, values: Array, width: float) -> None:
    for i, name in enumerate(_AXES):
        axis.plot(time, values[:, i], color=COLOURS[i], lw=width, label=name)
    _span_time(axis, time)
    low, high = float(values.min()), float(values.max())
    room = 0.08 * (high - low) or 0.1
    axis.set_ylim(low - room, high + room)


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
    """Return the spectrum of the tangential force."""
    frequency, amplitude = tangential_spectrum(run)
    with style():
        figure = Figure(figsize=(7.2, 3.0), dpi=_DPI)
        axis = figure.subplots()
        top = float(amplitude.max())
        axis.plot(frequency[1:], amplitude[1:], color=COLOURS[0], lw=0.9)
        axis.set(
            xlim=(0.0, max(float(frequency[-1]), 1.0)),
            xlabel="frequency [Hz]", ylabel="tangential force [N]", title=title,
        )  # fmt: skip
        if top > _SILENT:
            axis.set(yscale="log", ylim=spectrum_limits(amplitude[1:]))
        else:  # of which there is no logarithm
            axis.set(ylim=(0.0, 1.0), yticks=[0.0])
            axis.text(
                0.5, 0.5, "the tangential force does not vary", ha="center", va="center",
                transform=axis.transAxes, color="#666666",
            )  # fmt: skip
        figure.tight_layout()
    return figure


def traces_figure(traces: Traces, title: str) -> Figure:
    """Return force, torque, acceleration and penetration depth over time, one below the other."""
    with style():
        figure = Figure(figsize=(7.2, 7.4), dpi=_DPI)
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
        axes[0].set_title(f"{title}\nforce and torque on the tool, world axes; torque about its "
                          "centre of mass")  # fmt: skip
        axes[-1].set_xlabel("time [s]")
        _axes_legend(figure, axes[0])
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


def contact_figure(close: Picture, whole: Picture, moment: ContactMoment, title: str) -> Figure:
    """Return the picture of a moment: the whole tool at the left, the contact at the right."""
    with style():
        figure = Figure(figsize=(9.6, 5.5), dpi=_DPI)
        shares = [_shape(whole)[1] / _shape(whole)[0], _shape(close)[1] / _shape(close)[0]]
        left, right = figure.subplots(1, 2, width_ratios=shares)
        for axis, picture in ((left, whole), (right, close)):
            rows, columns = _shape(picture)
            axis.imshow(np.clip(picture.image, 0.0, 1.0), interpolation="antialiased")
            axis.set(xticks=[], yticks=[], xlim=(-0.5, columns - 0.5), ylim=(rows - 0.5, -0.5))
            axis.grid(False)
            for spine in axis.spines.values():
                spine.set_visible(True)
                spine.set_color("#cccccc")
            _scale_bar(axis, picture)
        left.set_title("The tool on the scene")
        depth = (
            f"; drawn raised by its depth, {moment.depth.max() * 1e3:.3g} mm"
            if len(moment.depth)
            else "; no contact"
        )
        right.set_title(f"The contact at {moment.time:.3f} s{depth}")
        _arrows(right, close, moment)
        _frame_mark(left, whole, close, moment)
        figure.suptitle(title, x=0.012, ha="left", fontsize=11, fontweight="bold")
        figure.subplots_adjust(left=0.012, right=0.988, top=0.885, bottom=0.02, wspace=0.03)
        _keep_inside(figure, right)
    return figure


def _keep_inside(figure: Figure, axis: Axes) -> None:
    """Shift the words in a picture that would be cut off at its edge."""
    figure.draw_without_rendering()
    frame = axis.get_window_extent()
    for text in axis.texts:
        box = text.get_window_extent()
        if not text.get_text() or not box.width:
            continue
        shift_x = max(frame.x0 + _EDGE - box.x0, 0.0) + min(frame.x1 - _EDGE - box.x1, 0.0)
        shift_y = max(frame.y0 + _EDGE - box.y0, 0.0) + min(frame.y1 - _EDGE - box.y1, 0.0)
        x, y = axis.transData.transform(text.get_position())
        x, y = axis.transData.inverted().transform((x + shift_x, y + shift_y)).tolist()
        text.set_position((x, y))


def _shape(picture: Picture) -> tuple[int, int]:
    return picture.image.shape[0], picture.image.shape[1]


def _scale_bar(axis: Axes, picture: Picture) -> None:
    """Draw a bar of a round length in the lower left corner."""
    rows, columns = _shape(picture)
    longest = 0.28 * picture.camera.width
    power = 10.0 ** np.floor(np.log10(longest))
    length = float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= longest))
    x, y = 0.045 * columns if columns > 500 else 0.06 * columns, 0.95 * rows
    outline = [withStroke(linewidth=4.5, foreground="white")]
    axis.plot(
        [x, x + length / picture.camera.pixel], [y, y], color="black", lw=2.5,
        solid_capstyle="butt", path_effects=outline,
    )  # fmt: skip
    _label(axis, x, y - 0.016 * rows, f"{length * 1e3:g} mm", "black", "left", "bottom")


def _label(axis: Axes, x: float, y: float, text: str, colour: str, across: str, up: str) -> None:
    axis.text(
        x, y, text, color=colour, ha=across, va=up, fontsize=9,
        path_effects=[withStroke(linewidth=2.6, foreground="white")], zorder=6, clip_on=True,
    )  # fmt: skip


def _arrows(axis: Axes, picture: Picture, moment: ContactMoment) -> None:
    """Draw at each contact the normal and the force on the tool, all forces to one scale."""
    if not len(moment.depth):
        return
    sizes = np.linalg.norm(moment.force, axis=1)
    largest = int(np.argmax(sizes))
    length = _ARROW_SHARE * picture.camera.width
    per_newton = length / max(float(sizes[largest]), 1e-300)
    for i, point in enumerate(np.asarray(moment.point + moment.pushed)):
        normal = point + moment.normal[i] * 0.85 * length
        force = point + moment.force[i] * per_newton
        if sizes[i] < 0.03 * sizes[largest]:
            continue
        leans_right = picture.camera.place(force)[0] >= picture.camera.place(normal)[0]
        _arrow(axis, picture, point, normal, "#222222", 1.3, "normal n" * (i == largest),
               "right" if leans_right else "left")  # fmt: skip
        label = f"force {sizes[i]:.2g} N" * (i == largest)
        _arrow(axis, picture, point, force, COLOURS[1], 2.4, label,
               "left" if leans_right else "right")  # fmt: skip
        x, y = picture.camera.place(point)
        axis.plot(x, y, "o", color=COLOURS[1], mec="white", mew=1.0, ms=6.0, zorder=7)


def _arrow(
    axis: Axes, picture: Picture, start: NDArray[np.float64], end: NDArray[np.float64],
    colour: str, width: float, label: str, across: str,
) -> None:  # fmt: skip
    (x0, y0), (x1, y1) = picture.camera.place(start), picture.camera.place(end)
    axis.annotate(
        "", (x1, y1), (x0, y0),
        arrowprops={"arrowstyle": "-|>,head_width=0.28,head_length=0.6", "color": colour,
                    "lw": width, "shrinkA": 0.0, "shrinkB": 0.0,
                    "path_effects": [withStroke(linewidth=width + 1.8, foreground="white")]},
        zorder=5,
    )  # fmt: skip
    if label:
        shift = 8.0 if across == "left" else -8.0
        _label(axis, float(x1) + shift, float(y1), label, colour, across, "center")


def _frame_mark(axis: Axes, whole: Picture, close: Picture, moment: ContactMoment) -> None:
    """Mark in the whole picture what the close one shows."""
    x, y = whole.camera.place(close.camera.centre)
    half = 0.5 * close.camera.width / whole.camera.pixel
    tall = half * _shape(close)[0] / _shape(close)[1]
    axis.plot(
        [x - half, x + half, x + half, x - half, x - half],
        [y - tall, y - tall, y + tall, y + tall, y - tall],
        color=COLOURS[1], lw=1.1,
    )  # fmt: skip
