"""Figures of the studies, made for print."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from asperity._core.digits import telling
from asperity.drawing.figure_style import (
    COLOURS,
    MARKERS,
    REPORT_WIDTH,
    SMALLEST,
    log_scale,
    style,
)
from asperity.runs.third_octaves import third_octaves
from asperity.runs.vibration_metrics import spectrum
from asperity.studies.otaduy_lin_2004.claims import LEAST_R_SQUARED, of_finger

_SCALE = {"m": (1e3, "mm"), "m/s": (1e3, "mm/s"), "N": (1.0, "N"), "Pa": (1e-3, "kPa")}
_DOTTED = (0, (2, 2))
_RATIO = "acceleration over that\nof the probe of {}"


_FACTORS = {
    "diameter": "probe diameter", "normal_force": "normal force", "speed": "speed",
    "modulus": "modulus of the pad",
}  # fmt: skip
_BANDS = (16.0, 550.0)
"""Bands that are drawn: what a hand feels as vibration [Hz]."""


def level_labels(data: xr.Dataset) -> list[str]:
    """Return the legend entry of each level of a study: its value with the unit."""
    values = data[data.attrs["factor"]]
    scale, unit = _SCALE[values.attrs["units"]]
    return [f"{value * scale:.3g} {unit}" for value in values.values]


def study_figure(data: xr.Dataset, metrics: Sequence[str]) -> Figure:
    """Return one panel for each metric of a study, one below the other, over spacing, log-log.

    Points are simulated; the thin line is the quadratic fit in log-log, with its R^2 in the
    legend; the filled mark with its bar is the peak found by local refinement. The curves of a
    finger have many peaks: they are lines from point to point, without fit and marks.
    """
    with style():
        figure = Figure(figsize=(REPORT_WIDTH, (4.0 if len(metrics) == 1 else 3.4) * len(metrics)))
        axes = np.atleast_1d(figure.subplots(len(metrics), 1))
        for axis, metric in zip(axes, metrics, strict=True):
            _draw_levels(axis, data, metric)
        figure.tight_layout(h_pad=1.5)
    return figure


def _draw_levels(axis: Axes, data: xr.Dataset, metric: str) -> None:
    spacing = data["spacing"].values * 1e3
    fine = np.linspace(np.log10(spacing[0]), np.log10(spacing[-1]), 200)
    finger = of_finger(data)
    for level, label in enumerate(level_labels(data)):
        colour, marker = COLOURS[level % 6], MARKERS[level % 6]
        values = data[metric].values[level]
        repeats = data["status"].values[level] == 0
        axis.plot(
            spacing, np.where(repeats, np.nan, values), marker, color=colour, ms=3.4, mfc="none",
            mew=0.8, alpha=0.9,
        )  # fmt: skip
        if finger:
            axis.plot(spacing, values, color=colour, lw=1.1, label=label)
            continue
        explained = float(data[f"{metric}_fit_r_squared"][level])
        r_squared = telling([explained], [LEAST_R_SQUARED, 1.0])[0]
        axis.plot(
            spacing, np.where(repeats, values, np.nan), marker, color=colour, ms=3.2, mew=0.0,
            alpha=0.75, label=f"{label}  (R² {r_squared})",
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
    unit = " [dimensionless]" if attrs["units"] == "1" else f" [{attrs['units']}]"
    title = attrs["long_name"]
    if metric == "band_rms":
        low, high = data.attrs["band"]
        title = f"RMS of u'' in {low:g}-{high:g} Hz (chosen after the fact)"
    axis.set_title(f"Finger: {title}" if finger else title)
    low, high = np.nanmin(data[metric].values), np.nanmax(data[metric].values)
    _limit(axis, spacing, low / (high / low) ** 0.08, high * (high / low) ** 0.12)
    if data.attrs["factor"] == "diameter" and data.attrs["surface"] == "sinusoid":
        for level, diameter in enumerate(data["diameter"].values):
            drop = np.pi * np.sqrt(2.0 * data.attrs["amplitude"] * diameter) * 1e3
            axis.axvline(drop, color=COLOURS[level % 6], lw=0.9, ls=_DOTTED, zorder=0)
        axis.plot([], [], color="#666666", lw=0.9, ls=_DOTTED, label="drop point of each probe")
    axis.set_xlabel(f"texture spacing{' under the finger' if finger else ''} [mm]")
    axis.set_ylabel(
        {"band_rms": "RMS of u''", "threshold_power": "power"}.get(metric, title) + unit
    )
    # The frame keeps vertical lines from crossing the text.
    axis.legend(
        title=_FACTORS[data.attrs["factor"]], loc="best", handletextpad=0.3, labelspacing=0.3,
        frameon=True, framealpha=0.9, edgecolor="none",
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
        rows = -(-data.sizes["model"] // 2)
        figure = Figure(figsize=(REPORT_WIDTH, 2.6 * rows + 0.6), layout="constrained")
        axes = figure.subplots(rows, 2, sharex=True, sharey=True).ravel()
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
                text += f",\nmedian {100 * np.median(spread):.3g} %"
            axis.set_title(title)
            axis.text(
                0.04, 0.04, f"{verdict}\n{text}", transform=axis.transAxes, color="#333333",
                fontsize=SMALLEST,
            )  # fmt: skip
            _limit(axis, spacing, 0.6 * float(data[metric].min()), 1.4 * float(data[metric].max()))
        attrs = data[metric].attrs
        for axis in axes[-2:]:
            axis.set_xlabel("spacing [mm]")
        for axis in axes[::2]:
            axis.set_ylabel(f"{attrs['long_name']} [{attrs['units']}]")
        figure.legend(
            *axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=len(labels),
            title="probe diameter",
        )  # fmt: skip
    return figure


def rub_figure(data: xr.Dataset) -> Figure:
    """Return the rub of several probes over one surface: map, offsets, vibration by band."""
    with style():
        figure = Figure(figsize=(REPORT_WIDTH, 5.6), layout="constrained")
        grid = figure.add_gridspec(2, 2, width_ratios=[1.0, 1.7])
        chart = figure.add_subplot(grid[0, 0])
        _draw_map(figure, chart, data)
        chart.set_title("Heights, and the path")
        offsets, ratios = figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, :])
        _draw_offsets(offsets, data)
        offsets.set(xlabel="along the path [mm]", title="The surface, and what each probe traces")
        offsets.legend(loc="upper right", framealpha=0.9, frameon=True, edgecolor="none")
        _draw_ratios(ratios, data)
        ratios.set(ylabel=_RATIO.format(_probes(data)[0]), title="Vibration of the hand by band")
        ratios.legend(title="probe", loc="lower left")
        figure.suptitle(data.attrs["title"], x=0.01, ha="left", fontsize=11, fontweight="bold")
    return figure


def maps_figure(rubs: Sequence[xr.Dataset]) -> Figure:
    """Return the maps of surfaces, side by side, with the paths of the probes."""
    with style():
        figure = Figure(figsize=(REPORT_WIDTH, 3.0), layout="constrained")
        for axis, data in zip(_row(figure, len(rubs)), rubs, strict=True):
            _draw_map(figure, axis, data)
            axis.set_title(_in_lines(data))
    return figure


def offsets_figure(rubs: Sequence[xr.Dataset]) -> Figure:
    """Return the first millimetres of surfaces, one below the other, and what probes trace."""
    with style():
        figure = Figure(figsize=(REPORT_WIDTH, 1.75 * len(rubs) + 0.6), layout="constrained")
        axes = np.atleast_1d(figure.subplots(len(rubs), 1, sharex=True))
        for axis, data in zip(axes, rubs, strict=True):
            _draw_offsets(axis, data)
            axis.set_title(data.attrs["title"])
        axes[-1].set_xlabel("along the path [mm]")
        figure.legend(
            *axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=6,
            handlelength=1.4,
        )  # fmt: skip
        figure.align_ylabels(axes)
    return figure


def ratios_figure(rubs: Sequence[xr.Dataset]) -> Figure:
    """Return, for each surface, the vibration of larger probes over that of the smallest."""
    with style():
        figure = Figure(figsize=(REPORT_WIDTH, 3.6), layout="constrained")
        axes = _row(figure, len(rubs), sharey=True)
        for axis, data in zip(axes, rubs, strict=True):
            _draw_ratios(axis, data)
            axis.set_title(_in_lines(data))
        axes[0].set_ylabel(_RATIO.format(_probes(rubs[0])[0]))
        axes[0].legend(title="probe", loc="lower left", handlelength=1.4)
    return figure


def vibration_figure(rubs: Sequence[xr.Dataset], seconds: float = 0.25) -> Figure:
    """Return the acceleration of the hand over time with the smallest and the largest probe."""
    seconds = min(seconds, *(float(data["time"].values[-1]) for data in rubs))
    with style():
        figure = Figure(figsize=(REPORT_WIDTH, 1.75 * len(rubs) + 0.6), layout="constrained")
        axes = np.atleast_1d(figure.subplots(len(rubs), 1, sharex=True))
        for axis, data in zip(axes, rubs, strict=True):
            time = data["time"].values
            shown = time <= seconds
            for i in (0, -1):
                axis.plot(
                    1e3 * time[shown], data["acceleration"].values[i, shown], lw=1.0,
                    color=COLOURS[i % data.sizes["diameter"]], label=_probes(data)[i],
                )  # fmt: skip
            axis.set(ylabel="u'' [m/s²]", title=data.attrs["title"])
        axes[-1].set(xlabel="time [ms]", xlim=(0.0, 1e3 * seconds))
        figure.legend(
            *axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=2, title="probe"
        )
        figure.align_ylabels(axes)
    return figure


def _row(figure: Figure, count: int, *, sharey: bool = False) -> NDArray[Any]:
    return np.atleast_1d(figure.subplots(1, count, sharey=sharey))


def _in_lines(data: xr.Dataset) -> str:
    """Return the title of a surface in lines that fit a third of a figure."""
    return textwrap.fill(data.attrs["title"], 20)


def _probes(data: xr.Dataset) -> list[str]:
    return [f"{diameter * 1e3:g} mm" for diameter in data["diameter"].values]


def _draw_map(figure: Figure, axis: Axes, data: xr.Dataset) -> None:
    heights = data["heights"].values * 1e6
    extent = (0, data.attrs["map_length"] * 1e3, 0, data.attrs["map_width"] * 1e3)
    low, high = np.percentile(heights, [0.5, 99.5])
    image = axis.imshow(
        heights, origin="lower", extent=extent, cmap="cividis", vmin=low, vmax=high, aspect="equal"
    )
    axis.axhline(data.attrs["line"] * 1e3, color="white", lw=1.4)
    axis.set(xlabel="along the path [mm]", ylabel="across [mm]")
    axis.grid(False)
    top = (0.5, 1.0)
    bar = figure.colorbar(
        image, ax=axis, location="bottom", shrink=0.9, pad=0.02, anchor=top, panchor=top
    )
    bar.set_label("height [µm]")


def _draw_offsets(axis: Axes, data: xr.Dataset) -> None:
    u = data["u"].values * 1e3
    profile: NDArray[np.float64] = data["profile"].values * 1e6
    bottom = float(profile.min()) - 0.1 * float(np.ptp(profile))
    axis.fill_between(u, profile, bottom, color="#d9d9d9", lw=0)
    axis.plot(u, profile, color="#777777", lw=0.8, label="surface")
    for i, label in enumerate(_probes(data)):
        axis.plot(
            u, data["offset"].values[i] * 1e6, color=COLOURS[i], lw=1.1, label=f"probe {label}"
        )
    top = float(np.max(data["offset"].values)) * 1e6
    axis.set(ylabel="height [µm]", xlim=(u[0], u[-1]), ylim=(bottom, top + 0.05 * (top - bottom)))


def _draw_ratios(axis: Axes, data: xr.Dataset) -> None:
    """Draw the acceleration of each probe over the first one's, in octaves a third apart."""
    step = float(data["time"].values[1] - data["time"].values[0])
    levels = []
    for wave in data["acceleration"].values:
        middles, rms = third_octaves(*spectrum(wave, step, periodic=False))
        levels.append(np.sqrt(np.convolve(rms**2, np.ones(3), "valid")))
    middles = middles[1:-1]
    shown = (middles >= _BANDS[0]) & (middles <= _BANDS[1])
    least = np.maximum(levels[0], 1e-12)
    for i, label in enumerate(_probes(data)):
        axis.plot(
            middles[shown], (levels[i] / least)[shown], f"{MARKERS[i]}-", color=COLOURS[i], lw=1.2,
            ms=3.5, label=label,
        )  # fmt: skip
    axis.set(xlim=_BANDS, ylim=(0.2, 3.0))
    log_scale(axis)
    axis.set_xticks([20, 50, 100, 200, 500])
    axis.set_yticks([0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0])
    axis.set_xlabel("octave around [Hz]")
