"""Figures of yes/no and of adjustments."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from asperity.drawing.figure_style import COLOURS, MARKERS, PAGE_WIDTH, log_scale, style
from asperity.psychophysics.design import ExperimentDesign

_MILLI = {"m": (1e3, "mm")}
"""What a reader sees in place of an SI unit."""


def _axis(design: ExperimentDesign) -> tuple[float, str]:
    """Return the factor and label of the axis of values."""
    levels = design.stimuli.levels
    assert levels is not None
    factor, unit = _MILLI.get(levels.unit, (1.0, levels.unit))
    label = levels.label or levels.key
    return factor, f"{label} [{unit}]" if unit else label


def detection_figure(sessions: Sequence[dict[str, Any]], design: ExperimentDesign) -> Figure:
    """Return d' and the criterion over the level, with intervals, a line for each session."""
    kind = getattr(design.settings, "level", "value")
    factor, label = (100.0, "signal above the standard [%]") if kind == "weber" else _axis(design)
    if kind == "difference":
        label = f"difference in {label}"
    with style():
        figure = Figure(figsize=(6.8, 3.4))
        for axes, name, title in zip(
            figure.subplots(1, 2), ("d_prime", "criterion"), ("d'", "criterion c"), strict=True
        ):
            for i, session in enumerate(sessions):
                rows = session["levels"]
                x = np.array([row["level"] * factor for row in rows])
                y, low, high = (
                    np.array([row[f"{name}{end}"] for row in rows]) for end in ("", "_low", "_high")
                )
                axes.errorbar(
                    x, y, yerr=[y - low, high - y], fmt=MARKERS[i % 6] + "-", capsize=2.5,
                    color=COLOURS[i % 6], ms=4.5, lw=0.9,
                    label=session["session"] if len(sessions) <= 6 else None,
                )  # fmt: skip
            axes.axhline(0.0, color="#999999", lw=0.8, ls=(0, (1, 2)))
            axes.set_xlabel(label)
            axes.set_ylabel(title)
        figure.axes[0].legend(loc="best")
        figure.suptitle(f"{design.name}: yes/no", x=0.01, ha="left", fontsize=10)
        figure.tight_layout()
    return figure


def adjustments_figure(sessions: Sequence[dict[str, Any]], design: ExperimentDesign) -> Figure:
    """Return all settings of each standard, and the PSE with its interval for each session."""
    factor, label = _axis(design)
    names = [standard.name for standard in design.standards()]
    values = [standard.value for standard in design.standards()]
    with style():
        figure = Figure(figsize=(min(2.6 + 1.1 * max(len(names), 2), PAGE_WIDTH), 3.7))
        axes = figure.subplots()
        for i, session in enumerate(sessions):
            room = 0.7 / (len(sessions) + 1)
            shift, beside = (i + 1) * room - 0.35, 0.2 * room
            colour, mark = COLOURS[i % 6], MARKERS[i % 6]
            for place, one in enumerate(session["standards"]):
                each = np.array(one["settings"]) * factor
                axes.plot(
                    np.full(len(each), place + shift - beside), each, mark, color=colour, ms=2.8,
                    alpha=0.4,
                )  # fmt: skip
                if one["pse_low"] is None:
                    continue
                low, mean, high = (factor * one[k] for k in ("pse_low", "pse", "pse_high"))
                axes.errorbar(
                    place + shift + beside, mean, yerr=[[mean - low], [high - mean]], fmt=mark,
                    color=colour, ms=5, capsize=2.5,
                    label=session["session"] if place == 0 and len(sessions) <= 6 else None,
                )  # fmt: skip
        if not design.stimuli.named:
            for place, value in enumerate(values):
                if value is not None:
                    axes.plot(
                        [place - 0.35, place + 0.35], [value * factor] * 2, color="black", lw=1.0,
                        ls=(0, (3, 2)), label="standard" if place == 0 else None,
                    )  # fmt: skip
            names = [f"{float(name) * factor:.4g}" for name in names]
        if design.matching.scale == "log":
            axes.set_yscale("log")
            log_scale(axes, x=False, y=True)
        axes.set_xticks(range(len(names)), names)
        axes.set_xlim(-0.6, len(names) - 0.4)
        axes.set_xlabel("standard")
        axes.set_ylabel(f"set: {label}")
        axes.set_title(f"{design.name}: settings, and PSE with its interval")
        axes.legend(loc="best")
        figure.tight_layout()
    return figure
