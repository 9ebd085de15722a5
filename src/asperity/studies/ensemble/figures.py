"""Figures of the ensemble: claims against metrics, and for which hands a claim flips."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from asperity.drawing.figure_style import REPORT_WIDTH, SMALLEST, style
from asperity.drawing.shares import draw_shares, hands_grid, make_bare
from asperity.runs.vibration_metrics import METRICS
from asperity.studies.ensemble.run import Answer, EnsembleResult

_SHORT = {"band_rms": "RMS of u''\n20-200 Hz", "threshold_power": "threshold\npower"}
_FLIPPING = (
    "diameter.peak_smaller_spacing",
    "force.peak_stays",
    "speed.faster_at_large",
    "speed.peak_moves_right",
)
"""The claims, in both questions, that depend most on the hand."""
_LABELS = 3.45
"""Room for the names of claims [inch]."""
_ROW = 0.29
"""Height of a row of claims [inch]."""


def metric_label(name: str) -> str:
    """Return a short name of a metric, on up to two lines."""
    return _SHORT.get(name, METRICS[name].label)


def claims_figure(result: EnsembleResult) -> Figure:
    """Return the share of the ensemble in which each claim holds, claims against metrics."""
    answers = (result.paper, result.people)
    titles = (
        "(a) Does the paper's analysis reproduce? Its sinusoid, its metric",
        "(b) Does the model predict people? Jittered dots, every metric",
    )
    heads = [0.55, 0.75]
    heights = [_ROW * len(answer.claims) for answer in answers]
    total = sum(heights) + sum(heads) + 0.55
    widest = max(len(answer.metrics) for answer in answers)
    cell = (REPORT_WIDTH - _LABELS - 0.1) / widest / REPORT_WIDTH
    with style():
        figure = Figure(figsize=(REPORT_WIDTH, total))
        top = total
        for answer, title, head, height in zip(answers, titles, heads, heights, strict=True):
            top -= head
            figure.text(0.01, (top + head - 0.2) / total, title, fontsize=10, va="center")
            axis = figure.add_axes((
                _LABELS / REPORT_WIDTH, (top - height) / total,
                cell * len(answer.metrics), height / total,
            ))  # fmt: skip
            _shares(axis, answer)
            top -= height
        members = [len(answer.hands) * len(answer.plates) for answer in answers]
        figure.text(
            0.01, 0.27 / total,
            f"Share of the members in which a claim holds [%]: {members[0]} in (a), {members[1]} "
            "in (b).\nGrey: by construction, not counted.",
            fontsize=SMALLEST, color="#444444", va="center",
        )  # fmt: skip
    return figure


def _shares(axis: Axes, answer: Answer) -> None:
    rows, columns = len(answer.claims), len(answer.metrics)
    counts = np.repeat(answer.counted[:, None], columns, axis=1)
    draw_shares(axis, answer.shares.T, counts)
    axis.set(xlim=(0, columns), ylim=(rows, 0))
    axis.set_yticks(
        np.arange(rows) + 0.5, [claim.text.replace(" (", "\n(") for claim in answer.claims]
    )
    axis.set_xticks(np.arange(columns) + 0.5, [metric_label(name) for name in answer.metrics])
    axis.xaxis.tick_top()
    make_bare(axis)


def hands_figure(result: EnsembleResult) -> Figure:
    """Return for which m, k and b each claim holds, shaded by the share of the plates."""
    columns: tuple[tuple[str, Answer, str], ...] = (
        ("max u'', sinusoids", result.paper, "max_acceleration"),
        ("max u'', dots", result.people, "max_acceleration"),
        ("RMS 20-200 Hz, dots", result.people, "band_rms"),
    )
    texts = {claim.id: claim.text for claim in result.people.claims}
    return hands_grid(
        [texts[claim] for claim in _FLIPPING],
        [(title, answer.hands) for title, answer, _ in columns],
        lambda i, j: _of_hands(columns[j][1], columns[j][2], _FLIPPING[i]),
    )


def _of_hands(answer: Answer, metric: str, claim: str) -> np.ndarray:
    """Return the share of the plates on which a claim holds, by hand."""
    index = [one.id for one in answer.claims].index(claim)
    return np.asarray(answer.holds[:, :, answer.metrics.index(metric), index].mean(axis=1))
