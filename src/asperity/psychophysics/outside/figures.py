"""A model beside people's answers, as a figure."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from asperity.drawing.figure_style import COLOURS, style


def comparison_figure(found: dict[str, Any]) -> Figure:
    """Return people against model over cells, and likelihoods between null and free cells."""
    x, y = np.array(found["model"]), np.array(found["mean"])
    levels = found["log_likelihood_per_answer"]
    with style():
        figure = Figure(figsize=(7.4, 3.3))
        left, right = figure.subplots(1, 2, width_ratios=[1.5, 1.0])
        left.plot(x, y, "o", color=COLOURS[0], ms=4.5, mew=0.0, alpha=0.8)
        ends = np.array([x.min(), x.max()])
        middle = y.mean() + found["slope"] * (ends - x.mean())
        left.plot(ends, middle, color=COLOURS[1], lw=1.2)
        ceiling = (found.get("reliability") or {}).get("ceiling")
        title = f"r = {found['correlation']:.2f}, ranks {found['rank_correlation']:.2f}"
        left.set_title(title + (f", ceiling {ceiling:.2f}" if ceiling is not None else ""))
        left.set(xlabel=f"log10 of the model: {found['model_name']}", ylabel="people")
        names = ("null", "model", "cells")
        right.plot([levels[name] for name in names], [2, 1, 0], "o-", color="#999999", ms=0, lw=1)
        for place, name, colour in zip(
            (2, 1, 0), names, (*COLOURS[4:5], *COLOURS[:2]), strict=True
        ):
            right.plot(levels[name], place, "o", color=colour, ms=7)
        shown = {"null": "null: people's\nmeans, chance", "model": "model,\none slope",
                 "cells": "free value\nfor each cell"}  # fmt: skip
        right.set_yticks([2, 1, 0], [shown[name] for name in names])
        right.set(ylim=(-0.5, 2.5), xlabel="log-likelihood an answer")
        right.grid(axis="y", visible=False)
        figure.tight_layout(w_pad=2.0)
    return figure
