"""Figures of the ensemble: claims against metrics, and for which hands a claim flips."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from numpy.typing import NDArray

from asperity.drawing.figure_style import style
from asperity.runs.vibration_metrics import METRICS
from asperity.studies.ensemble.run import Answer, EnsembleResult

_SHADES = LinearSegmentedColormap.from_list("share", ["#ffffff", "#9ecae1", "#08519c"])
_SHORT = {"band_rms": "RMS of u''\n20-200 Hz", "threshold_power": "threshold\npower"}
_FLIPPING = (
    "diameter.peak_smaller_spacing",
    "force.peak_stays",
    "speed.faster_at_large",
    "speed.peak_moves_right",
)
"""The claims, in both questions, that depend most on the hand."""


def metric_label(name: str) -> str:
    """Return a short name of a metric, on up to two lines."""
    return _SHORT.get(name, METRICS[name].label)


def claims_figure(result: EnsembleResult) -> Figure:
    """Return the share of the ensemble in which each claim holds, claims against metrics."""
    with style():
        figure = Figure(figsize=(10.6, 3.9))
        left, right = figure.subplots(1, 2, width_ratios=[1.0, 4.0])
        _shares(left, result.paper)
        left.set_title("(a) The paper's analysis:\nits sinusoid, its metric", loc="center")
        _shares(right, result.people)
        right.set_title("(b) People: jittered dots,\nevery metric", loc="center")
        members = [len(a.hands) * len(a.plates) for a in (result.paper, result.people)]
        figure.text(
            0.01, 0.015,
            f"Share of the ensemble in which a claim holds [%]: {members[0]} members in (a), "
            f"{members[1]} in (b). Grey: by construction, not counted.",
            fontsize=8.5, color="#444444",
        )  # fmt: skip
        figure.tight_layout(rect=(0, 0.05, 1, 1), w_pad=1.5)
    return figure


def _shares(axis: Axes, answer: Answer) -> None:
    shares = 100.0 * answer.shares.T
    for i, claim in enumerate(answer.claims):
        for j in range(shares.shape[1]):
            value = shares[i, j]
            shade = "#e4e4e4" if claim.by_construction else _SHADES(value / 100.0)
            axis.fill([j, j + 1, j + 1, j], [i, i, i + 1, i + 1], color=shade, ec="white", lw=1.5)
            dark = value > 60.0 and not claim.by_construction
            axis.text(
                j + 0.5, i + 0.5, f"{value:.0f}", ha="center", va="center",
                color="white" if dark else "#222222",
            )  # fmt: skip
    names = [claim.text for claim in answer.claims]
    axis.set(xlim=(0, shares.shape[1]), ylim=(len(names), 0))
    axis.set_yticks(np.arange(len(names)) + 0.5, names)
    axis.set_xticks(
        np.arange(shares.shape[1]) + 0.5, [metric_label(name) for name in answer.metrics]
    )
    _bare(axis)


def hands_figure(result: EnsembleResult) -> Figure:
    """Return for which m, k and b each claim holds, shaded by the share of the plates."""
    rows: tuple[tuple[str, Answer, str], ...] = (
        ("max u''\nover sinusoids", result.paper, "max_acceleration"),
        ("max u''\nover dots", result.people, "max_acceleration"),
        ("RMS of u''\n20-200 Hz\nover dots", result.people, "band_rms"),
    )
    with style():
        figure = Figure(figsize=(10.6, 5.4))
        axes = figure.subplots(len(rows), len(_FLIPPING), squeeze=False)
        for line, (label, answer, metric) in zip(axes, rows, strict=True):
            for axis, claim in zip(line, _FLIPPING, strict=True):
                _hands(axis, answer, metric, claim)
            line[0].set_ylabel(f"{label}\n\nm [g]")
        texts = {claim.id: claim.text for claim in result.people.claims}
        for axis, claim in zip(axes[0], _FLIPPING, strict=True):
            axis.set_title(texts[claim].replace(" at ", "\nat ", 1), loc="center", pad=16)
        for axis in axes[-1]:
            axis.set_xlabel("b [N s/m], within k [N/m]")
        figure.tight_layout(w_pad=0.8, h_pad=0.8, rect=(0, 0, 0.94, 1))
        bar = figure.add_axes((0.95, 0.25, 0.012, 0.5))
        bar.imshow(
            np.linspace(1, 0, 64)[:, None], cmap=_SHADES, aspect="auto", extent=(0, 1, 0, 100)
        )
        bar.yaxis.tick_right()
        bar.set(xticks=[], yticks=[0, 50, 100])
        bar.set_title("% of\nplates", fontsize=8, loc="center")
        bar.grid(False)
    return figure


def _hands(axis: Axes, answer: Answer, metric: str, claim: str) -> None:
    """Draw the share of plates of each hand: m upwards, b within k to the right."""
    index = [one.id for one in answer.claims].index(claim)
    share = answer.holds[:, :, answer.metrics.index(metric), index].mean(axis=1)
    masses = _levels([hand.mass for hand in answer.hands])
    stiff = _levels([hand.stiffness for hand in answer.hands])
    damp = _levels([hand.damping for hand in answer.hands])
    grid: NDArray[np.float64] = np.full((len(masses), len(stiff) * len(damp)), np.nan)
    for hand, value in zip(answer.hands, share.tolist(), strict=True):
        column = stiff.index(hand.stiffness) * len(damp) + damp.index(hand.damping)
        grid[masses.index(hand.mass), column] = value
    axis.pcolormesh(grid, cmap=_SHADES, vmin=0.0, vmax=1.0, edgecolors="white", linewidth=0.8)
    for k in range(1, len(stiff)):
        axis.axvline(k * len(damp), color="#555555", lw=1.0)
    axis.set_yticks(np.arange(len(masses)) + 0.5, [f"{mass * 1e3:g}" for mass in masses])
    axis.set_xticks(np.arange(grid.shape[1]) + 0.5, [f"{b:g}" for b in damp] * len(stiff))
    for k, value in enumerate(stiff):
        axis.text(
            (k + 0.5) * len(damp), len(masses) + 0.08, f"k {value:g}", ha="center", va="bottom",
            fontsize=7, color="#555555",
        )  # fmt: skip
    _bare(axis)


def _levels(values: Sequence[float]) -> list[float]:
    return sorted(set(values))


def _bare(axis: Axes) -> None:
    axis.tick_params(length=0)
    axis.grid(False)
    for spine in axis.spines.values():
        spine.set_visible(False)
