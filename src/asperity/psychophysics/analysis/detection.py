r"""Sensitivity and bias: d' and the criterion of yes/no, and d' of choices among intervals.

*Yes/no* (Macmillan & Creelman 2005, Detection Theory, 2nd ed.): with the rates H of yes with the
signal and F of yes without it, d' = z(H) - z(F) and c = -(z(H) + z(F)) / 2. Rates are log-linear,
(yes + 1/2) / (trials + 1), so that neither is 0 or 1 (Hautus 1995, Behav. Res. Methods 27, 46-51).
Intervals are by the variance of Gourevitch & Galanter (1967, Psychometrika 32, 25-33).

*Choices* of an observer without a preference for an interval, who takes

- the larger of two: p = Phi(d' / sqrt 2);
- the largest of three: p = integral of phi(x - d') Phi(x)^2 (Hacker & Ratcliff 1979, Percept.
  Psychophys. 26, 168-170);
- the one of three that is farthest from the two others, as in the triangle method (Frijters
  1979, Br. J. Math. Stat. Psychol. 32, 229-241; Ennis 1993, J. Sens. Stud. 8, 353-370):
  p = 2 integral over x > 0 of [Phi(-x sqrt 3 + d' sqrt(2/3)) + Phi(-x sqrt 3 - d' sqrt(2/3))]
  phi(x).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr, ndtri
from scipy.stats import beta, norm

from asperity.errors import AsperityError, require_between, require_choice
from asperity.psychophysics.analysis.detection_fit import fit_detection
from asperity.psychophysics.analysis.results import AnsweredTrial, SessionResult
from asperity.psychophysics.design import ExperimentDesign
from asperity.psychophysics.settings import YesNoSettings

TASKS = ("2afc", "3afc", "oddity")
"""The larger of two, the largest of three, the odd one out of three."""
MOST_D_PRIME = 20.0
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(200)
_LEAST = 10
"""Trials that a level needs to be listed."""
_REACH = 9.0
"""Of the normal deviate in integrals."""


class Estimate(NamedTuple):
    """A value and its confidence interval."""

    value: float
    low: float
    high: float


class YesNo(NamedTuple):
    """Sensitivity and bias of yes/no."""

    d_prime: Estimate
    criterion: Estimate
    hit_rate: float
    false_alarm_rate: float


def yes_no(
    hits: int, signals: int, false_alarms: int, without: int, confidence: float = 0.95
) -> YesNo:
    """Return d' and the criterion of yes/no answers; see the module.

    Parameters
    ----------
    hits, signals : int
        Answers "yes" with the signal, and trials with it.
    false_alarms, without : int
        Answers "yes" without the signal, and trials without it.
    confidence : float

    Raises
    ------
    AsperityError
        There are no trials with or without the signal, or more answers than trials.
    """
    for name, yes, trials in (("signal", hits, signals), ("no signal", false_alarms, without)):
        if trials < 1 or not 0 <= yes <= trials:
            raise AsperityError(
                f"{yes} answers yes in {trials} trials with {name} are not possible"
            )
    rates = np.array([(hits + 0.5) / (signals + 1), (false_alarms + 0.5) / (without + 1)])
    deviates = ndtri(rates)
    counts = np.array([signals + 1, without + 1])
    variances = rates * (1.0 - rates) / (counts * norm.pdf(deviates) ** 2)
    half = float(ndtri(0.5 + 0.5 * confidence)) * math.sqrt(float(variances.sum()))
    d = float(deviates[0] - deviates[1])
    c = -0.5 * float(deviates.sum())
    return YesNo(
        Estimate(d, d - half, d + half), Estimate(c, c - 0.5 * half, c + 0.5 * half),
        float(rates[0]), float(rates[1]),
    )  # fmt: skip


def proportion_right(d_prime: float, task: str) -> float:
    """Return how often a choice is right at a d' of 0 to `MOST_D_PRIME`; see the module.

    Parameters
    ----------
    d_prime : float
    task : {"2afc", "3afc", "oddity"}
    """
    require_choice("task", task, TASKS)
    require_between("d_prime", d_prime, 0.0, MOST_D_PRIME)
    if task == "2afc":
        return float(ndtr(d_prime / math.sqrt(2.0)))
    if task == "3afc":
        x = _REACH * _NODES
        return float(_REACH * np.sum(_WEIGHTS * norm.pdf(x) * ndtr(x + d_prime) ** 2))
    x = 0.5 * _REACH * (_NODES + 1.0)
    apart = d_prime * math.sqrt(2.0 / 3.0)
    chosen = ndtr(apart - math.sqrt(3.0) * x) + ndtr(-apart - math.sqrt(3.0) * x)
    return float(_REACH * np.sum(_WEIGHTS * chosen * norm.pdf(x)))


def d_prime_of(right: float, task: str) -> float:
    """Return the d' at which so many choices are right: 0 at the guess rate and below."""
    if right <= proportion_right(0.0, task):
        return 0.0
    if right >= proportion_right(MOST_D_PRIME, task):
        return MOST_D_PRIME
    return float(brentq(lambda d: proportion_right(d, task) - right, 0.0, MOST_D_PRIME))


def choice_d_prime(right: int, trials: int, task: str, confidence: float = 0.95) -> Estimate:
    """Return d' of so many right choices, of their log-linear rate.

    The interval is that of the proportion (Clopper & Pearson 1934, Biometrika 26, 404-413).
    """
    if trials < 1 or not 0 <= right <= trials:
        raise AsperityError(f"{right} right answers in {trials} trials are not possible")
    tail = 0.5 * (1.0 - confidence)
    low = float(beta.ppf(tail, right, trials - right + 1)) if right else 0.0
    high = float(beta.ppf(1.0 - tail, right + 1, trials - right)) if right < trials else 1.0
    value = (right + 0.5) / (trials + 1)
    return Estimate(*(d_prime_of(p, task) for p in (value, low, high)))


