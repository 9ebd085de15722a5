"""The documentation page, made from the table and the fit: nothing in it is written by hand."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from asperity.studies.literature.catalogue import FINDINGS
from asperity.studies.literature.finding import Finding
from asperity.studies.literature.page_fit import fit_section
from asperity.studies.literature.page_text import figure, value_text, wrapped
from asperity.studies.literature.table import CHOSEN, MARKS, Column, FindingResult, counts

_NOTICE = "<!-- Made by `asperity findings --docs docs`: edit the code, not this page. -->"
FIGURES = ("findings_table", "findings_paper", "findings_chosen", "findings_grains", "findings_fit")


def page(
    rows: Sequence[FindingResult], columns: Sequence[Column], fit: dict[str, Any], images: str = ""
) -> str:
    """Return the page as Markdown; `images` is the folder of its figures, ending in a slash."""
    parts = [
        _head(rows, columns),
        figure(f"{images}findings_table.png", "Findings against metrics, yes and no"),
        _table(rows, columns),
        _how(),
        "## The findings one by one\n",
        *(_one(row, columns) for row in rows),
        _curves(columns, images),
        fit_section(fit, images),
        _limits(),
    ]
    return "\n".join(part.rstrip() + "\n" for part in parts)


def _head(rows: Sequence[FindingResult], columns: Sequence[Column]) -> str:
    tally = ", ".join(
        f"{column.measure.name} {hold} of {judged}"
        for column in columns
        for hold, judged in [counts(rows, column.name)]
    )
    lost = [r.finding.title for r in rows if not any(v.holds for v in r.verdicts.values())]
    none = "; ".join(lost) if lost else "none"
    text = f"""
People feel roughness through a probe in ways that have been published. This page holds
asperity's model (the texture force of Otaduy & Lin, 2004, and the hand of their Eq. 7) against
{len(rows)} such findings, under {len(columns)} metrics of vibration. Nobody was measured for it:
what people do is cited, and what is simulated is asperity's.

Findings that come out: {tally}.

Not under any of the metrics: {none}.

The last column's hand and metric were chosen by a [search](#one-metric-and-one-hand) for what
gets most findings: **after the fact**, as was the 20-200 Hz band before it. The others were there
before.
"""
    return f"{_NOTICE}\n\n# What the models predict of people\n\n{wrapped(text)}"


def _table(rows: Sequence[FindingResult], columns: Sequence[Column]) -> str:
    names = [c.measure.name.replace("|", "\\|") for c in columns]
    heads = [
        f"chosen: {name}" if c.name == CHOSEN else name
        for name, c in zip(names, columns, strict=True)
    ]
    lines = [
        "| finding | source | known | " + " | ".join(heads) + " |",
        "|---|---|---|" + "---|" * len(columns),
    ]
    for finding, verdicts in rows:
        marks = [_mark(verdicts[c.name].holds) for c in columns]
        source = finding.sources[0].short
        known = finding.sureness.name.lower()
        lines.append(
            f"| `{finding.id}` {finding.title} | {source} | {known} | " + " | ".join(marks) + " |"
        )
    tally = ["**{} of {}**".format(*counts(rows, c.name)) for c in columns]
    lines.append("| **come out** | | | " + " | ".join(tally) + " |")
    return "\n".join(lines) + "\n"


def _mark(holds: bool | None) -> str:
    return f"**{MARKS[True]}**" if holds else MARKS[holds]


def _how() -> str:
    return wrapped(
        """
Known: *seed*, as Otaduy & Lin (2004) report it; *read*, in the abstract of the source; *recalled*,
not checked. The bodies of the sources could not be read, so their probes, plates and speeds are
not known either: every number of a condition and every threshold of a criterion is asperity's.

Criteria were written from the sources before outcomes were looked at, except for the seed's seven,
whose outcomes under the studies' four metrics were known from `asperity study`. No threshold was
changed afterwards. After a first look the finger got three paths over the plate in place of one,
which changed no outcome. Where a criterion lets through what it should not, the caveat says so,
and it stays.
"""
    )


def _one(row: FindingResult, columns: Sequence[Column]) -> str:
    finding = row.finding
    out = [c for c in columns if row.verdicts[c.name].holds]
    judged = [c for c in columns if row.verdicts[c.name].holds is not None]
    if not judged:
        result = f"Skipped. {row.verdicts[columns[0].name].note}"
    elif finding.any_metric:
        result = _by_hand(row, columns)
    else:
        names = ", ".join(c.measure.name for c in out)
        result = f"Comes out under {len(out) or 'none'} of {len(judged)} metrics" + (
            f": {names}." if out else "."
        )
    lines = [
        f"### {finding.title}\n",
        f"`{finding.id}`. {_sources(finding)}\n",
        f"- **People:** {finding.people} ({_known(finding)})",
        f"- **Simulated:** {finding.condition}.",
        f"- **Comes out if** {finding.criterion}."
        + ("" if finding.before else " Written with outcomes known."),
        f"- **Result:** {result}",
    ]
    shown = [c for c in (columns[0], columns[-1]) if row.verdicts[c.name].measured]
    if finding.any_metric:
        shown = []
    for column in shown:
        told = _measured(row.verdicts[column.name].measured)
        lines.append(f"- Measured, {column.measure.name}: {told}.")
    if finding.caveat:
        lines.append(f"- **Caveat:** {finding.caveat}")
    return "\n".join(lines) + "\n"


def _by_hand(row: FindingResult, columns: Sequence[Column]) -> str:
    told = []
    for name, column in (("default hand", columns[0]), ("chosen hand", columns[-1])):
        verdict = row.verdicts[column.name]
        told.append(f"{name}: {MARKS[verdict.holds]} ({_measured(verdict.measured)})")
    return "; ".join(told) + "."


def _sources(finding: Finding) -> str:
    told = [
        f"{s.authors} ({s.year}), {s.venue}" + (f", doi:{s.doi}" if s.doi else "")
        for s in finding.sources
    ]
    where = f" ({finding.where})" if finding.where else ""
    return "; ".join(told) + where + "."


def _known(finding: Finding) -> str:
    return finding.sureness.value


def _measured(measured: dict[str, Any]) -> str:
    return "; ".join(
        f"{name.replace('_', ' ')} {value_text(value)}" for name, value in measured.items()
    )


def _curves(columns: Sequence[Column], images: str) -> str:
    chosen = columns[-1]
    return f"""## The curves

Stars are tops by a parabola through three samples; dotted lines are drop points.

{figure(f"{images}findings_paper.png", "Curves of the seed paper's metric")}
{figure(f"{images}findings_chosen.png", f"Curves of {chosen.measure.name}")}
{figure(f"{images}findings_grains.png", "Generated grains, by size")}"""


def _limits() -> str:
    text = """
Make it again with `asperity findings --docs docs`; the fit with
`asperity findings --fit --out DIR`, whose `fit.json` replaces
`src/asperity/studies/literature/published_fit.json`.
"""
    return f"""## What this is not

- {len(FINDINGS)} findings are few, and not independent: seven share three experiments, and several
  read the same curves. Percentages over them are descriptive.
- They are orders and places of peaks. No rating of a person is fitted, since none could be read.
- The probe never leaves the surface, and the normal force is constant. With a probe that flies,
  other things may come out.
- The hand is a mass on a spring and a damper, dragged at constant speed. Its parameters in the
  search are not measurements of hands.

{wrapped(text)}"""
