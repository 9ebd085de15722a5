"""Analysis of sessions: the numbers of `analysis.json`, and the data of the figures."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from asperity._core.output import write_json, write_whole
from asperity.errors import AsperityError
from asperity.psychophysics.analysis.adjustments import (
    adjustment_rows,
    analyse_adjustments,
    measures_by_standard,
)
from asperity.psychophysics.analysis.detection import analyse_detection, detection_rows
from asperity.psychophysics.analysis.group import Group, compare, group, plain
from asperity.psychophysics.analysis.magnitudes import Magnitudes, analyse_magnitudes
from asperity.psychophysics.analysis.methods import methods_text
from asperity.psychophysics.analysis.results import SessionResult, catch_summary
from asperity.psychophysics.analysis.scales import (
    Scale,
    circular_triads,
    fit_scale,
    predicted,
    wins,
)
from asperity.psychophysics.analysis.thresholds import COLUMNS, AnalysisOptions, analyse_threshold
from asperity.psychophysics.session.tables import ANSWER_COLUMNS, as_csv


def orders(results: list[SessionResult], names: list[str]) -> list[list[int]]:
    """Return each answer as a ranking of stimuli, largest first."""
    out = []
    for result in results:
        for answered in result.answers:
            places = [names.index(stimulus.name) for stimulus in answered.trial.stimuli]
            answer = answered.answer
            if isinstance(answer, list):
                out.append([places[i - 1] for i in answer])
            else:
                first = places[int(answer) - 1]
                out.append([first, *(place for place in places if place != first)])
    return out


def analyse_scales(
    results: list[SessionResult], options: AnalysisOptions
) -> tuple[dict[str, Any], list[Scale]]:
    """Return the scales of paired comparisons or rankings, pooled over sessions."""
    stimuli = results[0].design.all_stimuli()
    names = [stimulus.name for stimulus in stimuli]
    rows = orders(results, names)
    scales = [
        fit_scale(
            names, rows, model=model, samples=options.samples, confidence=options.confidence,
            seed=options.seed,
        )
        for model in ("bradley-terry", "thurstone")
    ]  # fmt: skip
    table = wins(len(names), rows)
    circular, triads = circular_triads(table)
    summary = {
        "trials": len(rows), "stimuli": names, "values": [s.value for s in stimuli],
        "wins": table.astype(int).tolist(),
        "circular_triads": circular, "triads": triads,
        "scales": [
            {
                "model": scale.model, "values": scale.values.tolist(), "low": scale.low.tolist(),
                "high": scale.high.tolist(), "separated": scale.separated,
                "agreement": _agreement(scale, table),
            }
            for scale in scales
        ],
    }  # fmt: skip
    return summary, scales


def _agreement(scale: Scale, table: Any) -> float:
    """Return the mean probability of the observed choices under the scale."""
    return float(np.sum(table * predicted(scale)) / np.sum(table))


def magnitudes_summary(found: Magnitudes) -> dict[str, Any]:
    """Return magnitudes as a dict of JSON values."""
    fit = found.fit
    quadratic = None
    if fit is not None:
        quadratic = {
            "coefficients_log10_mm": fit.coefficients.tolist(), "r_squared": fit.r_squared,
            "peak": None if not np.isfinite(fit.peak_spacing) else fit.peak_spacing,
            "peak_low": found.peak[0] if found.peak else None,
            "peak_high": found.peak[1] if found.peak else None,
        }  # fmt: skip
    exponent = None
    if found.exponent is not None:
        exponent = dict(zip(("slope", "low", "high"), plain(found.exponent), strict=True))
    return {
        "stimuli": list(found.names), "values": plain(found.values), "mean": plain(found.mean),
        "low": plain(found.low), "high": plain(found.high),
        "by_session": {
            name: plain(row)
            for name, row in zip(found.sessions, found.by_session, strict=True)
        },
        "quadratic": quadratic, "power_law": exponent,
        "exponents": {
            name: dict(zip(("exponent", "exponent_low", "exponent_high"), plain(one), strict=True))
            for name, one in found.exponents.items()
        },
    }  # fmt: skip


def analyse(
    results: list[SessionResult], folder: Path, options: AnalysisOptions,
    on_session: Callable[[str], None] = lambda _: None,
) -> dict[str, Any]:  # fmt: skip
    """Analyse sessions of one experiment; write its files into a folder; return the numbers.

    Files: `analysis.json`, `answers.csv` of all sessions, `methods.md`, figures as PNG and SVG, and
    of forced choices `thresholds.csv`.

    Parameters
    ----------
    results : list of SessionResult
        Of one experiment.
    folder : Path
        An existing folder.
    options : AnalysisOptions
    on_session : callable, optional
        Called with the name of each session before its psychometric function is fitted.
    """
    return analyse_condition(results, results[0].design.name, folder, options, on_session)[0]


def analyse_condition(
    results: list[SessionResult], name: str, folder: Path, options: AnalysisOptions,
    on_session: Callable[[str], None] = lambda _: None,
) -> tuple[dict[str, Any], list[dict[str, Any]], dict[str, Group]]:  # fmt: skip
    """Analyse one condition, as `analyse`; return its numbers, its rows of thresholds, and groups.

    Groups are means over participants, by measure.
    """
    from asperity.drawing import figure_style
    from asperity.psychophysics.analysis import figures, group_figures

    design = results[0].design
    summary: dict[str, Any] = {
        "schema": 1, "experiment": design.name, "method": design.method,
        "sessions": [
            {"name": r.name, "answers": len(r.answers), "complete": r.complete,
             "simulated": r.simulated}
            for r in results
        ],
        "seed": options.seed, "bootstrap_samples": options.samples,
        "confidence": options.confidence,
    }  # fmt: skip
    rows: list[dict[str, Any]] = []
    if design.method == "magnitude":
        found = analyse_magnitudes(results, confidence=options.confidence)
        summary["magnitude"] = magnitudes_summary(found)
        figure_style.save(figures.magnitude_figure(found, design), folder, "magnitude")
    elif design.adaptive is not None:
        thresholds = []
        for result in results:
            on_session(result.name)
            thresholds.append(analyse_threshold(result, options))
        summary[design.method] = [threshold.summary for threshold in thresholds]
        for threshold in thresholds:
            session = threshold.result.name
            figure_style.save(figures.track_figure(threshold), folder, f"trials_{session}")
            if threshold.fit is not None:
                figure_style.save(
                    figures.psychometric_figure(threshold), folder, f"psychometric_{session}"
                )
        rows = [threshold.row(name) for threshold in thresholds]
        write_whole(folder / "thresholds.csv", as_csv(COLUMNS, rows))
    elif design.method == "yes-no":
        summary["yes-no"] = analyse_detection(results, options.confidence)
        figure = figures.detection_figure(summary["yes-no"], design)
        figure_style.save(figure, folder, "detection")
        tidy = detection_rows(summary["yes-no"])
        write_whole(folder / "detection.csv", as_csv(tuple(tidy[0]) if tidy else (), tidy))
    elif design.kind == "adjust":
        summary[design.method] = analyse_adjustments(results, options.confidence)
        figure = figures.adjustments_figure(summary[design.method], design)
        figure_style.save(figure, folder, "adjustments")
        tidy = adjustment_rows(summary[design.method])
        write_whole(folder / "adjustments.csv", as_csv(tuple(tidy[0]), tidy))
    else:
        summary[design.method], scales = analyse_scales(results, options)
        figure_style.save(figures.scale_figure(scales, design), folder, "scale")
        figure_style.save(figures.wins_figure(summary[design.method], design), folder, "choices")
    summary["catch"] = catch_summary(results)
    groups = _groups(results, rows, summary, options)
    summary["group"] = {measure: one.summary for measure, one in groups.items()}
    for measure, one in groups.items():
        if len(one.participants) > 1:
            figure_style.save(
                group_figures.people_figure(measure, one, design, options.proportion), folder,
                f"group_{measure}",
            )  # fmt: skip
    write_answers({name: results}, folder)
    write_whole(folder / "methods.md", methods_text({name: design}, results, options))
    write_json(folder / "analysis.json", summary)
    return summary, rows, groups


def _groups(
    results: list[SessionResult], rows: list[dict[str, Any]], summary: dict[str, Any],
    options: AnalysisOptions,
) -> dict[str, Group]:  # fmt: skip
    """Return the means over participants of what the method measures."""
    design = results[0].design
    measures: dict[str, bool] = {}
    if design.adaptive is not None:
        settings = design.forced_choice
        measures = {"pse": False, "jnd": True}
        if not settings.signed:
            measures = {"threshold": settings.scale == "log"}
            if options.proportion is not None:
                measures["at_proportion"] = settings.scale == "log"
    elif design.kind == "adjust":
        rows = [measures_by_standard(one) for one in summary[design.method]]
        names = [key for key in rows[0] if not key.endswith(("_low", "_high"))]
        logarithmic = design.matching.scale == "log"
        measures = {name: logarithmic or name.startswith("jnd") for name in names}
    elif design.method == "yes-no":
        measures = {"d_prime": False, "level_at_1": True}
        rows = [
            {**(one.get("all_levels") or (one["levels"] or [{}])[0]), **one.get("fit", {})}
            for one in summary["yes-no"]
        ]
    elif design.method == "magnitude":
        measures = {"exponent": False}
    known = [{**row, "participant": r.participant} for r, row in zip(results, rows, strict=False)]
    if design.method == "magnitude":
        own = summary["magnitude"]["exponents"]
        known = [{**row, "participant": name} for name, row in own.items()]
    made = {
        name: group(known, name, logarithmic=logarithmic, confidence=options.confidence)
        for name, logarithmic in measures.items()
    }
    return {name: one for name, one in made.items() if one is not None}


def write_answers(conditions: dict[str, list[SessionResult]], folder: Path) -> None:
    """Write `answers.csv`: the answers of all sessions as one tidy table."""
    rows = [
        {"condition": name, **row}
        for name, results in conditions.items() for result in results for row in result.rows
    ]  # fmt: skip
    write_whole(folder / "answers.csv", as_csv(("condition", *ANSWER_COLUMNS), rows))


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
