"""Figures of the studies, made for print."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from asperity.drawing.figure_style import COLOURS, MARKERS, log_scale, plain_ticks, style

_SCALE = {"m": (1e3, "mm"), "m/s": (1e3, "mm/s"), "N": (1.0, "N")}
_DOTTED = (0, (2, 2))


def level_labels(data: xr.Dataset) -> list[str]:
    """Return the legend entry of each level of a study."""
    values = data[data.attrs["factor"]]
    scale, unit = _SCALE[values.attrs["units"]]
    symbol = {"diameter": "D", "normal_force": "F$_n$", "speed": "v"}[data.attrs["factor"]]
    return [f"{symbol} = {value * scale:.3g} {unit}" for value in values.values]


def study_figure(data: xr.Dataset, metrics: Sequence[str]) -> Figure:
    """Return one panel for each of up to four metrics of a study, over spacing, log-log.

    Points are simulated; the thin line is the quadratic fit in log-log, with its R^2 in the
    legend; the filled mark with its bar is the peak found by local refinement.
    """
    rows = 1 if len(metrics) < 3 else 2
    columns = 1 if len(metrics) == 1 else 2
    with style():
        figure = Figure(figsize=(4.2 * columns if columns > 1 else 5.4, 3.4 * rows + 0.2))
        axes = np.atleast_1d(figure.subplots(rows, columns)).ravel()
        for axis, metric in zip(axes, metrics, strict=False):
            _draw_levels(axis, data, metric)
        for axis in axes[len(metrics) :]:
            axis.set_visible(False)
        figure.tight_layout(w_pad=2.0, h_pad=1.5)
    return figure


def _draw_levels(axis: Axes, data: xr.Dataset, metric: str) -> None:
    spacing = data["spacing"].values * 1e3
    fine = np.linspace(np.log10(spacing[0]), np.log10(spacing[-1]), 200)
    for level, label in enumerate(level_labels(data)):
        colour, marker = COLOURS[level % 6], MARKERS[level % 6]
        values = data[metric].values[level]
        repeats = data["status"].values[level] == 0
        r_squared = float(data[f"{metric}_fit_r_squared"][level])
        axis.plot(
            spacing, np.where(repeats, values, np.nan), marker, color=colour, ms=3.2, mew=0.0,
            alpha=0.75, label=f"{label}  (R² {r_squared:.2f})",
        )  # fmt: skip
        axis.plot(
            spacing, np.where(repeats, np.nan, values), marker, color=colour, ms=3.4, mfc="none",
            mew=0.8, alpha=0.9,
        )  # fmt: skip
        c = data[f"{metric}_fit"].values[level]
        fit = 10.0 ** (c[0] + c[1] * fine + c[2] * fine**2)
        axis.plot(10.0**fine, fit, color=colour, lw=1.0, alpha=0.9)
        if data[f"{metric}_peak_inside"].values[level]:
            axis.errorbar(
                float(data[f"{metric}_peak"][level]) * 1e3,
                float(data[f"{metric}_peak_value"][level]),
                xerr=float(data[f"{metric}_peak_uncertainty"][level]) * 1e3,
                fmt=marker, color=colour, ms=7.5, mec="black", mew=0.9, ecolor="black",
                elinewidth=1.0, capsize=2.5, zorder=5,
            )  # fmt: skip
    attrs = data[metric].attrs
    unit = "" if attrs["units"] == "1" else f" [{attrs['units']}]"
    title = attrs["long_name"]
    if metric == "band_rms":
        low, high = data.attrs["band"]
        title = f"RMS of u'' in {low:g}-{high:g} Hz (chosen after the fact)"
    axis.set_title(title)
    low, high = np.nanmin(data[metric].values), np.nanmax(data[metric].values)
    _limit(axis, spacing, low / (high / low) ** 0.08, high * (high / low) ** 0.12)
    if data.attrs["factor"] == "diameter" and data.attrs["surface"] == "sinusoid":
        for level, diameter in enumerate(data["diameter"].values):
            drop = np.pi * np.sqrt(2.0 * data.attrs["amplitude"] * diameter) * 1e3
            axis.axvline(drop, color=COLOURS[level % 6], lw=0.9, ls=_DOTTED, zorder=0)
        axis.plot([], [], color="#666666", lw=0.9, ls=_DOTTED, label="drop point of each probe")
    axis.set_xlabel("texture spacing [mm]")
    axis.set_ylabel(("RMS of u''" if metric == "band_rms" else title) + unit)
    # The frame keeps vertical lines from crossing the text.
    axis.legend(
        loc="best", handletextpad=0.3, labelspacing=0.3, frameon=True, framealpha=0.9,
        edgecolor="none",
    )  # fmt: skip


def _limit(axis: Axes, spacing: NDArray[np.float64], low: float, high: float) -> None:
    """Make both axes logarithmic, around spacings [mm] and from `low` to `high`."""
    axis.set(xlim=(0.95 * spacing[0], 1.05 * spacing[-1]), ylim=(low, high))
    log_scale(axis)


def models_figure(data: xr.Dataset, metric: str, titles: Sequence[str]) -> Figure:
    """Return one panel a force model: its metric over spacing for each probe."""
    labels = level_labels(data)
    spacing = data["spacing"].values * 1e3
    with style():
        figure = Figure(figsize=(9.6, 3.3))
        axes = figure.subplots(1, data.sizes["model"], sharey=True)
        for axis, model, title in zip(axes, data["model"].values, titles, strict=True):
            values = data[metric].sel(model=model).values
            for level, label in enumerate(labels):
                # Thinner lines on top, so that coinciding curves all show.
                axis.plot(
                    spacing, values[level], color=COLOURS[level], lw=4.2 - 1.5 * level,
                    label=label,
                )  # fmt: skip
            spread = np.ptp(values, axis=0) / np.mean(values, axis=0)
            feels = np.max(spread) > 1e-9
            verdict = "feels the probe" if feels else "blind to the probe"
            text = f"spread {100 * np.max(spread):.3g} %"
            if feels:
                text += f" (median {100 * np.median(spread):.3g} %)"
            axis.set_title(title)
            axis.text(
                0.04, 0.04, f"{verdict}\n{text}", transform=axis.transAxes,
                fontsize=8, color="#333333",
            )  # fmt: skip
            _limit(axis, spacing, 0.6 * float(data[metric].min()), 1.4 * float(data[metric].max()))
            axis.set_xlabel("spacing [mm]")
        attrs = data[metric].attrs
        axes[0].set_ylabel(f"{attrs['long_name']} [{attrs['units']}]")
        axes[-1].legend(loc="upper right", handlelength=1.4)
        figure.tight_layout(w_pad=1.0)
    return figure


def rub_figure(data: xr.Dataset, seconds: float = 0.25) -> Figure:
    """Return the rub of several probes over one real surface.

    Map with the path; profile and offset profiles; acceleration; its spectrum with the band.
    """
    probes = data["diameter"].values
    with style():
        figure = Figure(figsize=(9.6, 6.0))
        grid = figure.add_gridspec(2, 2, width_ratios=[1.0, 1.7], wspace=0.28, hspace=0.42)
        _draw_map(figure, figure.add_subplot(grid[0, 0]), data)
        _draw_offsets(figure.add_subplot(grid[0, 1]), data)
        time_axis, spectrum_axis = figure.add_subplot(grid[1, 1]), figure.add_subplot(grid[1, 0])
        acceleration, step = data["acceleration"].values, data["time"].values
        seconds = min(seconds, float(step[-1]))
        shown = step <= seconds
        gap = 1.1 * float(np.max(np.abs(acceleration[:, shown])))
        for i, diameter in enumerate(probes):
            label = f"D = {diameter * 1e3:g} mm"
            offset = -i * gap
            time_axis.axhline(offset, color="#cccccc", lw=0.6)
            time_axis.plot(
                step[shown] * 1e3, acceleration[i, shown] + offset, color=COLOURS[i], lw=0.9
            )
            time_axis.text(1.01 * seconds * 1e3, offset, label, color=COLOURS[i], va="center")
            spectrum_axis.plot(
                data["frequency"], data["spectrum"].values[i], color=COLOURS[i], lw=1.0,
                label=label,
            )  # fmt: skip
        time_axis.set_yticks([0.0, 0.5 * gap], ["0", f"{0.5 * gap:.2g}"])
        time_axis.set_title("Acceleration of the hand, one trace a probe")
        time_axis.set(xlabel="time [ms]", ylabel="u'' [m/s²]", xlim=(0, seconds * 1e3))
        time_axis.grid(False)
        low, high = data.attrs["band"]
        spectrum_axis.axvspan(low, high, color="#f2ead2", zorder=0)
        spectrum_axis.set(xscale="log", yscale="log", xlim=(5, 600))
        plain_ticks(spectrum_axis.xaxis)
        top = float(np.max(data["spectrum"].values))
        spectrum_axis.set_ylim(top * 1e-3, top * 1.6)
        spectrum_axis.set(xlabel="frequency [Hz]", ylabel="amplitude of u'' [m/s²/√Hz]")
        spectrum_axis.set_title(f"Spectrum; shaded: {low:g}-{high:g} Hz")
        figure.suptitle(data.attrs["title"], x=0.01, ha="left", fontsize=11, fontweight="bold")
        figure.subplots_adjust(left=0.07, right=0.91, top=0.9, bottom=0.09)
    return figure


def _draw_map(figure: Figure, axis: Axes, data: xr.Dataset) -> None:
    heights = data["heights"].values * 1e6
    extent = (0, data.attrs["map_length"] * 1e3, 0, data.attrs["map_width"] * 1e3)
    low, high = np.percentile(heights, [0.5, 99.5])
    image = axis.imshow(
        heights, origin="lower", extent=extent, cmap="cividis", vmin=low, vmax=high, aspect="equal"
    )
    axis.axhline(data.attrs["line"] * 1e3, color="white", lw=1.2)
    axis.set(xlabel="u [mm]", ylabel="v [mm]", title="Heights and the path")
    axis.grid(False)
    bar = figure.colorbar(image, ax=axis, shrink=0.85, pad=0.03)
    bar.ax.set_title("µm", fontsize=8)


def _draw_offsets(axis: Axes, data: xr.Dataset) -> None:
    u = data["u"].values * 1e3
    profile: NDArray[np.float64] = data["profile"].values * 1e6
    axis.fill_between(u, profile, profile.min() - 0.1 * np.ptp(profile), color="#d9d9d9", lw=0)
    axis.plot(u, profile, color="#777777", lw=0.8, label="surface")
    for i, diameter in enumerate(data["diameter"].values):
        axis.plot(
            u, data["offset"].values[i] * 1e6, color=COLOURS[i], lw=1.1,
            label=f"D = {diameter * 1e3:g} mm",
        )  # fmt: skip
    top = float(np.max(data["offset"].values)) * 1e6
    bottom = profile.min() - 0.1 * np.ptp(profile)
    axis.set(
        xlabel="u [mm]", ylabel="height [µm]", xlim=(u[0], u[-1]),
        ylim=(bottom, top + 0.28 * (top - bottom)),
        title="Profile along the path, and what each probe traces (its offset)",
    )  # fmt: skip
    axis.legend(ncols=5, loc="upper left", handlelength=1.2, columnspacing=1.0)
