"""Figures of the findings: the curves that the criteria are read off, and the fit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from asperity.drawing.figure_style import (
    COLOURS,
    COLUMN_WIDTH,
    MARKERS,
    SHADE,
    SMALLEST,
    log_scale,
    style,
)
from asperity.geometry.offsets.surface import drop_point
from asperity.studies.literature.conditions import GRAINS, grains_curves
from asperity.studies.literature.criteria import maximum_of
from asperity.studies.literature.finger import Finger
from asperity.studies.literature.hand_search import UNITS
from asperity.studies.literature.laboratory import Laboratory, Touch
from asperity.studies.literature.measures import Measure
from asperity.studies.literature.plates import Gratings, Plate
from asperity.studies.literature.table import MARKS, Column, FindingResult

_MARK_COLOURS = {"yes": "#0072B2", "no": "#f0d9cc", "skipped": "#e6e6e6"}


def table_figure(rows: Sequence[FindingResult], columns: Sequence[Column]) -> Figure:
    """Return the table as a figure, filled where a finding comes out."""
    with style():
        figure = Figure(figsize=(COLUMN_WIDTH, 0.31 * len(rows) + 1.2))
        axis = figure.subplots()
        for i, (_, verdicts) in enumerate(rows):
            for j, column in enumerate(columns):
                mark = MARKS[verdicts[column.name].holds]
                place = (j - 0.47, i - 0.45)
                axis.add_patch(Rectangle(place, 0.94, 0.9, color=_MARK_COLOURS[mark], lw=0))
                colour = "white" if mark == "yes" else "#555555"
                axis.text(j, i, mark, ha="center", va="center", color=colour, fontsize=SMALLEST)
        axis.set(xlim=(-0.5, len(columns) - 0.5), ylim=(len(rows) - 0.5, -0.5))
        titles = [
            f"{finding.title} (by construction)" if finding.by_construction else finding.title
            for finding, _ in rows
        ]
        axis.set_yticks(range(len(rows)), titles)
        names = [column.measure.name.replace("acceleration", "u''") for column in columns]
        # Break names that are wider than their column.
        names = [name if len(name) < 11 else "\n".join(name.rsplit(" ", 2)) for name in names]
        names = [
            f"chosen:\n{name}" if column.name == "chosen" else name
            for name, column in zip(names, columns, strict=True)
        ]
        axis.set_xticks(range(len(columns)), names)
        axis.xaxis.tick_top()
        axis.tick_params(length=0)
        axis.grid(False)
        for spine in axis.spines.values():
            spine.set_visible(False)
        figure.tight_layout()
    return figure


def curves_figure(lab: Laboratory, measure: Measure, title: str) -> Figure:
    """Return the curves on which most criteria are based, for one hand and metric."""
    plan = lab.plan
    with style():
        figure = Figure(figsize=(COLUMN_WIDTH, 9.4))
        axes = figure.subplots(3, 2).ravel()
        probes = [f"{d * 1e3:g} mm" for d in plan.diameters]
        speeds = [f"{v * 1e3:g} mm/s" for v in plan.speeds]
        families: tuple[tuple[str, Plate, str, list[str]], ...] = (
            ("Sinusoids, three probes", lab.sinusoids, "diameter", probes),
            ("Sinusoids, three speeds", lab.sinusoids, "speed", speeds),
            ("Dots, three probes; dotted: drop points", lab.dots, "diameter", probes),
            ("Dots, three speeds", lab.dots, "speed", speeds),
        )
        for axis, (name, plate, factor, labels) in zip(axes, families, strict=False):
            _family(axis, lab, measure, plate, plan.touches(factor), labels)
            axis.set_title(name)
        for colour, diameter in zip(COLOURS, plan.diameters, strict=False):
            place = drop_point(diameter, height=lab.dots.height) * 1e3
            axes[2].axvline(place, color=colour, lw=1.0, ls=":")
        grooves = plan.groove_places
        _draw(axes[4], grooves, lab.curve(measure, Gratings(), plan.touch(), grooves), 0, "probe")
        axes[4].set_title("Gratings")
        touches = plan.touch(probe=Finger()), plan.touches("diameter")[0]
        finger, probe = lab.curves(measure, lab.dots, touches)
        _draw(axes[5], plan.places, finger / finger.max(), 0, "finger")
        _draw(axes[5], plan.places, probe / probe.max(), 1, probes[0])
        axes[5].set_title("Finger and probe over dots")
        for axis in axes:
            log_scale(axis)
            axis.legend(loc="lower center")
        for axis in axes:
            axis.set_xlabel("spacing [mm]")
        axes[4].set_xlabel("width of groove [mm]")
        for axis in axes[[0, 2, 4]]:
            axis.set_ylabel(f"{measure.name} [{measure.unit}]")
        axes[5].set_ylabel("over its largest")
        figure.suptitle(title, x=0.01, ha="left", fontsize=11, fontweight="bold")
        figure.tight_layout(w_pad=1.5, h_pad=1.5)
    return figure


def grains_figure(labs: Sequence[tuple[Laboratory, Measure]]) -> Figure:
    """Return the curves over grain size, one panel for each hand and metric."""
    sizes = [size for _, size in GRAINS]
    with style():
        figure = Figure(figsize=(0.5 * COLUMN_WIDTH * len(labs), 3.5))
        axes = np.atleast_1d(figure.subplots(1, len(labs)))
        for axis, (lab, measure) in zip(axes, labs, strict=True):
            for i, row in enumerate(grains_curves(lab, measure)):
                label = f"probe {lab.plan.diameters[i] * 1e3:g} mm"
                _draw(axis, np.array(sizes), row, i, label)
            log_scale(axis)
            axis.set_xticks([s * 1e3 for s in sizes], [f"{n}\n{s * 1e3:g}" for n, s in GRAINS])
            axis.set(xlabel="grit, and its grain [mm]", ylabel=f"{measure.name} [{measure.unit}]")
            axis.legend()
        figure.tight_layout()
    return figure


def fit_figure(fit: dict[str, Any]) -> Figure:
    """Return profiles over the hand's parameters, and the share of designs for each finding."""
    with style():
        names = list(fit["share_of_designs"])
        height = 0.27 * len(names)
        figure = Figure(figsize=(COLUMN_WIDTH, 3.6 + height), layout="constrained")
        grid = figure.add_gridspec(2, 3, height_ratios=[2.4, height])
        for i, (name, parts) in enumerate(fit["profile"].items()):
            axis = figure.add_subplot(grid[0, i])
            edges = np.array(parts["edges"])
            for j, (key, label) in enumerate(
                (("any_metric", "any metric"), ("chosen_metric", fit["chosen"]["name"]))
            ):
                heights = [np.nan if best is None else best for best in parts[key]]
                axis.stairs(heights, edges, color=COLOURS[j], lw=1.8 - 0.5 * j, label=label)
            spread = fit["bootstrap"][name]
            axis.axvspan(spread["low"], spread["high"], color=SHADE, zorder=0)
            axis.axvline(fit["chosen"][name], color="#333333", lw=1.0, ls="--")
            axis.set(xlabel=f"{name} [{UNITS[name]}]", ylim=(0, fit["counted"] + 0.5))
            log_scale(axis, y=False)
            axis.set_yticks(range(0, fit["counted"] + 1, 2))
            if i == 0:
                axis.set_ylabel(f"most findings, of {fit['counted']}")
                axis.legend(loc="lower left", frameon=True, framealpha=0.9, edgecolor="none")
        axis = figure.add_subplot(grid[1, :])
        shares = [100.0 * fit["share_of_designs"][name] for name in names]
        colours = [COLOURS[0] if fit["holds"][name] else "#d3a78f" for name in names]
        axis.barh(range(len(names)), shares, color=colours, height=0.7)
        for at, share in enumerate(shares):
            axis.text(share + 1.0, at, f"{share:.2g}", va="center", fontsize=SMALLEST)
        held = set(fit["held_out_findings"])
        labels = [f"{name} (held out)" if name in held else name for name in names]
        axis.set_yticks(range(len(names)), labels)
        axis.invert_yaxis()
        axis.set_xlabel("share of hands and metrics [%]")
        axis.set_title("Who gets each finding; blue: the chosen hand and metric does")
        axis.set_xlim(0, 112)
        axis.grid(axis="y", visible=False)
        figure.suptitle(
            "Profiles: most findings in each part of a range\n"
            "shaded: central 90 % of bootstrapped choices; dashed: the choice",
            x=0.01, ha="left", fontsize=10,
        )  # fmt: skip
    return figure


def _family(
    axis: Axes, lab: Laboratory, measure: Measure, plate: Plate,
    touches: Sequence[Touch], labels: Sequence[str],
) -> None:  # fmt: skip
    """Draw one curve for each touch, with its maximum."""
    curves = lab.curves(measure, plate, touches)
    for i, (values, label) in enumerate(zip(curves, labels, strict=True)):
        _draw(axis, lab.plan.places, values, i, label)
        top = maximum_of(lab.plan.places, values)
        if top.inside:
            axis.plot(top.spacing * 1e3, top.value, "*", color=COLOURS[i], ms=11, mec="white")


def _draw(
    axis: Axes, spacing: NDArray[np.float64], values: NDArray[np.float64], level: int, label: str
) -> None:
    axis.plot(
        spacing * 1e3, np.where(values > 0.0, values, np.nan), f"{MARKERS[level]}-",
        color=COLOURS[level], ms=3.2, lw=1.1, label=label,
    )  # fmt: skip
