"""Figures of a comparison: force traces, spectra, cost."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from asperity.drawing.figure_style import COLOURS, style
from asperity.runs.figures import across_mean
from asperity.studies.comparison.compare import BAND, Comparison, MethodResult, format_number

_GREY = "#b5b5b0"
_STRETCH = 0.15
"""Duration that traces show [s]."""
Array = NDArray[np.float64]


def done_rows(result: Comparison) -> list[MethodResult]:
    """Return the methods that could render the scene."""
    return [row for row in result.rows if row.run is not None]


def _grid(rows: list[MethodResult], title: str, subtitle: str) -> tuple[Figure, list[Axes]]:
    columns = 2 if len(rows) > 1 else 1
    lines = -(-len(rows) // columns)
    figure = Figure(figsize=(7.6, 0.85 + 1.32 * lines))
    axes = figure.subplots(lines, columns, sharex=True, sharey=True, squeeze=False).ravel().tolist()
    for axis in axes[len(rows) :]:
        axis.set_visible(False)
    height = figure.get_size_inches()[1]
    figure.text(0.012, 1.0 - 0.08 / height, title, ha="left", va="top", fontsize=11,
                fontweight="bold")  # fmt: skip
    figure.text(0.012, 1.0 - 0.33 / height, subtitle, ha="left", va="top", fontsize=8.5)
    return figure, axes


def _lay_out(figure: Figure) -> None:
    height = figure.get_size_inches()[1]
    figure.tight_layout(rect=(0.0, 0.0, 1.0, 1.0 - 0.45 / height), h_pad=0.6)


def _along(poses: Array) -> Array:
    """Return the unit direction in which a path extends farthest, (3,)."""
    away = poses[:, :3] - poses[:, :3].mean(axis=0)
    _, _, rows = np.linalg.svd(away, full_matrices=False)
    first = rows[0]
    return np.asarray(first * np.sign(first[np.argmax(np.abs(first))]))


def traces_figure(result: Comparison) -> Figure:
    """Return the tangential force along the motion, one panel a method, asperity's in grey."""
    rows = done_rows(result)
    dt = result.settings.dt
    shortest = min(len(row.run.force) for row in rows if row.run is not None)
    count = min(round(_STRETCH / dt), shortest)
    begin = min(shortest // 4, shortest - count)
    direction = _along(result.poses)
    time = 1e3 * dt * np.arange(count)
    with style():
        figure, axes = _grid(
            rows, f"{result.scene.name}: tangential force along the motion",
            f"all pressed to a mean of {result.push:.2g} N; {1e3 * dt * count:.0f} ms from "
            f"{dt * begin:.2g} s; grey: asperity",
        )  # fmt: skip
        own = _part(rows[0], direction, begin, count) if rows[0].method.name == "asperity" else None
        most = 0.0
        for axis, row in zip(axes, rows, strict=False):
            shown, where = _shown_direction(row, direction)
            values = _part(row, shown, begin, count)
            if own is not None and row is not rows[0]:
                axis.plot(time, own, color=_GREY, lw=1.0)
            axis.plot(time, values, color=COLOURS[0], lw=1.1)
            axis.set_title(row.method.label + where)
            axis.set_xlim(0.0, time[-1] if count > 1 else 1.0)
            # A noisy method must not flatten the traces of all others.
            most = max(most, float(np.percentile(np.abs(values), 97)))
        if own is not None:
            most = max(1.15 * float(np.abs(own).max()), min(most, 3.0 * float(np.abs(own).max())))
        for axis in axes:
            axis.set_ylim(-1.1 * max(most, 1e-6), 1.1 * max(most, 1e-6))
        _label_axes(axes, len(rows), "time [ms]", "force [N]")
        _lay_out(figure)
    return figure


def _shown_direction(row: MethodResult, direction: Array) -> tuple[Array, str]:
    """Return the direction (3,) along which to show a method's force, and a note for the title."""
    assert row.run is not None
    across = across_mean(row.run.force)
    change = across - across.mean(axis=0)
    if np.square(change @ direction).sum() >= 0.01 * np.square(change).sum():
        return direction, ""
    _, _, axes = np.linalg.svd(change, full_matrices=False)
    return np.asarray(axes[0]), ", across the motion"


def _part(row: MethodResult, direction: Array, begin: int, count: int) -> Array:
    assert row.run is not None
    return np.asarray((across_mean(row.run.force) @ direction)[begin : begin + count])


def _label_axes(axes: list[Axes], count: int, x: str, y: str) -> None:
    for k, axis in enumerate(axes[:count]):
        if k % 2 == 0:
            axis.set_ylabel(y)
        if k + 2 >= count:
            axis.set_xlabel(x)
            axis.tick_params(labelbottom=True)


def spectra_figure(result: Comparison) -> Figure:
    """Return the spectra of the tangential force, the band of 20 to 200 Hz marked."""
    rows = done_rows(result)
    with style():
        figure, axes = _grid(
            rows, f"{result.scene.name}: spectrum of the tangential force",
            f"shaded: {BAND[0]:g} to {BAND[1]:g} Hz, with the RMS within; grey: asperity",
        )  # fmt: skip
        tops = [float(row.spectrum.amplitude[1:].max(initial=0.0)) for row in rows if row.spectrum]
        top = max([*tops, 1e-9])
        for axis, row in zip(axes, rows, strict=False):
            assert row.spectrum is not None
            axis.axvspan(*BAND, color="#f2ead2", zorder=0, lw=0)
            first = rows[0].spectrum
            if row is not rows[0] and rows[0].method.name == "asperity" and first is not None:
                axis.plot(first.frequency[1:], first.amplitude[1:], color=_GREY, lw=0.8)
            amplitude = np.maximum(row.spectrum.amplitude[1:], 1e-12)
            axis.plot(row.spectrum.frequency[1:], amplitude, color=COLOURS[1], lw=0.9)
            axis.set(yscale="log", ylim=(1e-5 * top, 3.0 * top), xlim=(0.0, 500.0))
            axis.set_title(f"{row.method.label}: {format_number(1e3 * (row.band_rms or 0.0))} mN")
        _label_axes(axes, len(rows), "frequency [Hz]", "force [N]")
        _lay_out(figure)
    return figure


def cost_figure(result: Comparison) -> Figure:
    """Return the cost of a tick, median and 99th percentile, over asperity's median."""
    rows = done_rows(result)
    with style():
        figure = Figure(figsize=(7.6, 0.9 + 0.27 * len(rows)))
        axis = figure.subplots()
        for i, row in enumerate(rows):
            ratio, cost = row.ratio, row.cost
            if ratio is None or cost is None:
                continue
            colour = COLOURS[0] if row.method.name == "asperity" else COLOURS[1]
            worst = ratio * cost[1] / cost[0]
            axis.plot([ratio, worst], [i, i], color=colour, lw=1.6, solid_capstyle="butt")
            axis.plot(ratio, i, "o", color=colour, ms=6)
            axis.plot(worst, i, "|", color=colour, ms=9, mew=1.6)
            axis.annotate(f"{ratio:.3g}", (ratio, i), (0, 5), textcoords="offset points",
                          ha="center", va="bottom", fontsize=7.5)  # fmt: skip
        axis.axvline(1.0, color=_GREY, lw=1.0, zorder=0)
        axis.set_yticks(range(len(rows)), [row.method.label for row in rows])
        axis.set_ylim(len(rows) - 0.4, -0.75)
        axis.set(xscale="log", xlabel="cost of a tick over asperity's median in one run (point: "
                 "median, bar: p99)")  # fmt: skip
        axis.set_title(f"{result.scene.name}: cost per tick")
        figure.tight_layout()
    return figure
