"""The figures of a sweep, and the share of the variance that one parameter alone explains."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from asperity._core.digits import plain_number, telling
from asperity.drawing.figure_style import (
    COLOURS,
    MARKERS,
    PAGE_WIDTH,
    SMALLEST,
    log_scale,
    plain_ticks,
    style,
)
from asperity.errors import AsperityError
from asperity.studies.otaduy_lin_2004.peak_fit import fit_quadratic
from asperity.studies.sweeps.batch import FAILED, WAITING
from asperity.studies.sweeps.views import SweepView, completed_table, is_number

_SHOWN = {"m": (1e3, "mm"), "m/s": (1e3, "mm/s"), "m^2": (1e6, "mm²")}
_MOST_POINTS = 4000
Values = NDArray[Any]


def draw(data: xr.Dataset, view: SweepView) -> Figure:
    """Return the figure of a view of a dataset from `open_sweep`."""
    columns, results = completed_table(data, view.metric)
    if results.size < 2:
        raise AsperityError(
            f"the store has {results.size} completed combinations; run the sweep first"
        )
    with style():
        figure: Figure = {"curve": _curve, "map": _map, "effects": _effects}[view.kind](
            data, view, columns, results
        )
        title = figure.suptitle(data.attrs["title"], x=0.01, ha="left", fontsize=11)
        title.set_fontweight("bold")
        figure.supxlabel(_counted(data), x=0.99, ha="right", fontsize=SMALLEST, color="#555555")
    return figure


def _counted(data: xr.Dataset) -> str:
    states = data["state"].values
    named = ((states.size, "combinations"), ((states == FAILED).sum(), "failed"),
             ((states == WAITING).sum(), "not run yet"))  # fmt: skip
    return ", ".join(f"{count} {what}" for count, what in named if count)


def _curve(
    data: xr.Dataset, view: SweepView, columns: dict[str, Values], results: Values
) -> Figure:  # fmt: skip
    """Draw the metric over one parameter: another as colour, the rest as median and quantiles."""
    figure = Figure(figsize=(7.2, 4.8), layout="constrained")
    axis = figure.subplots()
    scale, _ = _scale(data, view.x)
    x = columns[view.x].astype(np.float64)
    log = _is_log(x), _is_log(results)
    levels: list[Any] = list(np.unique(columns[view.colour])) if view.colour else [None]
    for i, level in enumerate(levels):
        chosen = np.ones(x.size, bool) if level is None else columns[view.colour] == level
        _draw_level(axis, data, view, x[chosen] * scale, results[chosen], i, level, all(log))
    log_scale(axis, x=log[0], y=log[1])
    axis.set(xlabel=_axis_label(data, view.x), ylabel=_axis_label(data, view.metric))
    _note_hidden(axis, data, "median and 10-90 %", set(columns) - {view.x, view.colour})
    axis.legend(loc="best", handletextpad=0.4, labelspacing=0.3)
    return figure


def _draw_level(
    axis: Axes,
    data: xr.Dataset,
    view: SweepView,
    x: Values,
    y: Values,
    i: int,
    level: Any,
    log: bool,
) -> None:
    """Draw one colour's points, their spread, and the quadratic where both axes are log."""
    groups = Groups(x, y)
    centres = np.asarray(groups.centres, np.float64)
    low, middle, high = groups.quantiles(0.1, 0.5, 0.9)
    colour, marker = COLOURS[i % 6], MARKERS[i % 6]
    label = "" if level is None else _level_label(data, view.colour, level)
    if max(part.size for part in groups.parts) > 1:
        axis.fill_between(centres, low, high, color=colour, alpha=0.15, lw=0)
    if log and centres.size >= 5:
        # The fit takes metres and x is in millimetres; x in another unit is scaled alike.
        fit = fit_quadratic(centres * 1e-3, middle)
        fine = np.geomspace(centres[0], centres[-1], 200)
        axis.plot(fine, fit(fine * 1e-3), color=colour, lw=1.0)
        peak = fit.peak_spacing * 1e3
        label += f"{'  ' * bool(label)}R² {telling([fit.r_squared], [1.0])[0]}"
        if centres[0] < peak < centres[-1]:
            axis.plot(
                peak, float(fit(np.array([peak * 1e-3]))[0]), marker, color=colour, ms=7.5,
                mec="black", mew=0.9, zorder=5,
            )  # fmt: skip
            label += f", peak {peak:.3g}{_spaced(_scale(data, view.x)[1])}"
        axis.plot(centres, middle, marker, color=colour, ms=3.2, mew=0.0, alpha=0.75, label=label)
    else:
        axis.plot(
            centres, middle, marker + "-", color=colour, ms=3.2, lw=1.0, label=label or "median"
        )


