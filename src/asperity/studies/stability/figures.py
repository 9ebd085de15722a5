"""The stability chart: the largest stable stiffness over damping, for each rate."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from asperity.drawing.figure_style import COLOURS, MARKERS, style
from asperity.studies.stability.measure import Stability


def stability_figure(result: Stability, title: str, stiffness: float) -> Figure:
    """Return the chart; `stiffness` [N/m] is the scene's.

    Lines are Colgate's bound `2 b / T`, full marks the scene without textures, open marks the
    textured scene: its median over the places above, its worst place below.
    """
    settings = result.settings
    dampings = np.asarray(settings.dampings)
    with style():
        figure = Figure(figsize=(6.4, 4.4))
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
            f"the scene's, {stiffness:g} N/m", (dampings[-1], stiffness), (0, 3),
            textcoords="offset points", fontsize=8, color="0.35", ha="right",
        )  # fmt: skip
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.set_xlabel("damping of device and hand [N s/m]")
        axis.set_ylabel("largest stable stiffness [N/m]")
        axis.set_title(
            f"{title}\nlines: Colgate's 2 b / T; full: plain wall; open: textured, median and worst"
        )
        axis.legend(title="rate", loc="upper left")
        figure.tight_layout()
    return figure
