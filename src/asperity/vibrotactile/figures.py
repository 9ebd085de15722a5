"""Figures of a fitted vibration model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from asperity.drawing.figure_style import COLOURS, PAGE_WIDTH, SMALLEST, style
from asperity.vibrotactile.distances import HIGHEST, LOWEST, spectrum
from asperity.vibrotactile.fit import Fitted, Held
from asperity.vibrotactile.harmonic import HarmonicModel
from asperity.vibrotactile.high_pass import passed_gain
from asperity.vibrotactile.lsf import coefficients_of
from asperity.vibrotactile.model import TextureModel

_MOST = 6
_STRETCH = 0.12
"""Of waveforms that are shown [s]."""


def spectra_figure(model: TextureModel, held: Sequence[Held], title: str) -> Figure:
    """Return held-out vibration against what the model makes: spectra, up to six of them."""
    shown = _spread(held)
    columns = min(len(shown), 3)
    rows = -(-len(shown) // max(columns, 1))
    with style():
        figure = Figure(figsize=(max(PAGE_WIDTH * columns / 3, 6.0), 2.6 * rows + 0.9))
        axes = np.atleast_1d(figure.subplots(rows, columns, squeeze=False)).ravel()
        for axis in axes[len(shown) :]:
            axis.set_visible(False)
        for axis, one in zip(axes, shown, strict=False):
            _spectra(axis, model, one)
        for axis in axes[max(len(shown) - columns, 0) : len(shown)]:
            axis.set_xlabel("frequency [Hz]")
        for axis in axes[::columns]:
            axis.set_ylabel("amplitude [m/s²/√Hz]")
        figure.suptitle(title, x=0.01, ha="left", fontsize=10)
        top = 1.0 - 0.3 / figure.get_figheight()
        figure.legend(
            *axes[0].get_legend_handles_labels(), loc="upper left", ncols=3, handlelength=1.4,
            bbox_to_anchor=(0.005, top),
        )  # fmt: skip
        figure.tight_layout(rect=(0, 0, 1, top - 0.2 / figure.get_figheight()))
    return figure


def _spread(held: Sequence[Held]) -> list[Held]:
    """Return up to six, spread over speed, the best and the worst among them."""
    ordered = sorted(held, key=lambda one: (one.stretch.speed, one.stretch.force))
    places = np.linspace(0, len(ordered) - 1, min(_MOST, len(ordered))).round().astype(int)
    return [ordered[i] for i in places]


def _spectra(axis: Axes, model: TextureModel, one: Held) -> None:
    rate = model.rate
    frequency, density = spectrum(one.stretch.vibration, rate)
    made = np.interp(frequency, *spectrum(one.made, rate))
    fine = np.linspace(LOWEST, min(HIGHEST, 0.5 * rate), 800)
    curve = np.sqrt(model.filter_at(one.stretch.speed, one.stretch.force).density(fine, rate))
    label = "the filter of its noise" if isinstance(model, HarmonicModel) else "its filter"
    inside = (frequency >= LOWEST) & (frequency <= HIGHEST)
    axis.plot(
        frequency[inside], np.sqrt(density[inside]), color=COLOURS[0], lw=1.2, label="held out"
    )
    axis.plot(
        frequency[inside], np.sqrt(made[inside]), color=COLOURS[1], lw=1.0, label="synthesised"
    )
    axis.plot(fine, curve, color="#222222", lw=1.1, ls="--", label=label)
    top = max(float(np.sqrt(density[inside].max())), float(np.sqrt(made[inside].max())))
    axis.set(yscale="log", ylim=(top * 1e-3, top * 4.0), xlim=(0.0, min(HIGHEST, 0.5 * rate)))
    axis.set_title(
        f"{one.stretch.speed * 1e3:.0f} mm/s, {one.stretch.force:.2f} N\nfit {one.match.fit:.2f}, "
        f"rms {one.match.level:.2f}",
        fontsize=SMALLEST,
    )


def waves_figure(model: TextureModel, held: Sequence[Held], title: str) -> Figure:
    """Return held-out vibration above what the model makes, over time."""
    shown = _spread(held)[:: max(len(_spread(held)) // 3, 1)][:3]
    with style():
        figure = Figure(figsize=(7.2, 1.7 * len(shown) + 0.7))
        axes = np.atleast_1d(figure.subplots(len(shown), 1, squeeze=False)).ravel()
        for axis, one in zip(axes, shown, strict=True):
            count = min(int(_STRETCH * model.rate), one.stretch.vibration.size)
            time = np.arange(count) / model.rate * 1e3
            size = float(np.max(np.abs(one.stretch.vibration[:count]))) or 1.0
            axis.plot(time, one.stretch.vibration[:count], color=COLOURS[0], lw=0.9)
            axis.plot(time, one.made[:count] - 2.6 * size, color=COLOURS[1], lw=0.9)
            axis.text(
                1.01,
                0.72,
                "held out",
                color=COLOURS[0],
                transform=axis.transAxes,
                fontsize=SMALLEST,
            )
            axis.text(
                1.01,
                0.22,
                "synthesised",
                color=COLOURS[1],
                transform=axis.transAxes,
                fontsize=SMALLEST,
            )
            axis.set_title(
                f"{one.stretch.speed * 1e3:.0f} mm/s, {one.stretch.force:.2f} N", fontsize=SMALLEST
            )
            # The lower trace is shifted: ticks are the upper one's.
            unit = float(f"{size:.1g}")
            axis.set_yticks([0.0, unit], ["0", f"{unit:g}"])
            axis.set_ylabel("vibration\n[m/s²]")
            axis.set_xlim(0.0, time[-1])
        axes[-1].set_xlabel("time [ms]")
        figure.suptitle(title, x=0.01, ha="left", fontsize=10)
        figure.tight_layout(rect=(0, 0, 0.96, 0.98))
    return figure


def plane_figure(fitted: Fitted, held: Sequence[Held], title: str) -> Figure:
    """Return the models over speed and force, and the order's criterion."""
    model = fitted.model
    with style():
        figure = Figure(figsize=(8.6, 3.5))
        plane, scores = figure.subplots(1, 2, width_ratios=(1.7, 1.0))
        speed, force = model.speeds * 1e3, model.forces
        plane.triplot(speed, force, model.mesh.triangles, color="#cccccc", lw=0.6)
        corner = model.noise_high_pass if isinstance(model, HarmonicModel) else 0.0
        filters = map(coefficients_of, model.ar)
        power = model.variance * [passed_gain(a, corner, model.rate) for a in filters]
        if isinstance(model, HarmonicModel):
            places = zip(model.speeds, model.forces, strict=True)
            power += [0.5 * np.sum(model.amplitudes_at(v, f) ** 2) for v, f in places]
        level = np.sqrt(power)
        n = fitted.recorded
        plane.plot(speed[n:], force[n:], "s", ms=3.0, color="#999999", label="rim")
        spots = plane.scatter(
            speed[:n], force[:n], c=level[:n], s=46, cmap="viridis", edgecolors="black",
            linewidths=0.5, zorder=3, label="fitted",
        )  # fmt: skip
        if held:
            plane.plot(
                [one.stretch.speed * 1e3 for one in held], [one.stretch.force for one in held], "x",
                color=COLOURS[1], ms=5.0, label="held out", zorder=4,
            )  # fmt: skip
        bar = figure.colorbar(spots, ax=plane, pad=0.02)
        bar.ax.set_title("rms [m/s²]", fontsize=SMALLEST)
        plane.set(xlabel="speed [mm/s]", ylabel="normal force [N]")
        plane.set_title(title)
        plane.legend(loc="lower center", bbox_to_anchor=(0.5, -0.36), ncols=3)
        plane.grid(False)
        orders = np.arange(fitted.scores.size)
        scores.plot(orders, fitted.scores - fitted.scores.min(), color=COLOURS[0])
        scores.axvline(model.order, color=COLOURS[1], lw=1.0, ls="--")
        scores.set(xlabel="AR order", ylabel="criterion above its least", yscale="symlog")
        scores.set_ylim(bottom=0.0)
        scores.set_title(f"order {model.order}")
        figure.tight_layout()
    return figure
