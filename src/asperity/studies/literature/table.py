"""The table: every finding under the studies' four metrics, and under the chosen design."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

from asperity.dynamics.dragged_hand.hand import Hand
from asperity.errors import require_choice
from asperity.studies.literature.catalogue import FINDINGS
from asperity.studies.literature.finding import Finding, Verdict
from asperity.studies.literature.laboratory import Laboratory, Plan, Tables, judge_or_explain
from asperity.studies.literature.measures import COLUMNS, Measure
from asperity.studies.skin.fingertip import Fingertip
from asperity.studies.skin.pressed_finger import PressedFinger

MARKS = {True: "yes", False: "no", None: "skipped"}
CHOSEN = "chosen"
"""Name of the column of the hand and metric that the search chose."""
AFTER_THE_FACT = ("band_rms", CHOSEN)
"""Columns whose metric was chosen when outcomes were known."""

FINGERS: dict[str, dict[str, Any]] = {
    "averaging": {},
    "pressed": {"skin": PressedFinger()},
    # Coarser than for a study: plates of dots are long.
    "soft": {"fingertip": Fingertip(pixel=40e-6, line=0.5e-3)},
}
"""Models of a bare finger: one that averages over its contact, which the table has; the unevenness
of the pressure on skin, whatever the metric; and the soft fingertip of `finger-plate`."""


class Column(NamedTuple):
    """A column of the table: a metric of the motion of a hand."""

    name: str
    hand: Hand
    measure: Measure

    @property
    def after_the_fact(self) -> bool:
        """Whether the metric was chosen when outcomes were known."""
        return self.name in AFTER_THE_FACT


class FindingResult(NamedTuple):
    """A finding and its verdicts, by the name of the column."""

    finding: Finding
    verdicts: dict[str, Verdict]


def make_columns(chosen: tuple[Hand, Measure] | None = None) -> list[Column]:
    """Return the studies' metrics with the default hand, and the chosen pair."""
    columns = [Column(name, Hand(), measure) for name, measure in COLUMNS.items()]
    return [*columns, Column(CHOSEN, *chosen)] if chosen else columns


def judge_all(
    columns: Sequence[Column],
    *,
    findings: Sequence[Finding] = FINDINGS,
    plan: Plan | None = None,
    data: Path | None = None,
    finger: str = "averaging",
    progress: Callable[[], None] | None = None,
) -> tuple[list[FindingResult], dict[str, Laboratory]]:
    """Judge findings in every column, with a model of `FINGERS` as the bare finger.

    Returns the rows, and each column's laboratory.
    """
    parts = FINGERS[require_choice("finger", finger, FINGERS)]
    tables: Tables = {}
    labs: dict[Hand, Laboratory] = {}
    for column in columns:
        if column.hand not in labs:
            labs[column.hand] = Laboratory(
                column.hand, plan or Plan(), data=data, tables=tables, **parts
            )  # fmt: skip
    rows = []
    for finding in findings:
        row, known = FindingResult(finding, {}), {}
        for column in columns:
            lab = labs[column.hand]
            # Some verdicts depend on the hand alone.
            if not finding.any_metric or column.hand not in known:
                known[column.hand] = judge_or_explain(finding, lab, column.measure)
            row.verdicts[column.name] = known[column.hand]
        rows.append(row)
        if progress:
            progress()
    return rows, {column.name: labs[column.hand] for column in columns}


def count_findings(rows: Sequence[FindingResult], column: str) -> tuple[int, int]:
    """Return how many findings come out in a column, of how many that count and were judged.

    What the model cannot fail does not count.
    """
    verdicts = [row.verdicts[column].holds for row in rows if not row.finding.by_construction]
    return sum(bool(holds) for holds in verdicts), sum(holds is not None for holds in verdicts)


def as_json(rows: Sequence[FindingResult], columns: Sequence[Column]) -> str:
    """Return the whole table as JSON."""
    text = json.dumps(document(rows, columns), indent=2, ensure_ascii=False, allow_nan=False)
    return text + "\n"


def document(rows: Sequence[FindingResult], columns: Sequence[Column]) -> dict[str, Any]:
    """Return the whole table as plain numbers, texts and lists."""
    return {
        "schema": 1,
        "columns": [_column(column, rows) for column in columns],
        "findings": [_finding(row) for row in rows],
    }


def as_csv(rows: Sequence[FindingResult], columns: Sequence[Column]) -> str:
    """Return the table as CSV, a line for each finding."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    names = [column.name for column in columns]
    writer.writerow(["id", "finding", "source", "sureness", "criterion_before_outcome", *names])
    for finding, verdicts in rows:
        about = [finding.id, finding.title, finding.sources[0].short, finding.sureness.value]
        marks = [MARKS[holds] for holds in (finding.before, *(verdicts[n].holds for n in names))]
        writer.writerow([*about, *marks])
    return text.getvalue()


def _column(column: Column, rows: Sequence[FindingResult]) -> dict[str, Any]:
    hold, total = count_findings(rows, column.name)
    return {
        "name": column.name,
        "metric": column.measure.name,
        "unit": column.measure.unit,
        "metric_after_the_fact": column.after_the_fact,
        "hand": asdict(column.hand),
        "hold": hold,
        "judged": total,
    }


def _finding(row: FindingResult) -> dict[str, Any]:
    finding = row.finding
    return {
        "id": finding.id,
        "title": finding.title,
        "people": finding.people,
        "sources": [
            {"who": source.short, "where": source.venue, "doi": source.doi or None}
            for source in finding.sources
        ],
        "where": finding.where,
        "sureness": finding.sureness.value,
        "condition": finding.condition,
        "criterion": finding.criterion,
        "criterion_before_outcome": finding.before,
        "by_construction": finding.by_construction,
        "added_after_the_search": finding.later,
        "caveat": finding.caveat,
        "verdicts": {name: verdict._asdict() for name, verdict in row.verdicts.items()},
    }
