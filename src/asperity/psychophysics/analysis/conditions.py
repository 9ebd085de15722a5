"""Experiments as conditions, compared within the people who took part in them."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from asperity._core.output import write_json, write_whole
from asperity.errors import AsperityError
from asperity.psychophysics.analysis.analysis import analyse_condition, write_answers
from asperity.psychophysics.analysis.group import Group, compare
from asperity.psychophysics.analysis.methods import methods_text
from asperity.psychophysics.analysis.results import SessionResult
from asperity.psychophysics.analysis.thresholds import COLUMNS, AnalysisOptions
from asperity.psychophysics.session.tables import as_csv


def analyse_conditions(
    conditions: dict[str, list[SessionResult]], folder: Path, options: AnalysisOptions,
    on_session: Callable[[str], None] = lambda _: None,
) -> dict[str, Any]:  # fmt: skip
    """Analyse several experiments, and compare them as conditions within people.

    Each condition's files are in a separate folder; beside them are `comparison.json`, the tables
    of all conditions, and a figure for each measure that is compared.

    Parameters
    ----------
    conditions : dict of list of SessionResult, by name
        All of one method.
    folder : Path
        An existing folder.
    options : AnalysisOptions
    on_session : callable, optional
        As of `analyse`.

    Raises
    ------
    AsperityError
        The conditions are not of one method.
    """
    from asperity.drawing import figure_style
    from asperity.psychophysics.analysis import group_figures

    methods = {name: results[0].design.method for name, results in conditions.items()}
    if len(set(methods.values())) > 1:
        raise AsperityError(
            "conditions must be of one method to be compared, got "
            + ", ".join(f"{name} ({method})" for name, method in methods.items())
        )
    summary: dict[str, Any] = {
        "schema": 1, "method": next(iter(methods.values())), "confidence": options.confidence,
        "conditions": {}, "comparisons": {},
    }  # fmt: skip
    groups: dict[str, dict[str, Group]] = {}
    rows: list[dict[str, Any]] = []
    for name, results in conditions.items():
        own = folder / file_name(name)
        own.mkdir()
        summary["conditions"][name], more, found = analyse_condition(
            results, name, own, options, on_session
        )
        rows += more
        for measure, one in found.items():
            groups.setdefault(measure, {})[name] = one
    designs = {name: results[0].design for name, results in conditions.items()}
    for measure, by_condition in groups.items():
        compared = compare(by_condition, options.confidence)
        summary["comparisons"][measure] = [one.summary for one in compared]
        figure = group_figures.conditions_figure(
            measure, by_condition, compared, designs, options.proportion
        )
        figure_style.save(figure, folder, f"comparison_{measure}")
    if rows:
        write_whole(folder / "thresholds.csv", as_csv(COLUMNS, rows))
    summary["notes"] = _shared_orders(conditions)
    everyone = [result for results in conditions.values() for result in results]
    write_answers(conditions, folder)
    write_whole(folder / "methods.md", methods_text(designs, everyone, options))
    write_json(folder / "comparison.json", summary)
    return summary


def _shared_orders(conditions: dict[str, list[SessionResult]]) -> list[str]:
    """Return a note if participants met the same random orders in several conditions."""
    met: dict[tuple[int, str, int], str] = {}
    for name, results in conditions.items():
        for result in results:
            key = (result.design.seed, result.participant, result.number)
            if met.setdefault(key, name) != name:
                return [
                    f"{met[key]} and {name} have the same seed ({result.design.seed}), so "
                    f"{result.participant} met the same random orders in both; give each condition "
                    "its own seed"
                ]
    return []


def file_name(name: str) -> str:
    """Return a name as that of a file: letters, digits, dots, hyphens and underscores."""
    return re.sub(r"[^A-Za-z0-9._-]+", "_", name).strip("._") or "condition"
