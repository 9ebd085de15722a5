"""The shipped result of choosing on half of the findings over the ensemble: reading and figure.

It is made by `asperity findings --halves`, in `asperity.studies.ensemble.halves`, which uses this
package; here it is shown.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from asperity.drawing.figure_style import PAGE_WIDTH, SMALLEST, style
from asperity.studies.literature.catalogue import FINDINGS

PUBLISHED = Path(__file__).with_name("published_halves.json")
DESIGNS = {"paper": "max u''", "band": "RMS of u''\n20-200 Hz", "chosen": "choice"}
_NARROW = {"paper": "max\nu''", "band": "RMS\n20-200\nHz"}
"""Labels that a column of the figure is wide enough for."""
_SHADES = LinearSegmentedColormap.from_list("share", ["#ffffff", "#9ecae1", "#08519c"])


def read_published_halves() -> dict[str, Any]:
    """Return the shipped result, as `summarise_halves` gives it."""
    found: dict[str, Any] = json.loads(PUBLISHED.read_text("utf-8"))
    return found


def half_of(finding: str, halves: dict[str, Any]) -> str:
    """Return `chosen on`, `held out`, or `not counted`."""
    if finding in halves["halves"]["first"]:
        return "chosen on"
    return "held out" if finding in halves["halves"]["second"] else "not counted"


def halves_figure(halves: dict[str, Any]) -> Figure:
    """Return the share of the ensemble in which each finding comes out, half beside half."""
    titles = {finding.id: finding.title for finding in FINDINGS}
    parts = (("first", "half chosen on"), ("second", "half held out"))
    rows = max(len(halves["halves"][name]) for name, _ in parts) + 1
    with style():
        figure = Figure(figsize=(PAGE_WIDTH, 0.31 * rows + 1.3))
        for axis, (half, title) in zip(figure.subplots(1, 2), parts, strict=True):
            names = list(halves["halves"][half])
            names.sort(key=lambda name: -halves["findings"][name]["chosen"])
            for i, name in enumerate(names):
                for j, design in enumerate(DESIGNS):
                    _cell(axis, j, i, 100.0 * halves["findings"][name][design])
            for j, design in enumerate(DESIGNS):
                median = 100.0 * halves["shares"][design][half]["median"]
                axis.text(
                    j + 0.5, rows - 0.5, f"{median:.0f}", ha="center", va="center",
                    fontweight="bold",
                )  # fmt: skip
            axis.axhline(rows - 1.0 + 0.03, color="#555555", lw=0.8)
            labels = [*(titles[name] for name in names)]
            places = [*(np.arange(len(names)) + 0.5), rows - 0.5]
            axis.set_yticks(places, [*labels, "median member: share of the half"])
            axis.set_xticks(
                np.arange(len(DESIGNS)) + 0.5,
                [_NARROW.get(name, label) for name, label in DESIGNS.items()],
            )
            axis.xaxis.tick_top()
            axis.set(xlim=(0, len(DESIGNS)), ylim=(rows, 0))
            axis.set_title(f"{title} [%]", pad=6, loc="center")
            axis.tick_params(length=0)
            axis.grid(False)
            for spine in axis.spines.values():
                spine.set_visible(False)
        figure.tight_layout(w_pad=2.0)
    return figure


def _cell(axis: Any, column: int, row: int, share: float) -> None:
    x, y = column, row
    axis.fill(
        [x, x + 1, x + 1, x], [y, y, y + 1, y + 1], color=_SHADES(share / 100.0), ec="white", lw=1.5
    )
    colour = "white" if share > 60.0 else "#222222"
    axis.text(
        x + 0.5, y + 0.5, f"{share:.0f}", ha="center", va="center", color=colour, fontsize=SMALLEST
    )
