"""Figures of a comparison: force traces, spectra, cost."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from asperity.drawing.figure_style import COLOURS, style
from asperity.runs.figures import across_mean
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
    height = 0.85 + 1.32 * lines
    with style():
        figure = Figure(figsize=(7.6, height))
        axes = figure.subplots(lines, columns, sharex=True, sharey=True, squeeze=False).ravel()
        for axis in axes[count:]:
            axis.set_visible(False)
        top, below = 1.0 - 0.08 / height, 1.0 - 0.33 / height
        figure.text(0.012, top, title, ha="left", va="top", fontsize=11, fontweight="bold")
        figure.text(0.012, below, subtitle, ha="left", va="top", fontsize=8.5)
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
    """Return the spectra of the tangential force, the band of 20 to 200 Hz marked."""
    rows = done_rows(result)
    title = f"{result.scene.name}: spectrum of the tangential force"
    subtitle = f"shaded: {BAND[0]:g} to {BAND[1]:g} Hz, with the RMS within; grey: asperity"
    top = max(1e-9, *(float(done.spectrum.amplitude[1:].max(initial=0.0)) for _, done in rows))
    with _panels(len(rows), title, subtitle, "frequency [Hz]", "force [N]") as (figure, axes):
        for axis, (method, done) in zip(axes, rows, strict=True):
            axis.axvspan(*BAND, color="#f2ead2", zorder=0, lw=0)
            first = rows[0][1]
            if done is not first and rows[0][0].name == "asperity":
                axis.plot(*(part[1:] for part in first.spectrum), color=_GREY, lw=0.8)
            amplitude = np.maximum(done.spectrum.amplitude[1:], 1e-12)
            axis.plot(done.spectrum.frequency[1:], amplitude, color=COLOURS[1], lw=0.9)
            axis.set(yscale="log", ylim=(1e-5 * top, 3.0 * top), xlim=(0.0, 500.0))
            axis.set_title(f"{method.label}: {format_number(1e3 * done.band_rms)} mN")
    return figure


def cost_figure(result: Comparison) -> Figure:
    """Return the cost of a tick, median and 99th percentile, over asperity's median."""
    rows = done_rows(result)
    with style():
        figure = Figure(figsize=(7.6, 0.9 + 0.27 * len(rows)))
        axis = figure.subplots()
        for i, (method, done) in enumerate(rows):
            ratio, (median, high) = done.ratio, done.cost
            colour = COLOURS[0] if method.name == "asperity" else COLOURS[1]
            worst = ratio * high / median
            axis.plot([ratio, worst], [i, i], color=colour, lw=1.6, solid_capstyle="butt")
            axis.plot(ratio, i, "o", color=colour, ms=6)
            axis.plot(worst, i, "|", color=colour, ms=9, mew=1.6)
            axis.annotate(f"{ratio:.3g}", (ratio, i), (0, 5), textcoords="offset points",
                          ha="center", va="bottom", fontsize=7.5)  # fmt: skip
        axis.axvline(1.0, color=_GREY, lw=1.0, zorder=0)
        axis.set_yticks(range(len(rows)), [method.label for method, _ in rows])
        axis.set_ylim(len(rows) - 0.4, -0.75)
        axis.set(xscale="log", xlabel="cost of a tick over asperity's median in one run (point: "
                 "median, bar: p99)")  # fmt: skip
        axis.set_title(f"{result.scene.name}: cost per tick")
        figure.tight_layout()
    return figure
