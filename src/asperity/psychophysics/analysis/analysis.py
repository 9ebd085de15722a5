"""Analysis of sessions: the numbers of `analysis.json`, and the data of the figures."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from asperity._core.output import write_json
from asperity.errors import AsperityError
from asperity.psychophysics.analysis.adjustments import analyse_adjustments
from asperity.psychophysics.analysis.catch_trials import catch_summary
from asperity.psychophysics.analysis.detection import analyse_detection, choice_summary
from asperity.psychophysics.analysis.magnitudes import Magnitudes, analyse_magnitudes
from asperity.psychophysics.analysis.psychometric_fit import Fit, fit_psychometric
from asperity.psychophysics.analysis.results import SessionResult
from asperity.psychophysics.analysis.scales import (
    Scale,
    circular_triads,
    fit_scale,
    predicted,
    wins,
)
from asperity.psychophysics.procedures.procedures import quest_plus, staircases
from asperity.psychophysics.procedures.questplus import QuestPlusSettings
from asperity.psychophysics.procedures.staircase import Staircase, StaircaseSettings


@dataclass(frozen=True)
class ThresholdAnalysis:
    """Psychometric analysis of one session of a forced choice."""

    result: SessionResult
    fit: Fit | None
    summary: dict[str, Any]
    tracks: list[Staircase]


@dataclass(frozen=True)
class AnalysisOptions:
    """Options of an analysis: psychometric function, bootstrap, confidence level."""

    function: str = "weibull"
    samples: int = 1000
    confidence: float = 0.95
    seed: int = 0


def analyse_threshold(result: SessionResult, options: AnalysisOptions) -> ThresholdAnalysis:
    """Return the psychometric function of a session, and the adaptive method's own estimate."""
    settings, adaptive = result.design.forced_choice, result.design.adaptive
    x = [i for answered in result.answers if (i := answered.trial.intensity) is not None]
    right = [bool(answered.hit) for answered in result.answers]
    summary: dict[str, Any] = {
        "session": result.name, "complete": result.complete, "simulated": result.simulated,
        "trials": len(x), "right": float(np.mean(right)), "scale": settings.scale,
    }  # fmt: skip
    fit = None
    try:
        fit = fit_psychometric(
            x, right, guess=settings.guess, function=options.function, samples=options.samples,
            confidence=options.confidence, seed=options.seed,
            adaptive=settings.adaptive,
        )  # fmt: skip
    except AsperityError as error:
        summary["not_fitted"] = str(error)
    else:
        found = fit.function
        summary["psychometric"] = {
            "function": found.function, "guess": found.guess, "lapse": found.lapse,
            "threshold": _level(settings.scale, found.threshold),
            "threshold_low": _level(settings.scale, fit.threshold.low),
            "threshold_high": _level(settings.scale, fit.threshold.high),
            "width": found.width, "width_low": fit.width.low, "width_high": fit.width.high,
            "confidence": fit.confidence, "deviance": fit.deviance, "deviance_p": fit.deviance_p,
            "at_bound": fit.at_bound,
        }  # fmt: skip
    tracks: list[Staircase] = []
    if isinstance(adaptive, StaircaseSettings):
        tracks = staircases(result.design)
        for answered in result.answers:
            assert answered.trial.track is not None
            tracks[answered.trial.track - 1].answer(bool(answered.hit))
        summary["staircase"] = {
            "target": adaptive.target,
            "tracks": [
                {"trials": t.done, "reversals": len(t.reversal_intensities), "over": t.is_over,
                 "mean_of_reversals": _level(settings.scale, t.threshold())}
                for t in tracks
            ],
        }  # fmt: skip
    if isinstance(adaptive, QuestPlusSettings):
        quest = quest_plus(result.design)
        for intensity, was in zip(x, right, strict=True):
            quest.answer(intensity, was)
        estimate = quest.estimate()
        summary["quest+"] = {
            "threshold": _level(settings.scale, estimate["threshold"][0]),
            "threshold_sd_intensity": estimate["threshold"][1],
            "width": estimate["width"][0], "lapse": estimate["lapse"][0],
        }  # fmt: skip
    summary["d_prime"] = choice_summary(result, fit and fit.function, options.confidence)
    return ThresholdAnalysis(result, fit, summary, tracks)


def _level(scale: str, intensity: float) -> float | None:
    if not np.isfinite(intensity):
        return None
    return float(10.0**intensity) if scale == "log" else float(intensity)


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
        exponent = dict(zip(("slope", "low", "high"), found.exponent, strict=True))
    return {
        "stimuli": list(found.names), "values": _plain(found.values), "mean": _plain(found.mean),
        "low": _plain(found.low), "high": _plain(found.high),
        "by_session": {
            name: _plain(row)
            for name, row in zip(found.sessions, found.by_session, strict=True)
        },
        "quadratic": quadratic, "power_law": exponent,
    }  # fmt: skip


def _plain(values: Any) -> list[float | None]:
    return [float(v) if np.isfinite(v) else None for v in values]


def analyse(results: list[SessionResult], folder: Path, options: AnalysisOptions) -> dict[str, Any]:
    """Analyse sessions; write `analysis.json` and figures into a folder; return the numbers.

    Parameters
    ----------
    results : list of SessionResult
        Of one experiment.
    folder : Path
        An existing folder.
    options : AnalysisOptions
    """
    from asperity.drawing import figure_style
    from asperity.psychophysics.analysis import figures, procedure_figures

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
    if design.method == "magnitude":
        found = analyse_magnitudes(
            results, samples=options.samples, confidence=options.confidence, seed=options.seed
        )
        summary["magnitude"] = magnitudes_summary(found)
        figure_style.save(figures.magnitude_figure(found, design), folder, "magnitude")
    elif design.adaptive is not None:
        thresholds = [analyse_threshold(result, options) for result in results]
        summary[design.method] = [threshold.summary for threshold in thresholds]
        for threshold in thresholds:
            name = threshold.result.name
            figure_style.save(figures.track_figure(threshold), folder, f"trials_{name}")
            if threshold.fit is not None:
                figure_style.save(
                    figures.psychometric_figure(threshold), folder, f"psychometric_{name}"
                )
    elif design.method == "yes-no":
        summary["yes-no"] = analyse_detection(results, options.confidence)
        figure = procedure_figures.detection_figure(summary["yes-no"], design)
        figure_style.save(figure, folder, "detection")
    elif design.kind == "adjust":
        summary[design.method] = analyse_adjustments(results, options.confidence)
        figure = procedure_figures.adjustments_figure(summary[design.method], design)
        figure_style.save(figure, folder, "adjustments")
    else:
        summary[design.method], scales = analyse_scales(results, options)
        figure_style.save(figures.scale_figure(scales, design), folder, "scale")
        figure_style.save(figures.wins_figure(summary[design.method], design), folder, "choices")
    summary["catch"] = catch_summary(results)
    write_json(folder / "analysis.json", summary)
    return summary
