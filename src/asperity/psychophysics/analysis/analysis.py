"""Analysis of sessions: the numbers of `analysis.json`, and the data of the figures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from asperity._core.output import write_json, write_whole
from asperity.psychophysics.analysis.adjustments import (
    adjustment_rows,
    analyse_adjustments,
    measures_by_standard,
)
from asperity.psychophysics.analysis.catch_trials import catch_summary
from asperity.psychophysics.analysis.detection import analyse_detection, detection_rows
from asperity.psychophysics.analysis.group import Group, group
from asperity.psychophysics.analysis.magnitudes import Magnitudes, analyse_magnitudes
from asperity.psychophysics.analysis.methods import methods_text
from asperity.psychophysics.analysis.results import SessionResult
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
        exponent = dict(zip(("slope", "low", "high"), _plain(found.exponent), strict=True))
    return {
        "stimuli": list(found.names), "values": _plain(found.values), "mean": _plain(found.mean),
        "low": _plain(found.low), "high": _plain(found.high),
        "by_session": {
            name: _plain(row)
            for name, row in zip(found.sessions, found.by_session, strict=True)
        },
        "quadratic": quadratic, "power_law": exponent,
        "exponents": {
            name: dict(zip(("exponent", "exponent_low", "exponent_high"), _plain(one), strict=True))
            for name, one in found.exponents.items()
        },
    }  # fmt: skip


def _plain(values: Any) -> list[float | None]:
    return [float(v) if np.isfinite(v) else None for v in values]


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
    from asperity.psychophysics.analysis import figures, group_figures, procedure_figures

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
        figure = procedure_figures.detection_figure(summary["yes-no"], design)
        figure_style.save(figure, folder, "detection")
        tidy = detection_rows(summary["yes-no"])
        write_whole(folder / "detection.csv", as_csv(tuple(tidy[0]) if tidy else (), tidy))
    elif design.kind == "adjust":
        summary[design.method] = analyse_adjustments(results, options.confidence)
        figure = procedure_figures.adjustments_figure(summary[design.method], design)
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