def task_of(design: ExperimentDesign) -> str | None:
    """Return the task of a design's choices; None of levels on both sides of the standard."""
    settings = design.forced_choice
    if settings.signed:
        return None
    if design.method == "odd-one-out":
        return "oddity"
    return "2afc" if settings.intervals == 2 else "3afc"


def choice_summary(
    result: SessionResult, function: Any, confidence: float
) -> dict[str, Any] | None:
    """Return d' by level, and the level where the fitted function has a d' of 1.

    Parameters
    ----------
    result : SessionResult
        Of a method of `CHOICES`.
    function : Psychometric or None
        As it was fitted.
    confidence : float

    Returns
    -------
    dict or None
        None where levels lie on both sides of the standard.
    """
    task = task_of(result.design)
    if task is None:
        return None
    by_level: dict[float, list[bool]] = {}
    for answered in result.answers:
        if answered.trial.level is not None and answered.right is not None:
            by_level.setdefault(answered.trial.level, []).append(answered.right)
    at_1 = None
    if function is not None:
        intensity = function.at(proportion_right(1.0, task))
        if math.isfinite(intensity):
            log = result.design.forced_choice.scale == "log"
            at_1 = 10.0**intensity if log else intensity
    return {
        "task": task, "level_at_1": at_1,
        "levels": [
            {"level": level, "trials": len(was), "right": sum(was),
             **_named("d_prime", choice_d_prime(sum(was), len(was), task, confidence))}
            for level, was in sorted(by_level.items()) if len(was) >= _LEAST
        ],
    }  # fmt: skip


def analyse_detection(
    results: Sequence[SessionResult], confidence: float, *, fitted: bool = True
) -> list[dict[str, Any]]:
    """Return sensitivity and bias of each session of yes/no, by level and over all levels.

    With `fitted` also the level of d' = 1, where there are two levels or more.
    """
    return [_session(result, confidence, fitted) for result in results]


def _session(result: SessionResult, confidence: float, fitted: bool) -> dict[str, Any]:
    signals = [a for a in result.answers if a.trial.right == 1]
    without = [a for a in result.answers if a.trial.right == 0]
    summary: dict[str, Any] = {
        "session": result.name, "complete": result.complete, "simulated": result.simulated,
        "trials": len(result.answers), "trials_without": len(without),
        "false_alarms": _yes(without), "levels": [],
    }  # fmt: skip
    if not signals or not without:
        summary["not_fitted"] = "trials with and without the signal are needed"
        return summary
    levels = sorted({a.trial.level for a in signals if a.trial.level is not None})
    for level in levels:
        own = [a for a in signals if a.trial.level == level]
        summary["levels"].append({"level": level, **_sensitivity(own, without, confidence)})
    if len(levels) > 1:
        # Of a mixture of levels: how well signals are distinguished from none in this session.
        summary["all_levels"] = _sensitivity(signals, without, confidence)
    if len(levels) > 1 and fitted:
        summary["fit"] = _level_at_1(result, summary["levels"], without, confidence)
    return summary


def _level_at_1(
    result: SessionResult, levels: Sequence[dict[str, Any]], without: Sequence[AnsweredTrial],
    confidence: float,
) -> dict[str, Any]:  # fmt: skip
    """Return the level of d' = 1; empty where levels lie on both sides of the standard."""
    settings = result.design.settings
    assert isinstance(settings, YesNoSettings)
    nought = settings.standard if settings.level == "value" else 0.0
    apart = [row["level"] - nought for row in levels]
    side = 1.0 if apart[0] > 0.0 else -1.0
    if any(side * distance <= 0.0 for distance in apart):
        return {}
    found = fit_detection(
        [side * distance for distance in apart], [row["hits"] for row in levels],
        [row["trials"] for row in levels], (_yes(without), len(without)), confidence,
    )  # fmt: skip
    value, *ends = (nought + side * x for x in (found.threshold, found.low, found.high))
    out: dict[str, Any] = {"at_limit": found.at_bound, "exponent": found.exponent,
                           "criterion_place": found.place}  # fmt: skip
    # What lies at the end of the search was not found.
    keys = ("level_at_1", "level_at_1_low", "level_at_1_high")
    values = (None, None, None) if found.at_bound else (value, *sorted(ends))
    return out | dict(zip(keys, values, strict=True))


def _sensitivity(
    signals: Sequence[AnsweredTrial], without: Sequence[AnsweredTrial], confidence: float
) -> dict[str, Any]:
    found = yes_no(_yes(signals), len(signals), _yes(without), len(without), confidence)
    return {
        "trials": len(signals), "hits": _yes(signals), "hit_rate": found.hit_rate,
        "false_alarm_rate": found.false_alarm_rate, **_named("d_prime", found.d_prime),
        **_named("criterion", found.criterion),
    }  # fmt: skip


def _yes(answers: Sequence[AnsweredTrial]) -> int:
    return sum(answered.answer == 1 for answered in answers)


def _named(name: str, found: Estimate) -> dict[str, float]:
    return {name: found.value, f"{name}_low": found.low, f"{name}_high": found.high}


def detection_rows(sessions: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return `detection.csv`: a row for each level of each session."""
    return [
        {"session": session["session"], "simulated": session["simulated"], **level,
         "trials_without": session["trials_without"], "false_alarms": session["false_alarms"]}
        for session in sessions for level in session["levels"]
    ]  # fmt: skip
