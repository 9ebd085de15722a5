"""The page and the figures of a design: what was wanted, what was reached, and by whom."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from asperity.designing.candidate import DesignedSurface
from asperity.designing.forward import Demand
from asperity.designing.judge import EnsembleValues

_MOST_SHOWN = 12
"""Surfaces that a figure shows."""


def write_report(
    report: dict[str, Any],
    surfaces: Sequence[DesignedSurface],
    ensembles: Sequence[EnsembleValues],
    folder: Path,
) -> None:
    """Write `report.html` and its figures into an existing folder.

    Parameters
    ----------
    report : dict
        Contents of `design.json`.
    surfaces : sequence of DesignedSurface
    ensembles : sequence of EnsembleValues
        One for each tile of each surface.
    folder : Path
    """
    from asperity.drawing import figure_style
    from asperity.drawing.pages import data_uri, render

    figures = {"look": look_figure(surfaces)}
    if "series" in report:
        figures["series"] = series_figure(surfaces, ensembles)
    else:
        figures["targets"] = targets_figure(surfaces, ensembles)
    images = {}
    for name, figure in figures.items():
        figure_style.save(figure, folder, name, ("png",))
        images[name] = data_uri(folder / f"{name}.png")
    (folder / "report.html").write_text(
        render("design.html", report=report, images=images), "utf-8"
    )


def look_figure(surfaces: Sequence[DesignedSurface]) -> Any:
    """Return a picture of each surface as it is made, lit from one side."""
    import matplotlib.pyplot as plt
    from matplotlib.colors import LightSource

    from asperity.drawing import figure_style

    tiles = [
        (f"{i + 1}: {one.kind}" + ("" if s is None else f", pitch {s * 1e3:.3g} mm"), tile)
        for i, one in enumerate(surfaces) for s, tile in one.tiles.items()
    ][:_MOST_SHOWN]  # fmt: skip
    columns = min(len(tiles), 3)
    rows = -(-len(tiles) // columns)
    side = 8e-3
    with figure_style.style():
        figure, axes = plt.subplots(
            rows, columns, squeeze=False, layout="constrained",
            figsize=(figure_style.REPORT_WIDTH * columns / 3, 2.75 * rows),
        )  # fmt: skip
        places = (np.arange(320) + 0.5) * side / 320
        light = LightSource(azdeg=315, altdeg=40)
        for axis in axes.ravel()[len(tiles) :]:
            axis.axis("off")
        for axis, (title, tile) in zip(axes.ravel(), tiles, strict=False):
            h = tile.made.heights(places[None, :], places[:, None])
            shade = light.hillshade(h, vert_exag=2.0, dx=side / 320, dy=side / 320)
            axis.imshow(shade, cmap="gray", origin="lower", extent=(0, 8, 0, 8), vmin=0, vmax=1)
            axis.set_title(title)
            axis.set_xlabel(f"mm; relief {tile.made.relief * 1e6:.0f} µm")
            axis.grid(False)
        plt.close(figure)
    return figure


def _varying(demands: Sequence[Demand]) -> list[str]:
    """Return a short label of each demand: only what differs between them."""
    parts = {
        "probe {:.3g} mm": [d.diameter * 1e3 for d in demands],
        "{:.3g} N": [d.force for d in demands],
        "{:.4g} mm/s": [d.speed * 1e3 for d in demands],
        "pitch {:.3g} mm": [(d.spacing or 0.0) * 1e3 for d in demands],
        "{:.3g} Hz": [float(np.sqrt(np.prod(d.measure.band))) for d in demands],
    }
    varying = {text: values for text, values in parts.items() if len(set(values)) > 1}
    if not varying:
        return [demands[0].measure.label] * len(demands)
    return [
        "\n".join(text.format(values[i]) for text, values in varying.items())
        for i in range(len(demands))
    ]


def targets_figure(surfaces: Sequence[DesignedSurface], ensembles: Sequence[EnsembleValues]) -> Any:
    """Return wanted and reached values, and the spread over the ensemble of hands."""
    import matplotlib.pyplot as plt

    from asperity.drawing import figure_style

    shown = list(surfaces[:6])
    demands = surfaces[0].demands
    labels = _varying(demands)
    with figure_style.style():
        width = figure_style.REPORT_WIDTH if len(demands) * len(shown) > 4 else 6.0
        figure, axis = plt.subplots(figsize=(width, 4.2), layout="constrained")
        at = np.arange(len(demands))
        for k, demand in enumerate(demands):
            axis.plot(
                [k - 0.42, k + 0.42], [demand.value] * 2, color="black", linewidth=2.0,
                label="wanted" if k == 0 else None,
            )  # fmt: skip
        used = 0
        for i, surface in enumerate(shown):
            of_tiles = ensembles[used : used + len(surface.tiles)]
            used += len(surface.tiles)
            place = at + (i - 0.5 * (len(shown) - 1)) * 0.8 / len(shown)
            spread = np.full((3, len(demands)), np.nan)
            for spacing, ensemble in zip(surface.tiles, of_tiles, strict=True):
                columns = [k for k, d in enumerate(demands) if d.spacing == spacing]
                spread[:, columns] = np.nanpercentile(ensemble.values[0], (10, 50, 90), axis=0)
            colour = figure_style.COLOURS[i % 6]
            axis.vlines(place, spread[0], spread[2], color=colour, linewidth=4.0, alpha=0.35)
            axis.plot(
                place, surface.reached, figure_style.MARKERS[i % 6], color=colour,
                label=f"{i + 1}: {surface.kind}",
            )  # fmt: skip
        axis.set_xticks(at, labels)
        unit = demands[0].measure.unit
        axis.set_ylabel(demands[0].measure.label.split(",")[0] + f" [{unit}]")
        axis.set_ylim(bottom=0.0)
        axis.set_title("Wanted and reached; bars: 10 to 90 % of 36 hands")
        figure.legend(*axis.get_legend_handles_labels(), loc="outside lower left", ncols=4)
        plt.close(figure)
    return figure


def series_figure(surfaces: Sequence[DesignedSurface], ensembles: Sequence[EnsembleValues]) -> Any:
    """Return the metric of a series for the designed hand and for the ensemble, by stimulus."""
    import matplotlib.pyplot as plt

    from asperity.drawing import figure_style

    number = np.arange(1, len(surfaces) + 1)
    with figure_style.style():
        figure, axis = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
        for j in range(ensembles[0].values.shape[1]):
            axis.plot(
                number, [one.values[0, j, 0] for one in ensembles], color="#9a9a94",
                linewidth=0.8, label="36 hands" if j == 0 else None,
            )  # fmt: skip
        axis.plot(
            number, [one.reached[0] for one in surfaces], "o-", color=figure_style.COLOURS[0],
            label="the hand of the design",
        )  # fmt: skip
        measure = surfaces[0].demands[0].measure
        axis.set_xticks(number)
        axis.set_xlabel("stimulus")
        axis.set_ylabel(f"{measure.label.split(',')[0]} [{measure.unit}]")
        axis.set_ylim(bottom=0.0)
        axis.set_title("A series evenly spaced for most hands")
        axis.legend()
        plt.close(figure)
    return figure
