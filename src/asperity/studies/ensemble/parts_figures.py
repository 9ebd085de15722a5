"""Figures of the findings over the ensemble: findings against models, and hands that flip one."""

from __future__ import annotations

import textwrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from asperity._core.data import table_beside
from asperity.drawing.figure_style import COLUMN_WIDTH, SMALLEST, style
from asperity.drawing.shares import draw_shares, hands_grid, make_bare
from asperity.studies.ensemble.parts import PartsTable
from asperity.studies.literature.halves_page import half_of, read_published_halves

_TABLES = table_beside(__file__, "parts.toml")
SHOWN = _TABLES["shown"]
"""Groups of columns: designs, and what stands above them."""
GROUPS = _TABLES["groups"]
"""The findings of the picture by what they are about."""
FLIPPING = ("speed.large", "speed.small", "speed.peak", "drop.near")
"""Findings that depend most on the hand."""
_LABELS = 3.45
"""Room for the names of findings [inch]."""
_ROW = 0.238
"""Height of a row [inch]."""
_HEADS = 1.4
"""Room for the names of columns [inch]."""
_FOOT = 0.3
"""Room below the cells [inch]."""


def page_figures(table: PartsTable) -> dict[str, Figure]:
    """Return the figures of the documentation's page on the findings, by name."""
    return {"findings_ensemble": ensemble_figure(table), "findings_hands": flips_figure(table)}


def ensemble_figure(table: PartsTable) -> Figure:
    """Return findings against models, shaded by the share of the members that get them."""
    names = [name for _, columns in SHOWN for name, _ in columns]
    order = [finding.id for finding in table.findings]
    rows = sum(len(ids) + 1 for _, ids in GROUPS) + 1
    total = _ROW * rows + _HEADS + _FOOT
    with style():
        figure = Figure(figsize=(COLUMN_WIDTH, total))
        axis = figure.add_axes((
            _LABELS / COLUMN_WIDTH, _FOOT / total,
            (COLUMN_WIDTH - _LABELS - 0.08) / COLUMN_WIDTH, _ROW * rows / total,
        ))  # fmt: skip
        axis.set(xlim=(0, len(names)), ylim=(rows, 0))
        halves = read_published_halves()
        titles = {
            one.id: f"{one.title} †" if half_of(one.id, halves) == "held out" else one.title
            for one in table.findings
        }
        ticks, labels, top = [], [], 0
        for title, ids in GROUPS:
            left = -_LABELS / (COLUMN_WIDTH - _LABELS - 0.08) * len(names)
            axis.text(left + 0.1, top + 0.6, title, fontweight="bold", fontsize=SMALLEST,
                      va="center")  # fmt: skip
            top += 1
            shares = np.array([[table.share(name, one) for name in names] for one in ids])
            places = [order.index(one) for one in ids]
            counts = np.stack([table.counts(name)[places] for name in names], axis=1)
            draw_shares(axis, shares, counts, top)
            ticks += [top + i + 0.5 for i in range(len(ids))]
            labels += [titles[one] for one in ids]
            top += len(ids)
        for j, name in enumerate(names):
            axis.text(j + 0.5, rows - 0.45, f"{100.0 * table.median(name):.0f}", ha="center",
                      va="center", fontweight="bold")  # fmt: skip
        axis.set_yticks([*ticks, rows - 0.45], [*labels, "median member, of those that count"])
        _name_columns(axis)
        make_bare(axis)
        members = len(table.hands) * len(table.plates)
        figure.text(
            0.01, 0.1 / total, f"Share of {members} members in which a finding comes out [%]. "
            "†: the choice never saw it.",
            fontsize=SMALLEST, color="#444444", va="center",
        )  # fmt: skip
    return figure


def _name_columns(axis: Axes) -> None:
    """Write the names of columns above them, and of their groups above these."""
    axis.set_xticks([])
    at = 0
    for title, columns in SHOWN:
        for j, (_, label) in enumerate(columns):
            axis.text(at + j + 0.5, -0.2, label, rotation=90, ha="center", va="bottom",
                      fontsize=SMALLEST)  # fmt: skip
        axis.text(at + 0.5 * len(columns), -5.1, textwrap.fill(title, 14), ha="center",
                  va="center", fontsize=SMALLEST, color="#444444")  # fmt: skip
        axis.plot([at + 0.1, at + len(columns) - 0.1], [-4.2, -4.2], color="#999999", lw=0.8,
                  clip_on=False)  # fmt: skip
        at += len(columns)
        if at < 10:
            axis.axvline(at, color="#333333", lw=1.0)


def flips_figure(table: PartsTable) -> Figure:
    """Return for which m, k and b findings come out, shaded by the share of the plates."""
    columns = (("paper", "max u''"), ("band", "RMS 20-200 Hz"), ("chosen", "choice"))
    ids = [finding.id for finding in table.findings]
    titles = {finding.id: finding.title for finding in table.findings}
    return hands_grid(
        [titles[one] for one in FLIPPING],
        [(title, table.hands) for _, title in columns],
        lambda i, j: table.of(columns[j][0])[..., ids.index(FLIPPING[i])].mean(axis=1),
    )
