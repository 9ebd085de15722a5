"""Adjustments: the point of subjective equality is their mean, the JND their standard deviation.

On a logarithmic scale both are of logarithms: the PSE is the geometric mean, and the JND is how far
one standard deviation reaches above it. Intervals are Student's t of the mean and chi-squared of
the standard deviation, over the adjustments of one session: they hold for that participant.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import chi2
from scipy.stats import t as student

from asperity.psychophysics.adjustment_settings import MatchingSettings
from asperity.psychophysics.analysis.results import AnsweredTrial, SessionResult


class Setting(NamedTuple):
    """One adjustment that was settled."""

    standard: str
    value: float
    start: float
    steps: int


def settings_of(result: SessionResult) -> tuple[list[Setting], int]:
    """Return the settled adjustments of a session, and how many were given up."""
    by_track: dict[int, list[AnsweredTrial]] = {}
    for answered in result.answers:
        by_track.setdefault(answered.trial.track or 0, []).append(answered)
    found, given_up = [], 0
    for steps in by_track.values():
        first, last = steps[0].trial, steps[-1]
        assert last.trial.level is not None
        assert first.level is not None
        if last.answer == 0:
            found.append(Setting(first.stimuli[0].name, last.trial.level, first.level, len(steps)))
        elif last.trial.step == result.design.matching.steps:
            given_up += 1
    return found, given_up


def analyse_adjustments(
    results: Sequence[SessionResult], confidence: float
) -> list[dict[str, Any]]:
    """Return PSE and JND of each standard of each session."""
    return [_session(result, confidence) for result in results]


def _session(result: SessionResult, confidence: float) -> dict[str, Any]:
    design = result.design
    found, given_up = settings_of(result)
    summary: dict[str, Any] = {
        "session": result.name, "complete": result.complete, "simulated": result.simulated,
        "scale": design.matching.scale, "adjustments": len(found), "given_up": given_up,
        "standards": [],
    }  # fmt: skip
    for standard in design.standards():
        own = [setting for setting in found if setting.standard == standard.name]
        on_axis = not design.stimuli.named
        summary["standards"].append(
            {"standard": standard.name, "value": standard.value,
             "settings": [setting.value for setting in own],
             **_estimates(own, design.matching, standard.value if on_axis else None, confidence)}
        )  # fmt: skip
    return summary


def _estimates(
    own: Sequence[Setting], settings: MatchingSettings, standard: float | None, confidence: float
) -> dict[str, Any]:
    """Return the estimates of one standard, whose value is None if it is on another axis."""
    names = (
        "pse", "pse_low", "pse_high", "sd", "sd_low", "sd_high", "jnd", "jnd_low", "jnd_high",
        "constant_error", "weber", "mean_from_below", "mean_from_above",
    )  # fmt: skip
    out: dict[str, Any] = dict.fromkeys(names)
    if not own:
        return out
    x = np.array([settings.intensity(setting.value) for setting in own])

    def value(intensity: float) -> float:
        return float(10.0**intensity if settings.scale == "log" else intensity)

    mean, n = float(x.mean()), len(x)
    out["pse"] = value(mean)
    middle = 0.5 * (settings.intensity(settings.low) + settings.intensity(settings.high))
    starts = np.array([settings.intensity(setting.start) for setting in own])
    for name, chosen in (("below", starts < middle), ("above", starts >= middle)):
        if chosen.any():
            out[f"mean_from_{name}"] = value(float(x[chosen].mean()))
    if standard is not None:
        out["constant_error"] = out["pse"] - standard
    if n < 2:
        return out
    tail, sd = 0.5 * (1.0 - confidence), float(x.std(ddof=1))
    half = float(student.ppf(1.0 - tail, n - 1)) * sd / math.sqrt(n)
    out["pse_low"], out["pse_high"] = value(mean - half), value(mean + half)
    ends = [sd * math.sqrt((n - 1) / float(chi2.ppf(p, n - 1))) for p in (1.0 - tail, tail)]
    for name, spread in zip(("", "_low", "_high"), (sd, *ends), strict=True):
        out[f"sd{name}"] = spread
        out[f"jnd{name}"] = value(mean + spread) - out["pse"]
    out["weber"] = out["jnd"] / abs(out["pse"]) if out["pse"] else None
    return out


def measures_by_standard(session: dict[str, Any]) -> dict[str, Any]:
    """Return PSE and JND of a session with their intervals, named by standard if there are several.

    `pse`, `pse_low`, ..., or `pse_NAME`, `pse_NAME_low`, ...
    """
    standards = session["standards"]
    return {
        f"{kind}{'' if len(standards) == 1 else '_' + one['standard']}{end}": one[f"{kind}{end}"]
        for one in standards for kind in ("pse", "jnd") for end in ("", "_low", "_high")
    }  # fmt: skip


def adjustment_rows(sessions: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return `adjustments.csv`: a row for each standard of each session."""
    return [
        {"session": session["session"], "simulated": session["simulated"],
         "adjustments": len(one["settings"]),
         **{key: value for key, value in one.items() if key != "settings"}}
        for session in sessions for one in session["standards"]
    ]  # fmt: skip
