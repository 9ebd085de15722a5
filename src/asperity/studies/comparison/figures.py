"""Figures of a comparison: force traces, spectra, cost."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from asperity.drawing.figure_style import (
    COLOURS,
    COLUMN_WIDTH,
    SHADE,
    SMALLEST,
    plain_ticks,
    style,
)
from asperity.runs.figures import across_mean
from asperity.runs.third_octaves import third_octaves
from asperity.studies.baselines import Method
from asperity.studies.comparison.compare import BAND, Comparison, Rendered, format_number

_GREY = "#b5b5b0"
_STRETCH = 0.15
"""Duration that traces show [s]."""
Array = NDArray[np.float64]


def done_rows(result: Comparison) -> list[tuple[Method, Rendered]]:
    """Return the methods that could render the scene, and what they rendered."""
    return [(row.method, row.rendered) for row in result.rows if row.rendered is not None]


@contextmanager
def _panels(
    count: int, title: str, subtitle: str, x: str, y: str
) -> Iterator[tuple[Figure, list[Axes]]]:
    """Give a figure of panels for traces to be drawn in, and lay it out afterwards."""
    columns = 2 if count > 1 else 1
    lines = -(-count // columns)
    height = 0.95 + 1.4 * lines
    with style():
        figure = Figure(figsize=(COLUMN_WIDTH, height))
        axes = figure.subplots(lines, columns, sharex=True, sharey=True, squeeze=False).ravel()
        for axis in axes[count:]:
            axis.set_visible(False)
        top, below = 1.0 - 0.08 / height, 1.0 - 0.33 / height
        figure.text(0.012, top, title, ha="left", va="top", fontsize=11, fontweight="bold")
        figure.text(0.012, below, subtitle, ha="left", va="top", fontsize=SMALLEST)
        yield figure, axes[:count].tolist()
        for k, axis in enumerate(axes[:count]):
            if k % 2 == 0:
                axis.set_ylabel(y)
            if k + 2 >= count:
                axis.set_xlabel(x)
                axis.tick_params(labelbottom=True)
        figure.tight_layout(rect=(0.0, 0.0, 1.0, 1.0 - 0.45 / height), h_pad=0.6)


def _along(poses: Array) -> Array:
    """Return the unit direction in which a path extends farthest, (3,)."""
    first = _main_direction(poses[:, :3])
    return np.asarray(first * np.sign(first[np.argmax(np.abs(first))]))


def _main_direction(vectors: NDArray[np.floating[Any]]) -> Array:
    """Return the unit direction in which vectors (n, 3) vary most, (3,)."""
    _, _, rows = np.linalg.svd(vectors - vectors.mean(axis=0), full_matrices=False)
    return np.asarray(rows[0], dtype=np.float64)


def traces_figure(result: Comparison) -> Figure:
    """Return the tangential force along the motion, one panel a method, asperity's in grey."""
    rows = done_rows(result)
    dt = result.settings.dt
    shortest = min(len(done.run.force) for _, done in rows)
    count = min(round(_STRETCH / dt), shortest)
    begin = min(shortest // 4, shortest - count)
    direction = _along(result.poses)
    time = 1e3 * dt * np.arange(count)

    def part(done: Rendered, shown: Array) -> Array:
        return np.asarray((across_mean(done.run.force) @ shown)[begin : begin + count])

    own = part(rows[0][1], direction) if rows[0][0].name == "asperity" else None
    subtitle = (
        f"all pressed to a mean of {result.push:.2g} N; {1e3 * dt * count:.0f} ms from "
        f"{dt * begin:.2g} s; grey: asperity"
    )
    title = f"{result.scene.name}: tangential force along the motion"
    with _panels(len(rows), title, subtitle, "time [ms]", "force [N]") as (figure, axes):
        most = 0.0
        for axis, (method, done) in zip(axes, rows, strict=True):
            shown, where = _shown_direction(done, direction)
            values = part(done, shown)
            if own is not None and done is not rows[0][1]:
                axis.plot(time, own, color=_GREY, lw=1.0)
            axis.plot(time, values, color=COLOURS[0], lw=1.1)
            axis.set_title(method.label + where)
            axis.set_xlim(0.0, time[-1] if count > 1 else 1.0)
            # A noisy method must not flatten the traces of all others.
            most = max(most, float(np.percentile(np.abs(values), 97)))
        if own is not None:
            largest = float(np.abs(own).max())
            most = max(1.15 * largest, min(most, 3.0 * largest))
        for axis in axes:
            axis.set_ylim(-1.1 * max(most, 1e-6), 1.1 * max(most, 1e-6))
    return figure


def _shown_direction(done: Rendered, direction: Array) -> tuple[Array, str]:
    """Return the direction (3,) along which to show a method's force, and a note for the title."""
    across = across_mean(done.run.force)
    change = across - across.mean(axis=0)
    if np.square(change @ direction).sum() >= 0.01 * np.square(change).sum():
        return direction, ""
    return _main_direction(across), ", across the motion"


def spectra_figure(result: Comparison) -> Figure:
    """Return the tangential force in third octaves, the band of 20 to 200 Hz marked."""
    rows = done_rows(result)
    title = f"{result.scene.name}: tangential force in third octaves"
    subtitle = f"shaded: {BAND[0]:g} to {BAND[1]:g} Hz, with the RMS within; grey: asperity"
    levels = [_third_octaves(done) for _, done in rows]
    top = max(1e-6, *(float(rms.max(initial=0.0)) for _, rms in levels))
    with _panels(len(rows), title, subtitle, "third octave around [Hz]", "force [mN]") as (
        figure,
        axes,
    ):
        for axis, (method, done), level in zip(axes, rows, levels, strict=True):
            axis.axvspan(*BAND, color=SHADE, zorder=0, lw=0)
            if done is not rows[0][1] and rows[0][0].name == "asperity":
                axis.plot(*levels[0], ".-", color=_GREY, lw=1.0, ms=4)
            axis.plot(level[0], np.maximum(level[1], 1e-9), ".-", color=COLOURS[1], lw=1.1, ms=4)
            axis.set(xscale="log", yscale="log", xlim=(8.0, 500.0), ylim=(1e-4 * top, 3.0 * top))
            axis.set_xticks([10, 20, 50, 100, 200, 500])
            axis.xaxis.set_major_formatter("{x:g}")
            axis.minorticks_off()
            axis.set_title(f"{method.label}: {format_number(1e3 * done.band_rms)} mN")
        for axis in axes[:1]:
            plain_ticks(axis.yaxis)
    return figure


def _third_octaves(done: Rendered) -> tuple[Array, Array]:
    """Return the middle of each band [Hz] and the RMS of the tangential force in it [mN]."""
    # A Hann window that keeps the height of a line widens it: the power is 1.5 times too large.
    lines = np.asarray(done.spectrum.amplitude[1:], np.float64) / np.sqrt(1.5)
    if len(lines) < 2:
        return np.zeros(0), np.zeros(0)
    middles, rms = third_octaves(np.asarray(done.spectrum.frequency[1:], np.float64), lines)
    return middles, 1e3 * rms


def cost_figure(result: Comparison) -> Figure:
    """Return the cost of a tick, median and 99th percentile, over asperity's median."""
    rows = done_rows(result)
    with style():
        figure = Figure(figsize=(COLUMN_WIDTH, 1.0 + 0.32 * len(rows)))
        axis = figure.subplots()
        for i, (method, done) in enumerate(rows):
            ratio, (median, high) = done.ratio, done.cost
            colour = COLOURS[0] if method.name == "asperity" else COLOURS[1]
            worst = ratio * high / median
            axis.plot([ratio, worst], [i, i], color=colour, lw=1.6, solid_capstyle="butt")
            axis.plot(ratio, i, "o", color=colour, ms=6)
            axis.plot(worst, i, "|", color=colour, ms=9, mew=1.6)
            axis.annotate(f"{ratio:.3g}", (ratio, i), (0, 5), textcoords="offset points",
                          ha="center", va="bottom", fontsize=SMALLEST)  # fmt: skip
        axis.axvline(1.0, color=_GREY, lw=1.0, zorder=0)
        axis.set_yticks(range(len(rows)), [method.label for method, _ in rows])
        axis.set_ylim(len(rows) - 0.4, -0.75)
        axis.set_xscale("log")
        plain_ticks(axis.xaxis)
        axis.set(xlabel="cost of a tick over asperity's median in one run (point: "
                 "median, bar: p99)")  # fmt: skip
        axis.set_title(f"{result.scene.name}: cost per tick")
        figure.tight_layout()
    return figure
