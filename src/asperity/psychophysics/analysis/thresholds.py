"""Thresholds of sessions of a forced choice, and what follows from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from asperity.errors import AsperityError
from asperity.psychophysics.analysis.detection import choice_summary
from asperity.psychophysics.analysis.overdispersion import overdispersion
from asperity.psychophysics.analysis.psychometric import quantile
from asperity.psychophysics.analysis.psychometric_fit import Fit, Interval, fit_psychometric
from asperity.psychophysics.analysis.results import SessionResult
from asperity.psychophysics.procedures.procedures import quest_plus, staircases
from asperity.psychophysics.procedures.questplus import QuestPlusSettings
from asperity.psychophysics.procedures.staircase import Staircase, StaircaseSettings
from asperity.psychophysics.settings import ForcedChoiceSettings

_SPANNED = (
    "threshold", "at_proportion", "pse", "jnd", "weber_fraction", "width", "slope", "lapse",
    "overdispersion",
)  # fmt: skip
COLUMNS = (
    "condition", "participant", "session", "simulated", "complete", "trials", "right", "function",
    "proportion",
    *(f"{name}{end}" for name in _SPANNED for end in ("", "_low", "_high")),
    "confidence", "deviance", "deviance_p", "at_bound", "not_fitted",
)  # fmt: skip
"""Of `thresholds.csv`: a row for each session."""


@dataclass(frozen=True)
class AnalysisOptions:
    """Options of an analysis.

    Parameters
    ----------
    function : {"logistic", "normal", "weibull"}
    samples : int
        Of the bootstrap.
    confidence : float
        Of the intervals.
    seed : int
        Of the bootstrap.
    proportion : float, optional
        Of right answers, at which a level is wanted beside the threshold.
    overdispersed : bool
        Whether estimates and intervals are corrected for the overdispersion of each session.
    """

    function: str = "weibull"
    samples: int = 1000
    confidence: float = 0.95
    seed: int = 0
    proportion: float | None = None
    overdispersed: bool = False


@dataclass(frozen=True)
class ThresholdAnalysis:
    """Psychometric analysis of one session of a forced choice."""

    result: SessionResult
    fit: Fit | None
    summary: dict[str, Any]
    tracks: list[Staircase]

    def row(self, condition: str) -> dict[str, Any]:
        """Return the session's row of `thresholds.csv`."""
        known = {"condition": condition, "participant": self.result.participant,
                 "session": self.result.number}  # fmt: skip
        everything = self.summary | self.summary.get("psychometric", {}) | known
        return {
            name: float(f"{value:.6g}") if isinstance(value, float) else value
            for name in COLUMNS if (value := everything.get(name)) is not None
        }  # fmt: skip


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

    def fitted(rho: float) -> Fit:
        return fit_psychometric(
            x, right, guess=settings.guess, function=options.function, samples=options.samples,
            confidence=options.confidence, seed=options.seed, adaptive=settings.adaptive,
            proportion=options.proportion, rho=rho,
        )  # fmt: skip

    try:
        fit = fitted(0.0)
    except AsperityError as error:
        summary["not_fitted"] = str(error)
    else:
        more = overdispersion(x, right, fit.function, options.confidence)
        if options.overdispersed and more is not None and more[0] > 0.0:
            fit = fitted(more[0])
        summary["psychometric"] = _numbers(settings, fit) | _spanned(
            "overdispersion", *(more or (None, None, None))
        )
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
                 "mean_of_reversals": _level(settings, t.threshold())}
                for t in tracks
            ],
        }  # fmt: skip
    if isinstance(adaptive, QuestPlusSettings):
        quest = quest_plus(result.design)
        for intensity, was in zip(x, right, strict=True):
            quest.answer(intensity, was)
        estimate = quest.estimate()
        summary["quest+"] = {
            "threshold": _level(settings, estimate["threshold"][0]),
            "threshold_sd_intensity": estimate["threshold"][1],
            "width": estimate["width"][0], "lapse": estimate["lapse"][0],
        }  # fmt: skip
    summary["d_prime"] = choice_summary(result, fit and fit.function, options.confidence)
    return ThresholdAnalysis(result, fit, summary, tracks)


def _numbers(settings: ForcedChoiceSettings, fit: Fit) -> dict[str, Any]:
    """Return the numbers of a fit; thresholds as levels, differences in the key's unit."""
    found = fit.function
    numbers: dict[str, Any] = {"function": found.function, "guess": found.guess}
    for name, value, span in (
        ("width", found.width, fit.width), ("slope", found.slope, fit.slope),
        ("lapse", found.lapse, fit.lapse),
    ):  # fmt: skip
        numbers |= _spanned(name, value, *span)
    numbers |= _levels(settings, "threshold", found.threshold, fit.threshold)
    if fit.level is not None and fit.proportion is not None:
        numbers["proportion"] = fit.proportion
        numbers |= _levels(settings, "at_proportion", found.at(fit.proportion), fit.level)
    if settings.signed:
        numbers |= _spanned("pse", *_pses(settings, fit))
        apart = _jnds(settings, fit)
    else:
        apart = [
            _difference(settings, intensity) for intensity in (found.threshold, *fit.threshold)
        ]
        apart[1:] = sorted(apart[1:])  # with direction = "down" the higher value is nearer
    numbers |= _spanned("jnd", *apart)
    if settings.standard != 0.0:
        numbers |= _spanned("weber_fraction", *(d / abs(settings.standard) for d in apart))
    return numbers | {
        "confidence": fit.confidence, "deviance": fit.deviance, "deviance_p": fit.deviance_p,
        "at_bound": fit.at_bound,
    }  # fmt: skip


def _spanned(
    name: str, value: float | None, low: float | None, high: float | None
) -> dict[str, float | None]:
    return {name: value, f"{name}_low": low, f"{name}_high": high}


def _levels(
    settings: ForcedChoiceSettings, name: str, value: float, span: Interval
) -> dict[str, float | None]:
    return _spanned(name, *(_level(settings, intensity) for intensity in (value, *span)))


def _level(settings: ForcedChoiceSettings, intensity: float) -> float | None:
    if not np.isfinite(intensity):
        return None
    return float(10.0**intensity) if settings.scale == "log" else float(intensity)


def _difference(settings: ForcedChoiceSettings, intensity: float) -> float:
    """Return how far the comparison of an intensity is from the standard, in the key's unit."""
    level = _level(settings, intensity)
    return float("nan") if level is None else abs(settings.comparison(level) - settings.standard)


def _pses(settings: ForcedChoiceSettings, fit: Fit) -> list[float]:
    """Return the comparison that is as often taken for larger as for smaller, and its interval."""
    levels = (_level(settings, value) for value in (fit.function.threshold, *fit.threshold))
    return [float("nan") if level is None else settings.comparison(level) for level in levels]


def _jnds(settings: ForcedChoiceSettings, fit: Fit) -> list[float]:
    """Return half the difference between where F is 0.25 and 0.75, with its interval."""
    upper, lower = (float(quantile(part, fit.function.function)) for part in (0.75, 0.25))
    halves = [0.5 * (upper - lower) * width for width in (fit.function.width, *fit.width)]
    if settings.scale == "log":  # half a ratio, on its scale
        return [abs(settings.standard) * (10.0**half - 1.0) for half in halves]
    return [half * (abs(settings.standard) if settings.level == "weber" else 1.0)
            for half in halves]  # fmt: skip
