"""The documentation's pages on the findings, rendered from stored results, table and fit.

`findings.md` is what a reader wants to know; `findings_details.md` has each finding with what was
simulated and measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from asperity._core.digits import telling
from asperity.drawing.pages import render
from asperity.studies.literature.catalogue import FINDINGS
from asperity.studies.literature.halves_page import half_of, read_published_halves
from asperity.studies.literature.hand_search import UNITS
from asperity.studies.literature.table import CHOSEN, MARKS, Column, FindingResult, count_findings

FIGURES = ("findings_ensemble", "findings_hands")
"""Of the page."""
DETAIL_FIGURES = (
    "findings_table", "findings_paper", "findings_chosen", "findings_grains", "findings_fit",
)  # fmt: skip
"""Of the page with the findings one by one."""


def page(parts: dict[str, Any], images: str = "") -> str:
    """Return the page as Markdown; it needs no simulation.

    Parameters
    ----------
    parts : dict
        As `asperity.studies.ensemble.parts.parts_summary` returns it.
    images : str
        Folder of the figures, relative to the page, with a slash at its end.
    """
    return render(
        "findings.md",
        parts=parts, images=images, findings=FINDINGS, count=len(FINDINGS),
        can_fail=sum(not finding.by_construction for finding in FINDINGS),
        percent="{:.0%}".format, heights=_listed([f"{1e3 * h:g}" for h in parts["plates"]]),
        halves=read_published_halves(), half_of=half_of,
    )  # fmt: skip


def details_page(
    rows: Sequence[FindingResult],
    columns: Sequence[Column],
    fit: dict[str, Any],
    parts: dict[str, Any],
    images: str = "",
) -> str:
    """Return the page with the findings one by one, as Markdown.

    Parameters
    ----------
    rows, columns
        As `judge_all` returns and takes them.
    fit : dict
        As `run_fit` returns it.
    parts, images
        As for `page`.
    """
    return render(
        "findings_details.md",
        rows=rows, columns=columns, fit=fit, images=images, parts=parts,
        tallies=["{} of {}".format(*count_findings(rows, column.name)) for column in columns],
        nowhere=[r.finding.title for r in rows if not any(v.holds for v in r.verdicts.values())],
        held_out=_held_out(fit), gained=_gained(fit), result=lambda row: _result(row, columns),
        measured=_measured, chosen=CHOSEN, marks=MARKS, units=UNITS,
        halves=read_published_halves(), half_of=half_of,
    )  # fmt: skip


def value_text(value: Any) -> str:
    """Return a measured value as text: three digits, in lists more if neighbours need them."""
    if isinstance(value, list) and value and all(type(one) is float for one in value):
        return f"[{', '.join(telling(value))}]"
    if isinstance(value, list):
        inner = ", ".join(value_text(entry) for entry in value)
        return f"[{inner}]" if value and not isinstance(value[0], list) else inner
    if isinstance(value, bool):
        return MARKS[value]
    if isinstance(value, float):
        return f"{value:.3g}"
    return "none" if value is None else str(value)


def _listed(words: Sequence[str]) -> str:
    """Return words as a list in a sentence."""
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1])))


def _result(row: FindingResult, columns: Sequence[Column]) -> str:
    """Return how a finding came out."""
    verdicts = [row.verdicts[column.name] for column in columns]
    judged = [verdict for verdict in verdicts if verdict.holds is not None]
    if not judged:
        return f"Skipped. {verdicts[0].note}"
    if row.finding.any_metric:
        hands = [("default hand", verdicts[0]), ("chosen hand", verdicts[-1])]
        parts = [f"{name}: {MARKS[v.holds]} ({_measured(v.measured)})" for name, v in hands]
        return "; ".join(parts) + "."
    held = [c.measure.name for c in columns if row.verdicts[c.name].holds]
    count = f"Comes out under {len(held) or 'none'} of {len(judged)} metrics"
    return f"{count}: {', '.join(held)}." if held else f"{count}."


def _measured(measured: dict[str, Any]) -> str:
    return "; ".join(
        f"{name.replace('_', ' ')} {value_text(value)}" for name, value in measured.items()
    )


def _held_out(fit: dict[str, Any]) -> list[list[str]]:
    """Return the rows of the table of what the choice did not see."""
    boot, other = fit["bootstrap"], fit["held_out_conditions"]
    rows = [
        [f"finding `{name}`", *(MARKS[holds] for holds in row)]
        for name, row in fit["held_out_findings"].items()
    ]
    if any(any(row.values()) for row in other.values()):
        sets = fit["held_out_sets"]
        cells = [f"{sum(row.values())} of {sets * len(row)}" for row in other.values()]
        rows.append([f"all findings but the papers, {sets} other conditions", *cells])
    left = [boot["left_out"], boot["left_out_lucky"], *boot["left_out_of"].values()]
    return [*rows, ["findings that a bootstrap left out", *(f"{part:.0%}" for part in left)]]


def _gained(fit: dict[str, Any]) -> bool:
    """Return whether the search gained anything on what it did not see."""
    sums = {name: sum(row.values()) for name, row in fit["held_out_conditions"].items()}
    boot = fit["bootstrap"]
    better = boot["left_out"] > boot["left_out_of"]["band_rms"]
    return bool(sums["chosen"] > sums["band_rms"] and better)
