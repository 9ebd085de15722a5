"""The stability chart: the largest stable stiffness over damping, for each rate."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from asperity.drawing.figure_style import COLOURS, MARKERS, SMALLEST, log_scale, style
from asperity.studies.stability.measure import Stability


def stability_figure(result: Stability, title: str, stiffness: float) -> Figure:
    """Return the chart; `stiffness` [N/m] is the scene's.

    Lines are Colgate's bound `2 b / T`, full marks the scene without textures, open marks the
    textured scene: its median over the places above, its worst place below.
    """
    settings = result.settings
    dampings = np.asarray(settings.dampings)
    with style():
        figure = Figure(figsize=(7.2, 5.0), layout="constrained")
        axis = figure.subplots()
        for i, rate in enumerate(settings.rates):
            colour, marker = COLOURS[i % 6], MARKERS[i % 6]
            axis.plot(
                dampings, result.bound[i], "--", color=colour, lw=1.0,
                label=f"{rate / 1e3:g} kHz",
            )  # fmt: skip
            axis.plot(dampings, result.plain[i], marker, color=colour, ms=5.0, mew=0.0)
            for values in (result.median[i], result.textured[i]):
                axis.plot(dampings, values, marker, color=colour, ms=5.5, mfc="none", mew=0.9)
            axis.vlines(dampings, result.textured[i], result.median[i], color=colour, lw=0.5)
        axis.axhline(stiffness, color="0.4", lw=0.8, ls=":")
        axis.annotate(
            f"the scene's, {stiffness:g} N/m", (dampings[0], stiffness), (0, 3),
            textcoords="offset points", fontsize=SMALLEST, color="0.35",
        )  # fmt: skip
        log_scale(axis)
        axis.set_xlabel("damping of device and hand [N s/m]")
        axis.set_ylabel("largest stable stiffness [N/m]")
        axis.set_title(f"{title}: below its mark a stiffness is stable")
        rates = [line for line in axis.get_lines() if not str(line.get_label()).startswith("_")]
        # Beside the chart: within, they would hide marks of some scene.
        figure.legend(handles=rates, title="tick rate", loc="outside right upper")
        grey: dict[str, Any] = {"color": "0.3", "ms": 5.5, "mew": 0.9}
        kinds = [
            Line2D([], [], ls="--", label="Colgate's bound, 2 damping x rate", **grey),
            Line2D([], [], ls="", marker="o", label="plain wall", **grey),
            Line2D([], [], ls="-", lw=0.5, marker="o", mfc="none",
                   label="textured: median, and worst place", **grey),
        ]  # fmt: skip
        figure.legend(handles=kinds, loc="outside lower center", ncols=3)
    return figure