def _map(data: xr.Dataset, view: SweepView, columns: dict[str, Values], results: Values) -> Figure:
    """Draw the metric over two parameters as an image, with medians over the others."""
    figure = Figure(figsize=(7.2, 5.2), layout="constrained")
    axis = figure.subplots()
    across, up = Groups(columns[view.x], results), Groups(columns[view.y], results)
    heat = np.full((len(up.centres), len(across.centres)), np.nan)
    for i, j in np.unique(np.stack([up.places, across.places], axis=1), axis=0):
        heat[i, j] = np.median(results[(up.places == i) & (across.places == j)])
    edges, logs = [], []
    for name, groups in ((view.x, across), (view.y, up)):
        centres = np.asarray(groups.centres, np.float64) * _scale(data, name)[0]
        logs.append(_is_log(centres))
        edges.append(_edges(centres, logs[-1]))
    norm = LogNorm() if _is_log(heat[np.isfinite(heat)]) else None
    image = axis.pcolormesh(*edges, heat, cmap="cividis", norm=norm)
    log_scale(axis, x=logs[0], y=logs[1])
    axis.set(xlabel=_axis_label(data, view.x), ylabel=_axis_label(data, view.y))
    axis.grid(False)
    _note_hidden(axis, data, "median", set(columns) - {view.x, view.y})
    bar = figure.colorbar(image, ax=axis, label=_axis_label(data, view.metric))
    if norm is not None:
        plain_ticks(bar.ax.yaxis)
    return figure


