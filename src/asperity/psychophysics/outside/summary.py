"""Means, scales and reliability of other people's answers, written to a folder."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from asperity._core.arrays import Array
from asperity._core.output import write_json
from asperity.drawing import figure_style
from asperity.drawing.figure_style import COLOURS, COLUMN_WIDTH, MARKERS, style
from asperity.psychophysics.analysis.scales import fit_scale
from asperity.psychophysics.outside.answers import Answers
from asperity.psychophysics.outside.reliability import mean_over_raters, rater_reliability

_SHOWN = 84
"""Most stimuli on the axis of a figure."""
_ROW = 0.19
"""Height of a stimulus in the figure [inch]."""


def comparable_ratings(answers: Answers) -> tuple[Array, str]:
    """Return ratings (people, cells) on one scale, and how they got there.

    If all are above 0, each person's are divided by their geometric mean and multiplied by that of
    all, and the logarithm is taken (base 10). Otherwise each person's mean is shifted to the mean
    of all.
    """
    raw = answers.matrix()
    positive = bool(np.all(answers.table["rating"] > 0.0))
    values = np.log10(raw) if positive else raw
    centre = np.nanmean(values, axis=1, keepdims=True)
    how = (
        "log10 of ratings, each person's mean shifted to that of all"
        if positive
        else (
            "ratings, each person's mean shifted to that of all (there are zeros, so no logarithms)"
        )
    )
    return np.asarray(values - centre + np.nanmean(values)), how


def summarise_answers(
    answers: Answers, *, samples: int = 1000, confidence: float = 0.95, seed: int = 0
) -> dict[str, Any]:
    """Return the numbers of answers, ready for JSON: means or scale by cell, and reliability."""
    summary: dict[str, Any] = {
        "schema": 1, "form": answers.form, "method": answers.method,
        "read": answers.described(), "notes": list(answers.notes),
        "people": len(answers.participants), "stimuli": answers.stimuli,
        "conditions": answers.conditions, "seed": seed, "confidence": confidence,
    }  # fmt: skip
    if answers.method == "magnitude":
        values, how = comparable_ratings(answers)
        mean = mean_over_raters(values)
        rng, tails = np.random.default_rng(seed), 50.0 * (1.0 - confidence)
        people = len(values)
        low, high = np.full((2, mean.size), np.nan)
        if people > 1:
            drawn = [
                mean_over_raters(values[rng.integers(0, people, people)]) for _ in range(samples)
            ]
            low, high = np.nanpercentile(drawn, [tails, 100.0 - tails], axis=0)
        summary |= {"scale": how, "reliability": asdict(rater_reliability(values, seed=seed))}
    else:
        cells = answers.cells
        names = [", ".join(filter(None, cell)) for cell in cells]
        scale = fit_scale(
            names, answers.orders(), samples=samples, confidence=confidence, seed=seed
        )
        mean, low, high = scale.values, scale.low, scale.high
        summary["scale"] = "Bradley-Terry and Plackett-Luce, mean 0"
    summary["cells"] = [
        {"stimulus": stimulus, "condition": condition, "value": _plain(mean[i]),
         "low": _plain(low[i]), "high": _plain(high[i])}
        for i, (stimulus, condition) in enumerate(answers.cells)
    ]  # fmt: skip
    return summary


def _plain(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def write_summary(answers: Answers, summary: dict[str, Any], folder: Path) -> None:
    """Write analysis.json, the answers as tidy CSV, and a figure."""
    write_json(folder / "analysis.json", summary)
    answers.table.to_csv(folder / "answers.csv", index=False)
    figure_style.save(means_figure(summary), folder, "means")


def means_figure(summary: dict[str, Any]) -> Figure:
    """Return the mean or scale of each stimulus, in order of the first condition's."""
    conditions = summary["conditions"]
    by_condition: dict[str, dict[str, dict[str, Any]]] = {name: {} for name in conditions}
    for cell in summary["cells"]:
        by_condition[cell["condition"]][cell["stimulus"]] = cell
    first = by_condition[conditions[0]]
    order = sorted(
        summary["stimuli"],
        key=lambda s: first[s]["value"] if s in first and first[s]["value"] is not None else np.inf,
    )[:_SHOWN]
    with style():
        figure = Figure(figsize=(COLUMN_WIDTH, 1.0 + _ROW * max(len(order), 4)))
        axis = figure.subplots()
        for i, name in enumerate(conditions):
            cells = by_condition[name]
            at = [k for k, s in enumerate(order) if s in cells and cells[s]["value"] is not None]
            rows = [cells[order[k]] for k in at]
            shift = 0.6 * ((i + 0.5) / len(conditions) - 0.5)
            places = np.array(at) + shift
            values = np.array([row["value"] for row in rows])
            if rows and rows[0]["low"] is not None:
                ends = np.array([[row["low"], row["high"]] for row in rows], dtype=float).T
                axis.hlines(places, *ends, color=COLOURS[i % 6], lw=1.0, alpha=0.5)
            axis.plot(
                values, places, MARKERS[i % 6], color=COLOURS[i % 6], ms=4.0, mew=0.0,
                label=name or None,
            )  # fmt: skip
        # Names stand beside each other only if they are rows.
        axis.set_yticks(range(len(order)), order)
        axis.grid(axis="y", visible=False)
        axis.set(ylim=(len(order) - 0.2, -0.8), ylabel="stimulus", xlabel=_axis_label(summary))
        if len(conditions) > 1:
            axis.legend()
        figure.tight_layout()
    return figure


def _axis_label(summary: dict[str, Any]) -> str:
    if summary["method"] != "magnitude":
        return "scale"
    return "log10 rating" if summary["scale"].startswith("log10") else "rating"
