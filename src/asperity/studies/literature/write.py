"""Print the findings; write their files, figures and the page of the documentation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from asperity._core.output import write_whole
from asperity.drawing import figure_style
from asperity.studies.literature import figures
from asperity.studies.literature.laboratory import Laboratory
from asperity.studies.literature.page import DETAIL_FIGURES, details_page, page
from asperity.studies.literature.table import (
    CHOSEN,
    MARKS,
    Column,
    FindingResult,
    as_csv,
    as_json,
    count_findings,
)

_STYLES = {True: "bold green", False: "red", None: "dim"}


def print_table(rows: Sequence[FindingResult], columns: Sequence[Column]) -> None:
    """Print the table, with the reasons of skipped findings."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title="What the models predict of people", title_justify="left", pad_edge=False)
    table.add_column("finding")
    table.add_column("source")
    table.add_column("known")
    for column in columns:
        name = column.measure.name
        table.add_column(f"chosen: {name}" if column.name == CHOSEN else name, justify="center")
    for finding, verdicts in rows:
        marks = [verdicts[column.name].holds for column in columns]
        table.add_row(
            finding.title,
            finding.sources[0].short,
            finding.sureness.name.lower(),
            *(f"[{_STYLES[mark]}]{MARKS[mark]}[/]" for mark in marks),
        )
    table.add_section()
    tally = ["{} of {}".format(*count_findings(rows, column.name)) for column in columns]
    table.add_row("come out", "", "", *tally)
    console = Console()
    if not console.is_terminal:
        console = Console(width=150)
    console.print(table)
    notes = dict.fromkeys(
        f"{row.finding.id}: {verdict.note}"
        for row in rows
        for verdict in row.verdicts.values()
        if verdict.holds is None
    )
    for note in notes:
        console.print(f"skipped: {note}", highlight=False)
    chosen = any(column.name == CHOSEN for column in columns)
    after = "s of the 20-200 Hz band and of the last column were" if chosen else (
        " of the 20-200 Hz band was"
    )  # fmt: skip
    console.print(
        f"Conditions and thresholds are asperity's. The metric{after} chosen after the fact.",
        highlight=False,
    )


def figures_of(
    rows: Sequence[FindingResult],
    columns: Sequence[Column],
    labs: dict[str, Laboratory],
    fit: dict[str, Any],
) -> dict[str, Figure]:
    """Return every figure of the page with the findings one by one, by name."""
    first, last = columns[0], columns[-1]
    hand = last.hand
    title = (
        f"{last.measure.name}; hand {hand.mass:.2g} kg, {hand.stiffness:.3g} N/m, "
        f"{hand.damping:.2g} N s/m (chosen after the fact)"
    )
    made = {
        "findings_table": figures.table_figure(rows, columns),
        "findings_paper": figures.curves_figure(
            labs[first.name], first.measure, f"{first.measure.name}, the seed paper's; default hand"
        ),
        "findings_chosen": figures.curves_figure(labs[last.name], last.measure, title),
        "findings_grains": figures.grains_figure(
            [(labs[column.name], column.measure) for column in (first, last)]
        ),
        "findings_fit": figures.fit_figure(fit),
    }
    assert tuple(made) == DETAIL_FIGURES
    return made


class Ensemble(NamedTuple):
    """What the pages show of the ensemble, from `asperity.studies.ensemble`."""

    parts: dict[str, Any]
    """As `parts_summary` returns it."""
    figures: dict[str, Figure]
    """The figures `FIGURES` of the page, by name."""


def write_findings(
    rows: Sequence[FindingResult],
    columns: Sequence[Column],
    labs: dict[str, Laboratory],
    fit: dict[str, Any],
    ensemble: Ensemble,
    folder: Path,
) -> None:
    """Write findings.json, findings.csv, both pages and the figures (PNG, SVG) into a folder."""
    (folder / "findings.json").write_text(as_json(rows, columns), "utf-8")
    (folder / "findings.csv").write_text(as_csv(rows, columns), "utf-8")
    (folder / "findings.md").write_text(page(ensemble.parts), "utf-8")
    details = details_page(rows, columns, fit, ensemble.parts)
    (folder / "findings_details.md").write_text(details, "utf-8")
    for name, figure in (ensemble.figures | figures_of(rows, columns, labs, fit)).items():
        figure_style.save(figure, folder, name)


def write_docs(
    rows: Sequence[FindingResult],
    columns: Sequence[Column],
    labs: dict[str, Laboratory],
    fit: dict[str, Any],
    ensemble: Ensemble,
    docs: Path,
) -> None:
    """Write both pages into the folder of the documentation, their figures in images/."""
    for name, figure in (ensemble.figures | figures_of(rows, columns, labs, fit)).items():
        figure.savefig(docs / "images" / f"{name}.png", dpi=130)
    write_whole(docs / "findings.md", page(ensemble.parts, "images/"))
    details = details_page(rows, columns, fit, ensemble.parts, "images/")
    write_whole(docs / "findings_details.md", details)