def _effects(
    data: xr.Dataset, view: SweepView, columns: dict[str, Values], results: Values
) -> Figure:
    """Draw the metric over every parameter, and the share of variance that each explains."""
    names = [name for name in columns if np.unique(columns[name]).size > 1]
    if not names:
        raise AsperityError("no parameter has two completed values; run the sweep first")
    log = _is_log(results)
    judged = np.log(results) if log else results
    shares = {name: share(columns[name], judged) for name in names}
    names.sort(key=lambda name: -shares[name])
    panels = len(names) + 1
    across = min(panels, 3)
    down = -(-panels // across)
    figure = Figure(figsize=(PAGE_WIDTH * across / 3, 2.9 * down + 0.5), layout="constrained")
    axes = np.atleast_1d(figure.subplots(down, across)).ravel()
    bars = axes[0]
    bars.barh(range(len(names)), [100.0 * shares[name] for name in names], color=COLOURS[0])
    bars.set_yticks(range(len(names)), [_label(data, name) for name in names])
    bars.invert_yaxis()
    bars.set_xlim(0, max(100.0 * max(shares.values()) * 1.1, 5.0))
    bars.set_xlabel("% of the variance")
    bars.set_title(f"Explained by one alone{',' if log else ''}" + "\nof the logarithm" * log)
    bars.grid(axis="y", visible=False)
    for axis, name in zip(axes[1:], names, strict=False):
        _draw_effect(axis, data, name, columns[name], results, log)
        axis.set_title(f"{plain_number(100.0 * shares[name], 2)} % of the variance")
    for axis in axes[panels:]:
        axis.set_visible(False)
    for axis in axes[1:panels:across]:
        axis.set_ylabel(_axis_label(data, view.metric))
    if across > 1:
        axes[1].set_ylabel(_axis_label(data, view.metric))
    return figure


def _draw_effect(
    axis: Axes, data: xr.Dataset, name: str, values: Values, results: Values, log: bool
) -> None:
    """Draw one panel: all points, with median and quartiles of groups."""
    groups = Groups(values, results)
    low, middle, high = groups.quantiles(0.25, 0.5, 0.75)
    numbers = is_number(data, name)
    scale = _scale(data, name)[0]
    x = values * scale if numbers else groups.places.astype(float)
    centres = groups.centres * scale if numbers else np.arange(len(groups.centres), dtype=float)  # type: ignore[operator]
    step = max(results.size // _MOST_POINTS, 1)
    axis.plot(x[::step], results[::step], ".", color="#bbbbbb", ms=1.5, mew=0.0, rasterized=True)
    if numbers:
        axis.fill_between(centres, low, high, color=COLOURS[0], alpha=0.3, lw=0)
        axis.plot(centres, middle, "o-", color=COLOURS[0], ms=3.0)
    else:
        axis.errorbar(
            centres, middle, [middle - low, high - middle], fmt="o", color=COLOURS[0], capsize=3
        )
        axis.set_xticks(centres, [str(c) for c in groups.centres], rotation=25, ha="right")
    log_scale(axis, x=numbers and _is_log(x), y=log)
    axis.set_xlabel(_axis_label(data, name))


def _scale(data: xr.Dataset, name: str) -> tuple[float, str]:
    """Return the factor by which a parameter is scaled for display, and its unit then."""
    unit = str(data[name].attrs.get("units", ""))
    if name in data.attrs["keep"]:
        return 1.0, unit
    if unit == "m" and float(np.nanmax(np.abs(data[name].values))) < 1e-3:
        return 1e6, "µm"
    return _SHOWN.get(unit, (1.0, unit))


def _label(data: xr.Dataset, name: str) -> str:
    return str(data[name].attrs.get("long_name", name))


def _note_hidden(axis: Axes, data: xr.Dataset, what: str, hidden: set[str]) -> None:
    """Title a panel with the parameters over which it shows medians."""
    names = ", ".join(_label(data, str(n)) for n in data.coords if n in hidden)
    if names:
        axis.set_title(textwrap.fill(f"{what} over {names}", 70), fontsize=SMALLEST)


def _axis_label(data: xr.Dataset, name: str) -> str:
    unit = _scale(data, name)[1] if is_number(data, name) else ""
    return f"{_label(data, name)} [{unit}]" if unit not in ("", "1") else _label(data, name)


def _level_label(data: xr.Dataset, name: str, level: Any) -> str:
    if not is_number(data, name):
        return str(level)
    scale, unit = _scale(data, name)
    return f"{_label(data, name)} {level * scale:.3g}{_spaced(unit)}"


def _spaced(unit: str) -> str:
    return "" if unit in ("", "1") else f" {unit}"


def _is_log(values: Values) -> bool:
    """Return whether values are positive and span at least a factor of three."""
    return bool(values.size and values.min() > 0.0 and values.max() >= 3.0 * values.min())


def _edges(centres: Values, log: bool) -> Values:
    """Return the borders of cells around their centres."""
    places = np.log(centres) if log else centres
    between = 0.5 * (places[1:] + places[:-1])
    edges = np.concatenate([[2 * places[0] - between[0]], between, [2 * places[-1] - between[-1]]])
    return np.exp(edges) if log else edges


_BINS = 12
_LEAST_IN_BIN = 8


class Groups:
    """Results grouped by one parameter: by its values, or into bins of equal size.

    Parameters
    ----------
    values : (n,) array
        Of the parameter: numbers, or labels.
    results : (n,) array
        Finite.
    """

    def __init__(self, values: NDArray[np.generic], results: NDArray[np.float64]) -> None:
        levels, places = np.unique(values, return_inverse=True)
        if levels.size > max(_BINS, 2) and values.dtype.kind == "f" and levels.size > 40:
            bins = int(min(max(results.size // _LEAST_IN_BIN, 2), _BINS))
            order = np.argsort(values, kind="stable")
            places = np.empty(results.size, np.int64)
            places[order] = np.arange(results.size) * bins // results.size
            self.centres: NDArray[np.generic] = np.array(
                [np.median(values[places == i].astype(np.float64)) for i in range(bins)]
            )
        else:
            self.centres = levels
        self.places = places.ravel()
        self.parts = [results[self.places == i] for i in range(len(self.centres))]

    def quantiles(self, *parts: float) -> NDArray[np.float64]:
        """Return quantiles (len(parts), groups) of the results in each group."""
        return np.array([np.quantile(part, parts) for part in self.parts]).T


def share(values: NDArray[np.generic], results: NDArray[np.float64]) -> float:
    """Return the share of the variance of results that one parameter alone explains, 0 to 1.

    The variance of the groups' means over the whole variance (the correlation ratio; of a sampled
    design an estimate of the first-order Sobol index, Sobol 1993), less what groups of that size
    explain of pure noise.
    """
    groups = Groups(values, results)
    total = float(np.sum((results - results.mean()) ** 2))
    n, k = results.size, len(groups.parts)
    if not total > 0.0 or n <= k:
        return 0.0
    between = sum(part.size * (part.mean() - results.mean()) ** 2 for part in groups.parts)
    within = (total - between) / (n - k)
    return float(np.clip((between - (k - 1) * within) / total, 0.0, 1.0))
