"""Figures of a measure over participants and conditions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from asperity._core.arrays import Array
from asperity.drawing.figure_style import (
    COLOURS,
    PAGE_WIDTH,
    SMALLEST,
    colour_and_marker,
    log_scale,
    style,
)
from asperity.psychophysics.analysis.detection import Estimate
from asperity.psychophysics.analysis.figures import value_axis
from asperity.psychophysics.analysis.group import Group, PairedComparison
from asperity.psychophysics.design import ExperimentDesign


def people_figure(
    measure: str, found: Group, design: ExperimentDesign, proportion: float | None = None
) -> Figure:
    """Return the measure of each participant and the mean, each with its interval."""
    factor, label = _axis(measure, design, proportion)
    names = [*found.participants, "mean"]
    values = _table([*found.estimates, found.mean]) * factor
    places = np.arange(len(names), dtype=np.float64)[::-1]
    places[-1] -= 0.4
    with style():
        figure = Figure(figsize=(5.0, 1.3 + 0.24 * len(names)))
        axes = figure.subplots()
        for i, place in enumerate(places):
            mean = i == len(names) - 1
            axes.errorbar(
                values[i : i + 1, 0], [place], xerr=_errors(values[i : i + 1]),
                fmt="D" if mean else "o", color="black" if mean else COLOURS[0],
                ms=6 if mean else 4.5, capsize=2.5, elinewidth=1.4 if mean else 1.0,
            )  # fmt: skip
        axes.axhline(places[-1] + 0.7, color="#bbbbbb", lw=0.8)
        axes.set_yticks(places, names)
        axes.grid(axis="y", visible=False)
        axes.set_xlabel(label)
        _limits(axes, values, found.logarithmic, "x")
        figure.tight_layout()
    return figure


def conditions_figure(
    measure: str,
    groups: Mapping[str, Group],
    compared: list[PairedComparison],
    designs: Mapping[str, ExperimentDesign],
    proportion: float | None = None,
) -> Figure:
    """Return each participant's measure over the conditions, and the means with intervals."""
    first = next(iter(groups))
    factor, label = _axis(measure, designs[first], proportion)
    people = list(dict.fromkeys(name for g in groups.values() for name in g.participants))
    shift = np.linspace(-0.13, 0.13, len(people)) if len(people) > 1 else np.zeros(1)
    everything = []
    with style():
        figure = Figure(
            figsize=(min(2.3 + 1.3 * len(groups), PAGE_WIDTH), 3.7), layout="constrained"
        )
        axes = figure.subplots()
        for k, name in enumerate(people):
            place, rows = [], []
            for i, one in enumerate(groups.values()):
                if name in one.participants:
                    place.append(i + shift[k])
                    rows.append(one.estimates[one.participants.index(name)])
            values = _table(rows) * factor
            everything.append(values)
            colour, marker = colour_and_marker(k)
            axes.errorbar(
                place, values[:, 0], yerr=_errors(values), fmt=marker + "-",
                color=colour, ms=4, lw=0.8, elinewidth=0.7, alpha=0.75,
                label=name if len(people) <= 8 else None,
            )  # fmt: skip
        means = _table([one.mean for one in groups.values()]) * factor
        everything.append(means)
        axes.errorbar(
            np.arange(len(groups)) + 0.25, means[:, 0], yerr=_errors(means), fmt="D",
            color="black", ms=6, capsize=3, elinewidth=1.4, label="mean", zorder=5,
        )  # fmt: skip
        axes.set_xticks(range(len(groups)), [_wrapped(name) for name in groups])
        axes.set_xlim(-0.4, len(groups) - 0.4)
        axes.grid(axis="x", visible=False)
        axes.set_ylabel(label)
        _limits(axes, np.concatenate(everything), groups[first].logarithmic, "y")
        if len(compared) == 1:
            axes.set_title(_title(compared[0]), fontsize=SMALLEST)
        figure.legend(loc="outside right center")
    return figure


def _title(one: PairedComparison) -> str:
    kind = "ratio" if one.logarithmic else "difference"
    value, low, high = one.effect
    p = "p < 0.001" if one.p < 0.001 else f"p = {one.p:.3f}"
    return (
        f"{kind} {value:.3g} ({low:.3g} to {high:.3g})\n"
        f"t({one.people - 1}) = {one.t:.2f}, {p}, dz = {one.effect_size.value:.2f}"
    )


def _axis(measure: str, design: ExperimentDesign, proportion: float | None) -> tuple[float, str]:
    """Return the factor and label of a measure's axis."""
    if measure == "d_prime":
        return 1.0, "d'"
    if measure == "exponent":
        return 1.0, "exponent of the power law"
    factor, label = value_axis(design)
    unit = label.partition("[")[1] + label.partition("[")[2]
    kind, _, standard = measure.partition("_")
    what = {"pse": "point of subjective equality", "jnd": "just noticeable difference"}
    if kind in what:
        of = f", standard {standard}" if standard else ""
        return factor, f"{what[kind]}{of} {unit}".strip()
    name = "threshold" if proportion is None or measure == "threshold" else (
        f"level at {100.0 * proportion:g} % right"
    )  # fmt: skip
    if measure == "level_at_1":
        name = "level of d' = 1"
    if getattr(design.settings, "level", "value") == "weber":
        return 100.0, f"{name} [% of the standard]"
    return factor, f"{name} {unit}".strip()


def _table(estimates: list[Estimate]) -> Array:
    """Return value, low and high (n, 3)."""
    return np.array(estimates, dtype=np.float64).reshape(-1, 3)


def _errors(values: Array) -> Array:
    """Return how far the ends of intervals (n, 3) are from the values (2, n); 0 if unknown."""
    apart = np.abs(np.stack([values[:, 0] - values[:, 1], values[:, 2] - values[:, 0]]))
    return np.nan_to_num(apart)


def _limits(axes: Axes, values: Array, logarithmic: bool, which: str) -> None:
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    if logarithmic:
        reach = max((high / low) ** 0.08, 1.05)
        getattr(axes, f"set_{which}lim")(low / reach, high * reach)
        log_scale(axes, x=which == "x", y=which == "y")
    else:
        reach = 0.08 * (high - low) or 1.0
        getattr(axes, f"set_{which}lim")(low - reach, high + reach)


def _wrapped(name: str) -> str:
    import textwrap

    return "\n".join(textwrap.wrap(name, 18))
